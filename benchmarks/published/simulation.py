"""List the published figures of docs/simulation.md."""

from __future__ import annotations

from functools import partial

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/simulation.md"


def _rounded(radius: str) -> list[float]:
    """Give times and errors of three designs whose edges have a radius in mm, ms."""
    row = numbers("edge_radius", "expected shift time", "radius, mm", f"{float(radius):.1f}")
    return [row[k] for k in (0, 1, 4, 5, 8, 9)]


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "an edge of 0.3 mm bears {:.0f} N/mm where",
        lambda: numbers("edge_radius", "edge on edge", "0.3")[2:3],
    ),
    *(
        Entry(
            PAGE,
            f"| {radius} |" + 3 * " {:.1f} ± {:.1f} ms |",
            partial(_rounded, radius),
        )
        for radius in ("0", "0.1", "0.2", "0.3")
    ),
]
