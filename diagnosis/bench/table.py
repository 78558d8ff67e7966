"""``shifts.csv`` as numbers in the units of its columns, before anything is made of them.

A slip of units can make a number impossible as a force or a time. So rows stay plain until they are
examined (``diagnosis.bench.slips``) and corrected (``diagnosis.bench.corrections``).

Errors of an operating point are common to its shifts (the model, the emulator, an odd entry), so
shifts that measured set values spread over many nearly equal points would count as so many
independent ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.trace_files import is_plain, read_trace
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, number_rule
from dogshape.sim.texts import read_table

COLUMNS = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s", "engaged",
           "trace", "shift_time_sd_s", "order", "timestamp")  # fmt: skip
NEEDED = COLUMNS[:5]  #: without the others, a source says nothing of them
NUMERIC = (*NEEDED, *COLUMNS[7:])
MOST = 1_000_000  #: shifts that a row may stand for; at one a second they take twelve days
ENGAGED = {"true": True, "false": False, "": None}
NEAR = 0.01  #: of a set value, up to which two are those of one operating point


@dataclass(frozen=True)
class Row:
    """A row as it stands: 1/min, N, s, s by the names of the columns.

    ``sd`` is the standard deviation of the ``n`` times of a mean, s. ``place`` is that in the
    series of all shifts: the order, or else the ``timestamp`` in s; None where the table does not
    say it.
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
    place: float | None = None
    timestamp: float | None = None


@dataclass(frozen=True)
class Sheet:
    """The rows of ``shifts.csv`` with their traces."""

    path: Path
    rows: tuple[Row, ...]


def load_sheet(path: Path) -> Sheet:
    """Read the table and its traces; a mistake raises DataError with file, row and column."""
    try:
        table = read_table(path, NUMERIC, COLUMNS)
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; a data set needs shifts.csv") from error
    table.require(NEEDED, COLUMNS)
    if not table.rows:
        raise DataError(f"{path} has no rows; a data set needs at least one shift")
    cells = [_Cells(path, row, dict(zip(table.head, those, strict=True)))
             for row, those in table.rows]  # fmt: skip
    rows = tuple(map(_read_row, cells))
    timed = [one for one in cells if one.text("shift_time_s")]
    for column in ("order", "timestamp"):
        empty = [one for one in timed if not one.text(column)]
        if empty and len(empty) < len(timed):
            rule = "filled, as other rows with a time have one; fill it everywhere or nowhere"
            raise empty[0].bad(column, rule)
    kinds = {is_plain(text): one for one in cells if (text := one.text("timestamp"))}
    if len(kinds) > 1:
        raise kinds[True].bad("timestamp", "a date and time as in the other rows")
    return Sheet(path, rows)


@dataclass(frozen=True)
class _Cells:
    """Cells of a row by the names of their columns."""

    path: Path
    row: int
    cells: dict[str, str]

    def text(self, column: str) -> str:
        return self.cells.get(column, "")

    def bad(self, column: str, rule: str) -> DataError:
        return bad_cell(self.path, self.row, column, self.text(column), rule)

    def number(self, column: str) -> float:
        """Read a finite number."""
        text = self.text(column)
        if not is_plain(text):
            raise self.bad(column, number_rule(text))
        if not np.isfinite(float(text)):
            raise self.bad(column, "a finite number")
        return float(text)

    def maybe(self, column: str) -> float | None:
        """Read a finite number, None for an empty cell."""
        return self.number(column) if self.text(column) else None

    def stamp(self) -> float | None:
        """Read a time stamp in s: ISO 8601 (UTC without a zone), or seconds."""
        text = self.text("timestamp")
        if not text or is_plain(text):
            return self.maybe("timestamp")
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            rule = "a date and time such as 2024-05-31T14:05:09, or seconds"
            raise self.bad("timestamp", rule) from None
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _read_row(cells: _Cells) -> Row:
    """Read a row; a mistake raises DataError."""
    mismatch, force, rise = (cells.number(column) for column in COLUMNS[:3])
    count = float(cells.text("n_shifts")) if is_plain(cells.text("n_shifts")) else 0.0
    if not 1 <= count < np.inf or count != int(count):
        rule = "a whole number of at least 1, the shifts that its time is the mean of: 1 for a "
        raise cells.bad("n_shifts", f"{rule}single shift")
    if count > MOST:
        rule = f"at most {MOST}: shifts that a stand has made, not a count of samples"
        raise cells.bad("n_shifts", rule)
    said = cells.text("engaged").lower()
    if said not in ENGAGED:
        raise cells.bad("engaged", "true, false or empty")
    engaged, time, sd = ENGAGED[said], cells.maybe("shift_time_s"), cells.maybe("shift_time_sd_s")
    if time is not None and engaged is False:
        raise cells.bad(
            "engaged", "true where shift_time_s has a time, or else that cell must be empty"
        )
    if sd is not None and (count < 2 or time is None):
        rule = "empty where there is no mean of two shifts or more (n_shifts, shift_time_s)"
        raise cells.bad("shift_time_sd_s", rule)
    # So large is a spread where one shift took all the time and the others none.
    most = (time or 0.0) * count**0.5
    if sd is not None and not 0.0 <= sd <= most:
        rule = f"between 0 and {most:.4g}: times above 0 of this mean cannot scatter by more"
        raise cells.bad("shift_time_sd_s", rule)
    order, stamp = cells.maybe("order"), cells.stamp()
    return Row(
        cells.row, mismatch, force, rise, int(count), time, True if time is not None else engaged,
        _trace(cells, int(count)), sd, stamp if order is None else order, stamp,
    )  # fmt: skip


def _trace(cells: _Cells, count: int) -> BenchTrace | None:
    given = Path(cells.text("trace"))
    if not cells.text("trace"):
        return None
    if count != 1:
        raise cells.bad("trace", "empty where n_shifts is not 1: it is one shift's")
    if given.is_absolute() or ".." in given.parts:
        raise cells.bad("trace", "a path inside the folder of the data set")
    try:
        return read_trace(cells.path.parent / given)
    except DataError as error:
        raise DataError(f"{cells.path}, row {cells.row}, column trace: {error}") from error


def bad_cell(path: Path, row: int, column: str, value: str, rule: str) -> DataError:
    """Return the error of one cell of a table: file, row, column, value, rule and remedy."""
    return DataError(
        f"{path}, row {row}, column {column} is '{value}', but it must be {rule}; correct the cell"
    )


def near_groups(rows: Sequence[Row]) -> tuple[Array, np.ndarray]:
    """Group rows by set values of which neighbours are near: values (rows, 3), groups (rows,)."""
    values = np.array([(row.mismatch, row.force, row.rise) for row in rows])
    labels = np.empty(values.shape)
    for place, column in enumerate(values.T):
        known, which = np.unique(column, return_inverse=True)
        apart = np.diff(known) > NEAR * np.maximum(abs(known[1:]), abs(known[:-1]))
        labels[:, place] = np.append(0, np.cumsum(apart))[which.ravel()]
    return values, np.unique(labels, axis=0, return_inverse=True)[1].ravel()


def joined_rows(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Give rows with nearly the same set values the mean of their shifts."""
    weights = np.array([row.n for row in rows], dtype=float)
    values, groups = near_groups(rows)
    for group in range(groups.max() + 1):
        mine = groups == group
        if (values[mine] != values[mine][0]).any():
            values[mine] = np.average(values[mine], axis=0, weights=weights[mine])
    return tuple(
        replace(row, mismatch=n, force=force, rise=rise)
        for row, (n, force, rise) in zip(rows, values.tolist(), strict=True)
    )
