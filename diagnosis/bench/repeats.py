"""Flaws of a table of shifts: rows twice, nearly the same points, traces that end early."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from dogshape.diagnosis.bench.finding import Finding
from dogshape.diagnosis.bench.near_points import NEAR, near_points
from dogshape.diagnosis.bench.stand_file import Stand
from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.sim.units import MS

MEASURED = (
    "measured in place of set values, each of which would be an operating point of its own, with "
    "errors of its own"
)
LOOKS = "a table that was copied below itself: copies make the data seem surer than they are"


def repeated_rows(_: Stand, sheet: Sheet) -> list[Finding]:
    """Find rows with a time that repeat earlier rows.

    Times of single shifts are rounded and may be equal by chance, so that of these half must be
    repeats; of means and of traces one is enough.
    """
    timed = [row for row in sheet.rows if row.time is not None]
    single = [row for row in timed if row.n == 1 and row.trace is None]
    means = _repeats([row for row in timed if row.n > 1])
    traced = _repeats([row for row in timed if row.trace is not None])
    singles = _repeats(single)
    found = means + traced + (singles if 2 * len(singles) >= max(4, len(single)) else [])
    if not found:
        return []
    row, first = found[0]
    many = f"{len(found)} rows repeat earlier ones" if len(found) > 1 else "a row is there twice"
    return [Finding("rows", f"{many}: row {row} is row {first} again", LOOKS, arguable=False)]


def _repeats(rows: Sequence[Row]) -> list[tuple[int, int]]:
    """Return the numbers of rows that repeat an earlier one, each with that one's."""
    first: dict[Hashable, int] = {}
    found = []
    for row in rows:
        numbers = (row.mismatch, row.force, row.rise, row.n, row.time)
        what = numbers if row.trace is None else row.trace.path
        if what in first:
            found.append((row.row, first[what]))
        first.setdefault(what, row.row)
    return found


def nearly_same_points(_: Stand, sheet: Sheet) -> list[Finding]:
    """Find rows whose set values are nearly, but not just, those of others."""
    near = near_points(sheet.rows)
    if not near:
        return []
    place, other = next(iter(sorted(near.items())))
    many = f"{len(near)} rows have" if len(near) > 1 else "a row has"
    found = (
        f"{many} nearly the set values of others: {_set_at(sheet.rows[place])} and "
        f"{_set_at(sheet.rows[other])} differ by at most {NEAR:.0%}"
    )
    return [Finding("points", found, MEASURED, "joined", certain=True)]


def _set_at(row: Row) -> str:
    return f"row {row.row} ({row.mismatch:.6g} 1/min, {row.force:.6g} N, {row.rise:.4g} s)"


def ends_early(stand: Stand, row: Row) -> bool:
    """Test that the trace of a row ends before its shift does, in time and in travel."""
    trace = row.trace
    if trace is None or row.time is None or trace.time[-1] >= row.time - 2.0 * trace.step:
        return False
    return bool(trace.displacement.max() < stand.clutch.shift_travel)


def short_traces(stand: Stand, sheet: Sheet) -> list[Finding]:
    """Find traces that end before their shift, which are used as far as they go.

    Of those that end before the first touch a part of the flight is left, by which a diagnosis
    still tells what acts so early.
    """
    short = [(row, row.trace, row.time) for row in sheet.rows if ends_early(stand, row)]
    known = [(row, trace, time) for row, trace, time in short if trace is not None and time]
    if not known:
        return []
    row, trace, time = known[0]
    least = (time - trace.time[-1]) / MS
    many = f"{len(known)} traces end" if len(known) > 1 else "a trace ends"
    found = (
        f"{many} before the shift is over: that of row {row.row} by {least:.3g} ms, so that it is "
        "used up to there"
    )
    gap = stand.clutch.dog.axial_gap
    flying = sum(one.displacement.max() < gap for _, one, _ in known)
    if flying:
        found += (
            f"; {flying} of {len(known)} end before the first touch and tell its beginning only, "
            "if they are of these shifts at all"
        )
    return [Finding("traces", found, "a recording that was stopped early", arguable=False)]
