"""List the published figures of docs/search.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers, result
from benchmarks.published.sources import OPTUNAS, OWN_LEVELS, replication, search_shifts, shares

PAGE = "docs/search.md"


def _both_levels(name: str) -> list[float]:
    """Give designs, shifts of both engines, and designs on the wrong side, of a search in two."""
    kept = result(name)
    told = kept["replication"]
    return [
        kept["n_simulated_designs"],
        len(kept["trials"]),
        search_shifts(name),
        kept["n_compiled_shifts"] - told["compiled_shifts"],
        told["shifts"],
        told["compiled_shifts"],
        kept["n_simulated_shifts"],
        told["misplaced"],
        told["misplaced_before"],
    ]


ENTRIES: list[Entry] = [
    *(
        Entry(
            PAGE,
            f"| `{name}` | {{:d}}, {{:d}} | {{:d}}, {{:d}} | {{:.1f}}, {{:.1f}} |",
            lambda name=name: replication(name),
        )  # type: ignore[misc]
        for name in ("mq200", "mq200_paper", "mq200_robust", "mq200_three")
    ),
    Entry(
        PAGE,
        "In `mq200` {:d} of {:d} designs passed their screen. The search took {:d} shifts of Drake "
        "and {:d} compiled ones, replication {:d} and {:d} more, all with confirmation {:d} of "
        "Drake. Expected wrongly on or off the front are {:.1f} designs, {:.1f} before "
        "replication.",
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
