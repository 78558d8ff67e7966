"""List the published figures of docs/commands.md."""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.kept import numbers
from benchmarks.published.sources import raced

PAGE = "docs/commands.md"
#: Rows of two workers.
TWO_WORKERS = ("processes           2", "Dask                2")


ENTRIES: list[Entry] = [
    Entry(
        PAGE,
        "two processes simulate {:.2f} times as fast as one, and two Dask workers {:.2f} times.",
        lambda: [numbers("workers", name)[1] for name in TWO_WORKERS],
    ),
    Entry(
        PAGE,
        "factor of {:.2f} in a small study with Drake, {:.2f} in one of the compiled engine, "
        "{:.2f} in a study of few designs most of which fail their screen, {:.2f} for the bank of "
        "an unknown clutch, {:.2f} in an expectation, and {:.2f} for the shifts of a surrogate",
        lambda: [
            numbers("forecasts", f"{name}:", "farthest from 1:")[0]
            for name in ("drake", "compiled", "screened", "gap", "expect", "fit")
        ],
    ),
    Entry(
        PAGE,
        "has {:.2f} of the best hypervolume known with {:d} shifts of Drake, Optuna's TPE, "
        "NSGA-II, GPSampler and quasi-random designs at most {:.2f}. With {:d} GPSampler has "
        "{:.2f}",
        raced,
    ),
]
