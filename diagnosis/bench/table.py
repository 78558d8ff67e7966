"""``shifts.csv`` as numbers in the units of its columns, before anything is made of them.

A slip of units can make a number impossible as a force or a time. So rows stay plain until they are
examined (``diagnosis.bench.slips``) and corrected (``diagnosis.bench.corrections``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

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
)

NUMERIC = NEEDED = COLUMNS[:5]  #: without the others, a source says nothing of them
MOST = 1_000_000  #: shifts that a row may stand for; at one a second they take twelve days

ENGAGED = {"true": True, "false": False, "": None}


@dataclass(frozen=True)
class Row:
    """A row as it stands: 1/min, N, s, s by the names of the columns."""

    row: int
    mismatch: float
    force: float
    rise: float
    n: int
    time: float | None
    engaged: bool | None
    trace: BenchTrace | None = None


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
    rows = (_row(path, row, dict(zip(table.head, cells, strict=True))) for row, cells in table.rows)
    return Sheet(path, tuple(rows))


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
    mismatch, force, rise, count = (_number(path, row, record, column) for column in names)
    if count < 1 or count != int(count):
        raise bad_cell(path, row, "n_shifts", record["n_shifts"], "a whole number of at least 1")
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
    return Row(row, mismatch, force, rise, int(count), time, known, trace)


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
