"""Where the studies and bench data that the package brings lie on disk."""

from __future__ import annotations

from pathlib import Path


def bundled_root() -> Path:
    """Return the folder ``studies``: beside ``sim`` in a checkout and in the installed package."""
    root = Path(__file__).resolve().parents[1] / "studies"
    if not root.is_dir():
        raise FileNotFoundError("the package was installed without its studies")
    return root
