"""List the published figures, with what each comes from; a file for each page.

``sources`` has what several pages publish. docs/results.md has two files: designs, and the stand.
"""

from __future__ import annotations

from benchmarks.entries import Entry
from benchmarks.published import (
    blind,
    commands,
    model,
    planar,
    proof,
    readme,
    results_bench,
    results_designs,
    search,
    simulation,
    strength,
    surrogate,
)

PAGES = (
    readme,
    results_designs,
    results_bench,
    commands,
    model,
    surrogate,
    strength,
    simulation,
    blind,
    search,
    planar,
    proof,
)
ENTRIES: list[Entry] = [entry for page in PAGES for entry in page.ENTRIES]
