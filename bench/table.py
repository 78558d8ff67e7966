"""``shifts.csv`` as numbers in the units of its columns, before anything is made of them.

A slip of units can make a number impossible as a force or a time. So rows stay plain until they are
examined (``diagnosis.bench.slips``) and corrected (``diagnosis.bench.corrections``).

Errors of an operating point are common to its shifts (the model, the emulator, an odd entry), so
shifts that measured set values spread over many nearly equal points would count as so many
independent ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dogshape.bench.raw_sheet import file_of
from dogshape.bench.texts import TextTable, is_plain, read_table
from dogshape.bench.traces import BenchTrace, bad_cell, read_trace
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError, number_rule
from dogshape.sim.shift.actuators import COMMAND_RISE_S, SECTION, SET_KEYS, Actuator, kinds_with

Texts = NDArray[np.str_]


class SheetCells(NamedTuple):
    """Cells of ``shifts.csv`` by column, text, each (rows,)."""

    mismatch_rpm: Texts
    force_N: Texts
    force_rise_s: Texts
    n_shifts: Texts
    shift_time_s: Texts
    engaged: Texts
    trace: Texts
    shift_time_sd_s: Texts
    order: Texts
    timestamp: Texts
    supply_bar: Texts
    voltage_V: Texts
    current_A: Texts

    def column(self, name: str) -> Texts:
        """Return the cells of a column by its name."""
        column: Texts = getattr(self, name)
        return column


COLUMNS = SheetCells._fields
FORCE = "force_N"
RISE = "force_rise_s"
NEEDED = COLUMNS[:5]  #: without the others, a source says nothing of them
#: The same of a stand with an actuator, beside the column that sets its force.
NEEDED_OF_ACTUATOR = tuple(name for name in NEEDED if name not in (FORCE, RISE))
NUMERIC = (*NEEDED, *COLUMNS[7:])
NUMBERS = tuple(name for name in NUMERIC if name != "timestamp")  #: without dates
MAX_SHIFTS = 1_000_000  #: shifts that a row may stand for; at one a second they take twelve days
ENGAGED = {"true": True, "false": False, "": None}
NEAR = 0.01  #: of a set value, up to which two are those of one operating point


@dataclass(frozen=True)
class Row:
    """Row of ``shifts.csv`` in its units: 1/min, N, s.

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
    """The rows of ``shifts.csv`` with their traces; ``set_key`` is the column of the force."""

    path: Path
    rows: tuple[Row, ...]
    set_key: str = FORCE


def load_sheet(path: Path, actuator: Actuator | None = None) -> Sheet:
    """Read the table and its traces; a mistake raises DataError with file, row and column.

    ``actuator`` of the stand makes the force of a set value, and of logged channels of traces.
    """
    if not file_of(path).exists():
        raise DataError(f"there is no {path}; a data set needs shifts.csv")
    table = read_table(path, NUMERIC, COLUMNS)
    set_key = _set_key(table, actuator)
    needed = NEEDED if actuator is None else (*NEEDED_OF_ACTUATOR, set_key)
    table.require(needed, COLUMNS)
    if not table.rows:
        raise DataError(f"{path} has no rows; a data set needs at least one shift")
    rows, nothing = [row for row, _ in table.rows], [""] * len(table.rows)
    columns = (table.column(name) if name in table.head else nothing for name in COLUMNS)
    cells = SheetCells(*map(np.array, columns))
    cells = cells._replace(engaged=np.char.lower(cells.engaged))
    values = {
        name: np.array([float(c) if is_plain(c) else np.nan for c in cells.column(name)])
        for name in NUMERIC
    }
    values |= {"timestamp": np.array([_seconds(cell) for cell in cells.timestamp])}
    for column, bad, rule in _faults(cells, values, set_key, actuator):
        if (wrong := np.asarray(bad, dtype=bool)).any():
            at = int(wrong.argmax())
            raise bad_cell(path, rows[at], f"column {column}", cells.column(column)[at], rule)
    sheet_rows = []
    for k, row in enumerate(rows):
        numbers: dict[str, Any] = {
            name: None if np.isnan(column[k]) else column[k].item()
            for name, column in values.items()
        }
        time = numbers["shift_time_s"]
        order = numbers["order"]
        stamp = numbers["timestamp"]
        sheet_rows.append(
            Row(
                row,
                numbers["mismatch_rpm"],
                _force_of(path, row, set_key, numbers[set_key], actuator),
                numbers[RISE] if actuator is None else COMMAND_RISE_S,
                int(numbers["n_shifts"]),
                time,
                True if time is not None else ENGAGED[cells.engaged[k]],
                _trace_of(path, row, cells.trace[k], actuator),
                numbers["shift_time_sd_s"],
                stamp if order is None else order,
                stamp,
            )
        )
    return Sheet(path, tuple(sheet_rows), set_key)


def _set_key(table: TextTable, actuator: Actuator | None) -> str:
    """Choose the column that sets the force; DataError for several, or without such an actuator."""
    path = table.path
    columns = [name for name in (*SET_KEYS, FORCE) if name in table.head]
    set_keys = [name for name in columns if any(table.column(name))]
    if not set_keys and actuator is not None:
        set_keys = columns[:1]
    if len(set_keys) > 1:
        raise DataError(
            f"{path} has the columns {' and '.join(set_keys)}, but one sets the force; leave out "
            "the others"
        )
    set_key = set_keys[0] if set_keys else FORCE
    if set_key == FORCE or (actuator is not None and set_key in actuator.set_keys):
        return set_key
    stand = "has no actuator"
    if actuator is not None:
        valid_keys = " or ".join((*actuator.set_keys, FORCE))
        stand = f"has a {actuator.kind} actuator, which {valid_keys} sets"
    raise DataError(
        f"{path} has the column {set_key}, but the stand {stand}; state in [{SECTION}] of "
        f"bench.toml the actuator (kind = {kinds_with(set_key)}), or give {FORCE}"
    )


def _force_of(path: Path, row: int, set_key: str, value: float, actuator: Actuator | None) -> float:
    """Compute the static force of a set value, N; DataError for one that the actuator lacks."""
    if actuator is None or set_key == FORCE:
        return value
    try:
        return actuator.set_force(set_key, value)
    except InputError as error:
        raise DataError(f"{path}, row {row}: {error}") from error


def _trace_of(path: Path, row: int, name: str, actuator: Actuator | None) -> BenchTrace | None:
    """Read the trace that a row names; None without a name."""
    if not name:
        return None
    try:
        return read_trace(path.parent / name, actuator)
    except DataError as error:
        raise DataError(f"{path}, row {row}, column trace: {error}") from error


def _faults(
    cells: SheetCells, values: Mapping[str, Array], set_key: str, actuator: Actuator | None
) -> Iterator[tuple[str, Any, str]]:
    """Yield columns, marks of their wrong cells, and the rule that these break."""
    filled_names = ["mismatch_rpm", set_key]
    if actuator is None:
        filled_names.append(RISE)
    else:
        rule = f"empty, as the {actuator.kind} actuator of the stand has no rise time"
        yield RISE, cells.column(RISE) != "", rule
    for name in NUMBERS:
        column = cells.column(name)
        is_filled = (column != "") | (name in filled_names)
        bad = is_filled & ~np.isfinite(values[name]) & (name != "n_shifts")
        first = column[int(bad.argmax())]
        yield name, bad, "a finite number" if is_plain(first) else number_rule(first)
    time, sd, stamps = (values[name] for name in ("shift_time_s", "shift_time_sd_s", "timestamp"))
    count = np.clip(np.nan_to_num(values["n_shifts"]), 0.0, 1e300)
    outcomes = cells.engaged
    trace_names = cells.trace
    stamp_cells = cells.timestamp
    timed, spread, traced = ~np.isnan(time), ~np.isnan(sd), trace_names != ""
    plain, stamped = np.array(list(map(is_plain, stamp_cells))), stamp_cells != ""
    is_outside = [Path(c).is_absolute() or ".." in Path(c).parts for c in trace_names]
    # So large is a spread where one shift took all the time and the others none.
    is_wide = spread & ~((sd >= 0.0) & (sd <= time * count**0.5))
    yield from (
        (
            "n_shifts",
            ~((count >= 1) & (count % 1 == 0)),
            "a whole number of at least 1, the shifts "
            "that its time is the mean of: 1 for a single shift",
        ),
        (
            "n_shifts",
            count > MAX_SHIFTS,
            f"at most {MAX_SHIFTS}: shifts that a stand has made, not a count of samples",
        ),
        ("engaged", ~np.isin(outcomes, [*ENGAGED]), "true, false or empty"),
        (
            "engaged",
            timed & (outcomes == "false"),
            "true where shift_time_s has a time, or else that cell must be empty",
        ),
        (
            "shift_time_sd_s",
            spread & ((count < 2) | ~timed),
            "empty where there is no mean of two shifts or more (n_shifts, shift_time_s)",
        ),
        (
            "shift_time_sd_s",
            is_wide,
            "between 0 and the mean times the root of n_shifts: times "
            "above 0 of this mean cannot scatter by more",
        ),
        (
            "timestamp",
            stamped & ~np.isfinite(stamps),
            "a date and time such as 2024-05-31T14:05:09, or seconds",
        ),
        ("timestamp", plain & (stamped & ~plain).any(), "a date and time as in the other rows"),
        ("trace", traced & (count != 1), "empty where n_shifts is not 1: it is one shift's"),
        ("trace", is_outside, "a path inside the folder of the data set"),
    )
    for name in ("order", "timestamp"):
        empty = timed & (cells.column(name) == "")
        rule = "filled, as other rows with a time have one; fill it everywhere or nowhere"
        yield name, empty & (empty.sum() < timed.sum()), rule


def _seconds(text: str) -> float:
    """Read a time stamp in s: ISO 8601 (UTC without a zone), or seconds; NaN for others."""
    if is_plain(text):
        return float(text)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return np.nan
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def near_groups(rows: Sequence[Row]) -> tuple[Array, np.ndarray]:
    """Number the groups of rows whose set values are nearly equal.

    Returns mismatch, rad/s, force, N, and rise time, s, of each row, (rows, 3), and the number of
    its group from 0, (rows,).
    """
    values = np.array([(row.mismatch, row.force, row.rise) for row in rows])
    labels = np.empty(values.shape)
    for place, column in enumerate(values.T):
        levels, which = np.unique(column, return_inverse=True)
        is_separate = np.diff(levels) > NEAR * np.maximum(abs(levels[1:]), abs(levels[:-1]))
        labels[:, place] = np.append(0, np.cumsum(is_separate))[which.ravel()]
    return values, np.unique(labels, axis=0, return_inverse=True)[1].ravel()


def joined_rows(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Set nearly equal set values of rows to their mean."""
    weights = np.array([row.n for row in rows], dtype=float)
    values, groups = near_groups(rows)
    for group in range(groups.max() + 1):
        members = groups == group
        if (values[members] != values[members][0]).any():
            values[members] = np.average(values[members], axis=0, weights=weights[members])
    return tuple(
        replace(row, mismatch=n, force=force, rise=rise)
        for row, (n, force, rise) in zip(rows, values.tolist(), strict=True)
    )
