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
]
