"""``shifts.csv`` as numbers in the units of its columns, before anything is made of them.

A slip of units can make a number impossible as a force or a time. So rows stay plain until they are
examined (``diagnosis.bench.slips``) and corrected (``diagnosis.bench.corrections``).

Measured set values nearly agree and make one operating point into many. Errors of an operating
point are common to its shifts (the model, the emulator, an odd entry), so shifts that a table
spreads over many nearly equal points would count as so many independent ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dogshape.diagnosis.bench.foreign_cells import is_plain, seconds_of
from dogshape.diagnosis.bench.trace_files import read_trace
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
SCATTER = 0.2  #: of a set value, up to which measured values lie off it
APART = 2.0  #: times the largest gap within groups of measured values, the least gap between them
DENSE = 0.09  #: of a set value, the largest gap between neighbours among its measured values
EACH = 3  #: measured values of a group, on average at least


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
    timed = [row for row in rows if row.time is not None]
    for column in ("order", "timestamp"):
        empty = [row.row for row in timed if getattr(row, column) is None]
        if empty and len(empty) < len(timed):
            rule = "filled, as other rows with a time have one; fill it everywhere or nowhere"
            raise bad_cell(path, empty[0], column, "", rule)
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
        try:
            value = float(self.text(column))
        except ValueError:
            raise self.bad(column, number_rule(self.text(column))) from None
        if not np.isfinite(value):
            raise self.bad(column, "a finite number")
        return value

    def maybe(self, column: str) -> float | None:
        """Read a finite number, None for an empty cell."""
        return self.number(column) if self.text(column) else None


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
    engaged, time = ENGAGED[said], cells.maybe("shift_time_s")
    if time is not None and engaged is False:
        rule = "true where shift_time_s has a time, or else that cell must be empty"
        raise bad_cell(cells.path, cells.row, "engaged", "false", rule)
    if cells.text("shift_time_sd_s") and (count < 2 or time is None):
        rule = "empty where there is no mean of two shifts or more (n_shifts, shift_time_s)"
        raise cells.bad("shift_time_sd_s", rule)
    # So large is a spread where one shift took all the time and the others none.
    sd, most = cells.maybe("shift_time_sd_s"), (time or 0.0) * count**0.5
    if sd is not None and not 0.0 <= sd <= most:
        rule = f"between 0 and {most:.4g}: times above 0 of this mean cannot scatter by more"
        raise cells.bad("shift_time_sd_s", rule)
    try:
        stamp = seconds_of(cells.text("timestamp")) if cells.text("timestamp") else None
    except ValueError:
        rule = "a date and time such as 2024-05-31T14:05:09, or seconds"
        raise cells.bad("timestamp", rule) from None
    if stamp is not None and not np.isfinite(stamp):
        raise cells.bad("timestamp", "finite")
    return Row(
        cells.row, mismatch, force, rise, int(count), time, True if time is not None else engaged,
        _trace(cells, int(count)), sd, cells.maybe("order"), stamp,
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


def _set_values(rows: Sequence[Row]) -> Array:
    return np.array([(row.mismatch, row.force, row.rise) for row in rows])


def _groups(values: Array) -> Array:
    """Number the groups of rows of which each is near another one, (rows,)."""
    from scipy.sparse import coo_array  # noqa: PLC0415  # slow to load, and few tables need it
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415
    from scipy.spatial import KDTree  # noqa: PLC0415

    unique, which = np.unique(values, axis=0, return_inverse=True)
    # A share of the larger value is a distance of logarithms; signs lie far apart.
    place = np.log(np.maximum(abs(unique), 1e-9)) + 100.0 * (unique < 0.0)
    near = -np.log1p(-NEAR) * (1.0 + 1e-9)
    pairs = KDTree(place).query_pairs(near, p=np.inf, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(unique),) * 2)
    found: Array = connected_components(links, directed=False)[1][which.ravel()]
    return found


def near_points(rows: Sequence[Row]) -> dict[int, int]:
    """Map rows whose set values are nearly those of an earlier row to that row, by their places."""
    values = _set_values(rows)
    _, first, group = np.unique(_groups(values), return_index=True, return_inverse=True)
    lead = first[group.ravel()]
    apart = (values != values[lead]).any(axis=1)
    return dict(zip(np.flatnonzero(apart).tolist(), lead[apart].tolist(), strict=True))


def joined_rows(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Give rows with nearly the same set values the mean of their shifts.

    Points with nearly the same means are one point as well.
    """
    values = _set_values(rows)
    weights = np.array([row.n for row in rows], dtype=float)
    groups, before = _groups(values), 0
    while (count := int(groups.max()) + 1) != before:
        for group in range(count):
            mine = groups == group
            if (values[mine] != values[mine][0]).any():
                values[mine] = np.average(values[mine], axis=0, weights=weights[mine])
        before, groups = count, _groups(values)
    return tuple(
        replace(row, mismatch=n, force=force, rise=rise)
        for row, (n, force, rise) in zip(rows, values.tolist(), strict=True)
    )


def set_values(
    measured: Sequence[float], known: Sequence[float]
) -> tuple[Array, float, float] | None:
    """Group measured values about set values; None where they are no measured ones.

    Values are parted where gaps between neighbours jump. A group has the ``known`` set value that
    its mean agrees with, or else its mean. Round values are set values, and so are few that recur.
    Also returns the scatter, absolute and as a share.
    """
    values = np.array(measured, dtype=float)
    distinct, often = np.unique(values, return_counts=True)
    if distinct.size < 3 or all(v == float(f"{v:.2g}") or v % 5.0 == 0.0 for v in distinct):
        return None
    place = np.sign(distinct) * (20.0 + np.log(np.maximum(abs(distinct), 1e-9)))
    gaps = np.sort(np.diff(place))
    jumps = gaps[1:] / np.maximum(gaps[:-1], 1e-3)
    at = int(jumps.argmax())
    limit = (gaps[at] * gaps[at + 1]) ** 0.5 if jumps[at] >= APART else np.inf
    which = np.append(0, np.cumsum(np.diff(place) > limit))[np.searchsorted(distinct, values)]
    levels = np.array([_level(values[which == k], known) for k in range(which.max() + 1)])
    off = values - levels[which]
    least = 4 if (often > 1).mean() > 0.7 else 0
    dense = all(gap <= DENSE for gap in np.diff(place) if gap <= limit)
    few = levels.size * EACH > values.size or distinct.size < least * levels.size
    if few or not dense or not off.any() or max(abs(off / levels[which])) > SCATTER:
        return None
    freed = values.size - levels.size
    size, share = (float(np.sqrt((d**2).sum() / freed)) for d in (off, off / levels[which]))
    return levels[which], size, share


def _level(values: Array, known: Sequence[float]) -> float:
    mean, error = float(values.mean()), float(values.std() / values.size**0.5)
    near = min(known, key=lambda one: abs(one - mean), default=np.inf)
    return near if abs(near - mean) <= 0.02 * abs(mean) + 3.0 * error else float(f"{mean:.4g}")
