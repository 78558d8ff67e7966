"""List the published figures of docs/diagnosis.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers

PAGE = "docs/diagnosis.md"

ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "operating points {:.0f} shifts in {:.0f} s of processor time, and the flights in "
        "{:.0f} s.",
        lambda: [
            numbers("unseen_clutch", "7 operating points,")[0],
            numbers("unseen_clutch", "shifts")[1],
            numbers("unseen_clutch", "flights")[1],
        ],
    ),
    Entry(
        PAGE,
        "it lasted {:.0f} s instead of {:.0f};",
        lambda: numbers("unseen_clutch", "shifts")[:2],
    ),
    Entry(
        PAGE,
        "the mean of {:.2f} ms differs by {:.3f} ± {:.3f} ms, with",
        lambda: numbers("bank_engines", f"{'linkage_compliance':<21}35")[:3],
    ),
    Entry(
        PAGE,
        "of play by {:.3f} ± {:.3f} ms,",
        lambda: numbers("bank_engines", f"{'free_play':<21}2 ")[1:3],
    ),
    Entry(
        PAGE,
        "without any effect by {:.3f} ± {:.3f} ms.",
        lambda: numbers("bank_engines", "none")[1:3],
    ),
    Entry(
        PAGE,
        "by {:.3f} ± {:.3f} ms of {:.2f}.",
        lambda: [numbers("bank_engines", "drag_torque          8")[k] for k in (1, 2, 0)],
    ),
]
