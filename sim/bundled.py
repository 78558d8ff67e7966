"""Where the studies and bench data that the package brings lie on disk."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path


def bundled_root() -> Path:
    """Return the folder ``studies``; it holds data only and so is no regular package."""
    spec = find_spec("studies")
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError("the package was installed without its studies")
    places = [Path(place) for place in spec.submodule_search_locations]
    return next((p for p in places if (p / "bench").is_dir()), places[0])
