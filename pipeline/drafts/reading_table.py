"""Reading of foreign tables of a stand as a record, and as a table and lines for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.bench.reading_report import ColumnReading, Exclusion, ReadingReport
from dogshape.pipeline.record import Table
from dogshape.sim.units import unit_of

HEADS = "quantity", "column", "unit in file", "decimals", "first", "least", "largest", "why"
TEXT_COLUMNS = (1, 7)  #: places of column and reason in ``HEADS``


@dataclass(frozen=True)
class BenchReading:
    """Content of the data set that was read from tables, and how it was read."""

    rows: int
    shifts: int
    timed_shifts: int
    report: ReadingReport
    warnings: list[str]  #: sentences on rows that are unlikely

    @property
    def assumed(self) -> list[str]:
        """Assumptions on tables and stand, each once."""
        return list(dict.fromkeys(self.report.assumed))

    @property
    def count_text(self) -> str:
        """Numbers of rows, shifts, and shifts with a time."""
        timed = f"{self.timed_shifts} of them with a time"
        return f"{self.rows} rows, {self.shifts} shifts, {timed}"

    def to_dict(self) -> dict[str, Any]:
        """Convert the reading to values of JSON."""
        return {
            "rows": self.rows,
            "shifts": self.shifts,
            "with_time": self.timed_shifts,
            **self.report.to_dict(),
            "assumed": self.assumed,
            "warnings": self.warnings,
        }


@dataclass(frozen=True)
class BenchFolder:
    """Written folder of a data set, and the reading of its tables."""

    folder: Path
    reading: BenchReading

    def to_dict(self) -> dict[str, Any]:
        """Convert to values of JSON."""
        return {"folder": str(self.folder), **self.reading.to_dict()}


def reading_parts(report: ReadingReport) -> list[str | Table]:
    """Tabulate columns with unit, decimals and values, then list excluded rows and columns."""
    parts: list[str | Table] = []
    if report.readings:
        rows = [_column_cells(column) for column in report.readings]
        parts += [Table(HEADS, rows, {}, TEXT_COLUMNS), ""]
    return [*parts, *left_out_lines(report.left_out)]


def left_out_lines(exclusions: Sequence[Exclusion]) -> list[str]:
    """List excluded rows and columns, a line for each reason."""
    places_by_reason: dict[str, list[str]] = {}
    for exclusion in exclusions:
        places_by_reason.setdefault(exclusion.reason, []).append(exclusion.place)
    return [
        f"left out: {', '.join(places)}: {reason}" for reason, places in places_by_reason.items()
    ]


def assumption_lines(assumed: Sequence[str]) -> list[str]:
    """Format assumptions, a line each."""
    return [f"assumed: {assumption}" for assumption in assumed]


def remark_lines(assumed: Sequence[str], warnings: Sequence[str]) -> list[str]:
    """List assumptions and warnings of a written draft, a line each."""
    return [*assumption_lines(assumed), *(f"warning: {line}" for line in warnings)]


def _column_cells(reading: ColumnReading) -> tuple[str, ...]:
    """Format the reading of a column, a cell for each head."""
    unit = unit_of(reading.quantity)  # of the values, whatever that of the file
    return (
        reading.quantity,
        reading.column,
        reading.unit or "-",
        reading.decimals or "-",
        _value_text(reading.first, unit),
        _value_text(reading.least, unit),
        _value_text(reading.largest, unit),
        reading.why,
    )


def _value_text(value: Any, unit: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g} {unit}".rstrip()
    return str(value)
