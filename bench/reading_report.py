"""Record of a reading: faults, assumptions, readings, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from dogshape.sim.errors import DataError, join_faults


@dataclass(frozen=True)
class ColumnReading:
    """Reading of a column of a table; its fields are keys of the record of a reading."""

    file: str
    quantity: str  #: key of the quantity, with its unit
    column: str  #: head in the file, or formula
    unit: str | None  #: in the file; None for one without
    decimals: str | None  #: name of the decimal sign; None where no number shows one
    first: Any  #: first value, in the unit of the quantity; None for an empty column
    least: float | None  #: smallest number, in that unit; None for a column of texts
    largest: float | None
    why: str  #: reason of the reading


@dataclass(frozen=True)
class Exclusion:
    """Row or column of a table that is not read."""

    file: str
    reason: str
    row: int | None = None  #: number in the file; None for a column
    column: str = ""  #: head of the column; empty for a row

    @property
    def place(self) -> str:
        """Row or column in words."""
        return f"column '{self.column}'" if self.row is None else f"row {self.row}"

    def to_dict(self) -> dict[str, Any]:
        """Convert the exclusion to values of JSON."""
        place = {"column": self.column} if self.row is None else {"row": self.row}
        return {"file": self.file, **place, "reason": self.reason}


@dataclass
class ReadingReport:
    """Record of a reading: faults, assumptions, readings, excluded rows and columns."""

    faults: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    left_out: list[Exclusion] = field(default_factory=list)
    readings: list[ColumnReading] = field(default_factory=list)
    empty_rows: int = 0  #: rows with neither a time nor an outcome

    def to_dict(self) -> dict[str, Any]:
        """Convert readings and exclusions to values of JSON."""
        return {
            "columns": [vars(reading) for reading in self.readings],
            "left_out": [exclusion.to_dict() for exclusion in self.left_out],
        }

    def require(self, place: str) -> None:
        """Raise DataError with all faults, if there are any."""
        faults = list(dict.fromkeys(self.faults))
        if faults:
            raise DataError(join_faults(place, faults) if len(faults) > 1 else faults[0])
