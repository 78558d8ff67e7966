"""List the published figures of docs/blind.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/blind.md"

ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "ten shifts they are {:.2f} apart (root mean square)",
        lambda: numbers("blind_engines", "root mean square:")[:1],
    ),
]
