"""``shifts.csv`` as numbers in the units of its columns, before anything is made of them.

A slip of units can make a number impossible as a force or a time. So rows stay plain until they are
examined (``diagnosis.bench.slips``) and corrected (``diagnosis.bench.corrections``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.time_stamps import is_plain, seconds_of
from dogshape.diagnosis.bench.traces import BenchTrace, read_trace
from dogshape.sim.errors import DataError, number_rule
from dogshape.sim.texts import TextTable, read_table

COLUMNS = (
    "mismatch_rpm",
    "force_N",
    "force_rise_s",
    "n_shifts",
    "shift_time_s",
    "engaged",
    "trace",
    "shift_time_sd_s",
    "order",
    "timestamp",
)

NEEDED = COLUMNS[:5]  #: without the others, a source says nothing of them
NUMERIC = (*NEEDED, *COLUMNS[7:])
MOST = 1_000_000  #: shifts that a row may stand for; at one a second they take twelve days

ENGAGED = {"true": True, "false": False, "": None}


@dataclass(frozen=True)
class Row:
    """A row as it stands: 1/min, N, s, s by the names of the columns.

    ``sd`` is the standard deviation of the ``n`` times of a mean, s. ``order`` and ``timestamp``,
    s, are places in the series of all shifts; None where the table does not say them.
    """

    row: int
    mismatch: float
    force: float
    rise: float
    n: int
    time: float | None
    engaged: bool | None
    trace: BenchTrace | None = None
    sd: float | None = None
    order: float | None = None
    timestamp: float | None = None

    @property
    def place(self) -> float | None:
        """Place in the series: the order, or else the time."""
        return self.timestamp if self.order is None else self.order


@dataclass(frozen=True)
class Sheet:
    """The rows of ``shifts.csv`` with their traces."""

    path: Path
    rows: tuple[Row, ...]

    def with_rows(self, rows: tuple[Row, ...]) -> Sheet:
        """Return the same sheet with other rows."""
        return replace(self, rows=rows)


def load_sheet(path: Path) -> Sheet:
    """Read the table and its traces; a mistake raises DataError with file, row and column."""
    table = _table(path)
    records = [(row, dict(zip(table.head, cells, strict=True))) for row, cells in table.rows]
    rows = tuple(_row(path, row, record) for row, record in records)
    _require_whole_series(path, rows)
    _require_one_clock(path, records)
    return Sheet(path, rows)


def _require_whole_series(path: Path, rows: Sequence[Row]) -> None:
    """Raise DataError where some rows with a time have a place in the series and others none."""
    timed = [row for row in rows if row.time is not None]
    for column in ("order", "timestamp"):
        empty = [row.row for row in timed if getattr(row, column) is None]
        if empty and len(empty) < len(timed):
            rule = "filled, as other rows with a time have one; fill it everywhere or nowhere"
            raise bad_cell(path, empty[0], column, "", rule)


def _require_one_clock(path: Path, records: Sequence[tuple[int, dict[Any, Any]]]) -> None:
    """Raise DataError where some time stamps are dates and others seconds."""
    stamps = [(row, text) for row, record in records if (text := record.get("timestamp", ""))]
    kinds = {is_plain(text): (row, text) for row, text in stamps}
    if len(kinds) > 1:
        row, text = kinds[True]
        raise bad_cell(path, row, "timestamp", text, "a date and time as in the other rows")


def _table(path: Path) -> TextTable:
    try:
        table = read_table(path, NUMERIC, COLUMNS)
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; a data set needs shifts.csv") from error
    table.require(NEEDED, COLUMNS)
    if not table.rows:
        raise DataError(f"{path} has no rows; a data set needs at least one shift")
    return table


def _row(path: Path, row: int, record: dict[Any, Any]) -> Row:
    names = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts")
    mismatch, force, rise = (_number(path, row, record, column) for column in names[:3])
    count = float(record["n_shifts"]) if is_plain(record["n_shifts"]) else 0.0
    if not 1 <= count < np.inf or count != int(count):
        rule = "a whole number of at least 1, the shifts that its time is the mean of: 1 for a "
        raise bad_cell(path, row, "n_shifts", record["n_shifts"], f"{rule}single shift")
    if count > MOST:
        rule = f"at most {MOST}: shifts that a stand has made, not a count of samples"
        raise bad_cell(path, row, "n_shifts", record["n_shifts"], rule)
    engaged_text = record.get("engaged", "").lower()
    if engaged_text not in ENGAGED:
        raise bad_cell(path, row, "engaged", record["engaged"], "true, false or empty")
    time = _number(path, row, record, "shift_time_s") if record["shift_time_s"] else None
    engaged = ENGAGED[engaged_text]
    if time is not None and engaged is False:
        rule = "true where shift_time_s has a time, or else that cell must be empty"
        raise bad_cell(path, row, "engaged", "false", rule)
    trace = _trace(path, row, record.get("trace", ""), int(count))
    known = True if time is not None else engaged
    series = (
        _spread(path, row, record, int(count), time),
        _number(path, row, record, "order") if record.get("order") else None,
        _stamp(path, row, record.get("timestamp", "")),
    )
    return Row(row, mismatch, force, rise, int(count), time, known, trace, *series)


def _spread(
    path: Path, row: int, record: dict[Any, Any], count: int, time: float | None
) -> float | None:
    """Read the standard deviation of the times that a mean is of, s."""
    text = record.get("shift_time_sd_s", "")
    if not text:
        return None
    if count < 2 or time is None:
        rule = "empty where there is no mean of two shifts or more (n_shifts, shift_time_s)"
        raise bad_cell(path, row, "shift_time_sd_s", text, rule)
    value = _number(path, row, record, "shift_time_sd_s")
    # So large is it where one shift took all the time and the others none.
    most = time * count**0.5
    if not 0.0 <= value <= most:
        rule = f"between 0 and {most:.4g}: times above 0 of this mean cannot scatter by more"
        raise bad_cell(path, row, "shift_time_sd_s", text, rule)
    return value


def _stamp(path: Path, row: int, text: str) -> float | None:
    """Read a time stamp in s: a date and time as ISO 8601 has it (UTC without a zone), or s."""
    if not text:
        return None
    try:
        value = seconds_of(text)
    except ValueError:
        rule = "a date and time such as 2024-05-31T14:05:09, or seconds"
        raise bad_cell(path, row, "timestamp", text, rule) from None
    if not np.isfinite(value):
        raise bad_cell(path, row, "timestamp", text, "finite")
    return value


def _trace(path: Path, row: int, name: str, count: int) -> BenchTrace | None:
    if not name:
        return None
    if count != 1:
        raise bad_cell(path, row, "trace", name, "empty where n_shifts is not 1: it is one shift's")
    given = Path(name)
    if given.is_absolute() or ".." in given.parts:
        raise bad_cell(path, row, "trace", name, "a path inside the folder of the data set")
    try:
        return read_trace(path.parent / given)
    except DataError as error:
        raise DataError(f"{path}, row {row}, column trace: {error}") from error


def _number(path: Path, row: int, record: dict[Any, Any], column: str) -> float:
    try:
        value = float(record[column])
    except ValueError:
        raise bad_cell(path, row, column, record[column], number_rule(record[column])) from None
    if not np.isfinite(value):
        raise bad_cell(path, row, column, record[column], "a finite number")
    return value


def bad_cell(path: Path, row: int, column: str, value: str, rule: str) -> DataError:
    """Return the error of one cell of a table: file, row, column, value, rule and remedy."""
    return DataError(
        f"{path}, row {row}, column {column} is '{value}', but it must be {rule}; correct the cell"
    )
