"""Checks of new readings against those that a diagnosis has: same points, and no copies."""

from __future__ import annotations

from difflib import SequenceMatcher

from dogshape.diagnosis.bench.clock import found_step, rows_off
from dogshape.diagnosis.bench.near_points import NEAR, near_points
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.sim.errors import DataError, number
from dogshape.sim.units import MS

NEAR_RISE = 0.05  #: share by which rise times of one mismatch and force differ by rounding alone
COPIED = 8  #: rows in a row that are there already, from which on they are copies
DIFFERENT = 5  #: of these that differ from each other: a stand may give few values again and again


def require_same_rises(held: Sheet, new: Sheet) -> None:
    """Raise DataError for a rise time that is nearly that of the same mismatch and force."""
    for row in new.rows:
        for other in held.rows:
            near = abs(row.rise / other.rise - 1.0) < NEAR_RISE and row.rise != other.rise
            if near and abs(row.force - other.force) < 1e-6 * other.force:
                raise DataError(
                    f"{new.path}, row {row.row}, column force_rise_s is {number(row.rise)} s, but "
                    f"the bench has {number(other.rise)} s at {number(other.force)} N, and another "
                    "rise time is another operating point; write the same, or one that differs by "
                    f"more than {NEAR_RISE:.0%}"
                )


def require_same_points(held: Sheet, new: Sheet) -> None:
    """Raise DataError for set values that are nearly, but not just, those that the bench has."""
    rows = (*held.rows, *new.rows)
    for place, other in sorted(near_points(rows).items()):
        one = max(place, other) - len(held.rows)
        if one >= 0:
            row, like = new.rows[one], rows[min(place, other)]
            raise DataError(
                f"{new.path}, row {row.row} has {number(row.mismatch)} 1/min and "
                f"{number(row.force)} N, but there are {number(like.mismatch)} 1/min and "
                f"{number(like.force)} N already, and other set values are another operating "
                f"point; write the same, or ones that differ by more than {NEAR:.0%}"
            )


def require_one_clock(held: Sheet, new: Sheet) -> None:
    """Raise DataError for times in the steps of a clock beside others that are finer."""
    step = found_step(held) or found_step(new)
    for one in (held, new):
        if off := rows_off(one, step):
            raise DataError(
                f"{one.path}, row {off[0].row} has {number(off[0].time or 0.0)} s, but all single "
                f"times of {(new if one is held else held).path} are multiples of "
                f"{number(step / MS)} ms, and a data set has one clock; diagnose them apart, or "
                "state errors.clock_step_ms = 0 in bench.toml and diagnose again"
            )


def require_no_copies(held: Sheet, new: Sheet) -> None:
    """Raise DataError where new rows are rows that the bench has, one after the other.

    Times are rounded, so that single ones may agree by chance. Time stamps tell, where all have
    one; the order counts from the first shift of each table and tells nothing.
    """
    stamped = all(row.timestamp is not None for one in (held, new) for row in one.rows)
    ours, theirs = ([_what(row, stamped) for row in one.rows] for one in (held, new))
    found = SequenceMatcher(None, ours, theirs, autojunk=False).find_longest_match()
    same = theirs[found.b : found.b + found.size]
    # A mean that is not measured yet is no copy of one that was not.
    means = [k for k, row in enumerate(new.rows) if row.n > 1 and row.time and theirs[k] in ours]
    if found.size >= COPIED and len(set(same)) >= DIFFERENT:
        first, last = new.rows[found.b].row, new.rows[found.b + found.size - 1].row
        which, like = f"rows {first} to {last} repeat", held.rows[found.a].row
    elif means:
        which = f"row {new.rows[means[0]].row} repeats"
        like = held.rows[ours.index(theirs[means[0]])].row
    else:
        return
    raise DataError(
        f"{new.path}: {which} rows of the bench from row {like} of its table on, and copies would "
        "count as shifts of their own; leave them out (where bench and table have a timestamp in "
        "each row, others that took the same times are told by it)"
    )


def _what(row: Row, stamped: bool) -> tuple[float | None, ...]:
    numbers = row.mismatch, row.force, row.rise, float(row.n), row.time, row.sd
    return (*numbers, row.timestamp if stamped else None)
