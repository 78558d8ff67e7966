"""List the published figures of docs/model.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import surrogate
from benchmarks.published.sources import MS, PERCENT

PAGE = "docs/model.md"

ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "40 designs | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2"],
            MS * surrogate()["validation"]["rmse_s"],
            PERCENT * surrogate()["validation"]["coverage_95"],
        ],
    ),
    Entry(
        PAGE,
        "single operating point | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [
            surrogate()["validation"]["q2_points"],
            MS * surrogate()["validation"]["rmse_points_s"],
            PERCENT * surrogate()["validation"]["coverage_points"],
        ],
    ),
]
