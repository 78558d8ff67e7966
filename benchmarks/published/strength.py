"""List the published figures of docs/strength.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/strength.md"


def _steel(radius: str) -> list[float]:
    """Give pressures on edges of a radius, as simulated and on steel by design, and the limit."""
    return numbers("edge_radius", "edge pressure that one landing", "radius, mm", radius)


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "the prototype's exceed {:.0f} MPa and those of a design that an earlier search chose "
        "{:.0f} MPa, where {:.0f} MPa are allowed; with edges of 0.5 mm it is {:.0f} "
        "and {:.0f} MPa",
        lambda: [
            *(_steel("0.3")[k] for k in (1, 3, 6)),
            *(_steel("0.5")[k] for k in (1, 3)),
        ],
    ),
]
