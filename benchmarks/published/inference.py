"""List the published figures of docs/inference.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/inference.md"

ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "of {:.0f} sets with importance sampling: {:.2f} nat root mean square and {:.1f} at most",
        lambda: [
            numbers("common_errors", "log likelihood at the true size")[-1],
            *numbers("common_errors", "at likely offsets")[1:3],
        ],
    ),
    Entry(
        PAGE,
        "as they were taken before, miss {:.2f} and up to {:.1f}.",
        lambda: numbers("common_errors", "without an offset")[1:3],
    ),
    Entry(
        PAGE,
        "spreads are below -3 in {:.1f} % of the operating points that show late shifts, and in "
        "{:.2f} % of the others",
        lambda: [numbers("single_shifts", f"modes, {which}outliers")[-1] for which in ("", "no ")],
    ),
    Entry(
        PAGE,
        "as was taken before, in {:.1f} and {:.2f} %, and the mean log likelihood of a set at the "
        "truth is smaller by {:.1f}.",
        lambda: [
            *(numbers("single_shifts", f"one normal law, {w}outliers")[-1] for w in ("", "no ")),
            numbers("single_shifts", "modes: mean log")[-1]
            - numbers("single_shifts", "one normal law: mean log")[-1],
        ],
    ),
]
