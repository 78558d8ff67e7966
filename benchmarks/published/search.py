"""List the published figures of docs/search.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers, result
from benchmarks.published.sources import OPTUNAS, OWN_LEVELS, confirmation, shares

PAGE = "docs/search.md"


def _both_levels(name: str) -> list[float]:
    """Give designs, and shifts of both engines, of a search in two levels."""
    kept = result(name)
    return [
        kept["n_simulated_designs"],
        len(kept["trials"]),
        sum(row["shifts"] for row in kept["trials"]),
        kept["n_compiled_shifts"],
        kept["n_simulated_shifts"],
    ]


ENTRIES: list[Entry] = [
    *(
        Entry(
            PAGE,
            f"| `{name}` | {{:d}} | {{:d}} | {{:d}} |",
            lambda name=name: confirmation(name),
        )  # type: ignore[misc]
        for name in ("mq200", "mq200_paper", "mq200_robust", "mq200_three")
    ),
    Entry(
        PAGE,
        "In `mq200` {:d} of {:d} designs passed their screen. The search took {:d} shifts of Drake "
        "and {:d} compiled ones, all with confirmation {:d} of Drake.",
        lambda: _both_levels("mq200"),
    ),
    *(
        Entry(
            PAGE,
            f"| {name} | {{:.2f}} ({{:.2f}} to {{:.2f}}) | {{:.2f}} ({{:.2f}} to {{:.2f}}) | "
            "{:.2f} ({:.2f} to {:.2f}) | {:.2f} ({:.2f} to {:.2f}) | {:.0f} |",
            lambda name=name: shares(name),
        )  # type: ignore[misc]
        for name in (*OPTUNAS, OWN_LEVELS, "TPE, two levels")
    ),
    Entry(
        PAGE,
        "times of Drake are {:.2f} ± {:.2f} % above those of the compiled engine, in the mean",
        lambda: numbers("samplers", "times of Drake less")[1:3],
    ),
]
