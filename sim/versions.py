"""The versions that a result depends on, read without loading what they are of."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib import metadata


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    names = ("dogshape", "drake", "numpy", "scipy", "scikit-learn", "optuna")
    return {"python": platform.python_version(), **{n: metadata.version(n) for n in names}}


def engine() -> dict[str, str]:
    """Return the versions of the programs that a shift depends on: others must not mix."""
    return {name: versions()[name] for name in ("dogshape", "drake")}
