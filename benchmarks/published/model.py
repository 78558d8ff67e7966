"""List the published figures of docs/model.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.published.sources import clutch_row

PAGE = "docs/model.md"

ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "40 designs | {:.3f} | {:.1f} ms | {:.0f} % |",
        lambda: [clutch_row("prototype")[place] for place in (0, 1, 3)],
    ),
    Entry(
        PAGE,
        "single operating point | {:.3f} | | {:.0f} % |",
        lambda: [clutch_row("prototype")[place] for place in (4, 5)],
    ),
]
