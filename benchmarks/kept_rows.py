"""Rows of long work, kept in a file as they are finished, from which a stopped run goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

Key = tuple[Any, ...]  #: numbers and names


def kept_rows(
    path: Path, keys: Iterable[Key], work: Callable[..., Any], jobs: int
) -> dict[Key, Any]:
    """Work out the row of each key that the file lacks, and give the rows of all keys in order.

    Parameters
    ----------
    work : gives the row of a key's parts as JSON; picklable where ``jobs`` is above one.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    known = {tuple(key): row for key, row in map(json.loads, lines)}
    every = list(keys)
    left = [key for key in every if key not in known]
    pool = Parallel(n_jobs=jobs, return_as="generator_unordered")
    with path.open("a", encoding="utf-8") as file:
        for key, row in pool(delayed(_row)(work, key) for key in left):
            known[key] = row
            file.write(json.dumps([key, row]) + "\n")
            file.flush()
    return {key: known[key] for key in every}


def _row(work: Callable[..., Any], key: Key) -> tuple[Key, Any]:
    return key, work(*key)
