"""Folders to begin with: a study or a bench of one's own (``dogshape init``)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dogshape.pipeline.drafts.bench_folder import BenchDraft, guessed, write_bench
from dogshape.pipeline.drafts.sources import require_free, source_of
from dogshape.pipeline.drafts.study_folder import (
    CLUTCH,
    HEIGHT,
    USE,
    askable,
    searched_keys,
    use_of,
    write_study,
)

__all__ = [
    "CLUTCH",
    "HEIGHT",
    "USE",
    "BenchDraft",
    "askable",
    "default_use",
    "default_values",
    "guessed",
    "require_free",
    "searched_keys",
    "write_bench",
    "write_study",
]


def default_values(origin: str) -> dict[str, Any]:
    """Give the values of the clutch that a draft would begin with, by dotted key.

    Raises InputError where ``origin`` is neither a study nor a bench.
    """
    return source_of(origin).dog_values


def default_use(origin: str, values: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Give the values of ``USE`` that a draft with ``values`` would begin with, by dotted key.

    Those that its file says otherwise, as by a distribution, are left out. Raises InputError as
    ``default_values`` does.
    """
    return use_of(origin, values or {})
