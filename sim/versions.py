"""The installed package: versions that a result depends on, and the place of its studies."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib import metadata
from pathlib import Path

#: Version of the simulated physics, a part of the key of each shift. It is raised with a change
#: that moves shift times, not with the package: simulations that a user has kept stay valid.
PHYSICS_VERSION = "0.1.0"


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    names = ("dogshape", "drake", "numpy", "scipy", "scikit-learn", "optuna")
    return {"python": platform.python_version(), **{n: metadata.version(n) for n in names}}


def engine_versions() -> dict[str, str]:
    """Return the versions that a simulated shift depends on; shifts of others must not mix."""
    return {"dogshape": PHYSICS_VERSION, "drake": versions()["drake"]}


def program_versions() -> dict[str, str]:
    """Return the versions of Dogshape and Drake that are installed."""
    return {name: versions()[name] for name in ("dogshape", "drake")}


def bundled_root() -> Path:
    """Return the folder ``studies``: beside ``sim`` in a checkout and in the installed package."""
    root = Path(__file__).resolve().parents[1] / "studies"
    if not root.is_dir():
        raise FileNotFoundError("the package was installed without its studies")
    return root


def clone_remedy(study: str) -> str:
    """Name the place of the kept result of a bundled study; empty in a clone.

    A wheel has studies, bench data and surrogates alone.
    """
    root = bundled_root()
    if any(root.glob("*/result.json")) or not (root / study / "study.toml").is_file():
        return ""
    return f"; a clone of the repository has the kept result, in its folder studies/{study}"
