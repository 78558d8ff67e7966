"""Rows of a table of shifts that are there twice: each would count as shifts of its own."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from diagnosis.finding import Finding
from diagnosis.stand import Stand
from diagnosis.table import Row, Sheet

LOOKS = "a table that was copied below itself: copies make the data seem surer than they are"


def repeated_rows(_: Stand, sheet: Sheet) -> list[Finding]:
    """Return rows with a time that repeat earlier ones.

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
