"""Conventions of a record: time zero, place of the sensor, empty cells and sense of rotation.

No table of times shows them, and each decides what the times may mean. ``bench.toml`` states them
in ``[record]``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dogshape.diagnosis.bench.sense import Sense
from dogshape.sim.clutch_tables import Section
from dogshape.sim.errors import DataError

TimeZero = Literal["command", "force", "unknown"]
Place = Literal["sleeve", "actuator", "unknown"]
EmptyCells = Literal["not_made", "failed", "unknown"]

#: Keys of earlier versions by their path, with the key of ``[record]`` that has their place.
MOVED = {("mismatch_sense",): "sense", ("sensor", "displacement_at"): "displacement_at"}


class RecordSection(Section):
    """The table ``[record]``; each key may be left out."""

    time_zero: TimeZero = "unknown"
    displacement_at: Place = "unknown"
    empty_cells: EmptyCells = "unknown"
    sense: Sense = "known"

    def record(self) -> BenchRecord:
        """Build the record."""
        return BenchRecord(**self.model_dump())


@dataclass(frozen=True)
class BenchRecord:
    """Conventions by which a stand recorded its shifts.

    Parameters
    ----------
    time_zero : start of the shift times and of the traces: the command, which a dead time follows,
        or the first force, which no dead time follows.
    displacement_at : place of the displacement sensor.
    empty_cells : shifts of rows with neither a time nor ``engaged``: not made, or tried and failed.
    sense : sign of the mismatch, known or never noted (``diagnosis.bench.sense``).
    """

    time_zero: TimeZero = "unknown"
    displacement_at: Place = "unknown"
    empty_cells: EmptyCells = "unknown"
    sense: Sense = "known"


UNSAID = BenchRecord()


def with_record(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Move keys of earlier versions into ``[record]``; DataError where both are there."""
    data = {k: dict(v) if isinstance(v, dict) else v for k, v in data.items()}
    for (*tables, key), name in MOVED.items():
        table = data.get(tables[0], {}) if tables else data
        if not isinstance(table, dict) or key not in table:
            continue
        record = data.setdefault("record", {})
        if isinstance(record, dict) and name in record:
            old = ".".join((*tables, key))
            raise DataError(
                f"{path}: '{old}' is '{table[key]}' and 'record.{name}' is '{record[name]}', two "
                f"keys for one thing; leave out '{old}'"
            )
        record[name] = table.pop(key)
    return data
