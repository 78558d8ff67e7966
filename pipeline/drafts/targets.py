"""Folders that a draft is written into: never over what is there, and whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dogshape.sim.errors import StorageError


def require_free(folder: Path, force: bool) -> None:
    """Raise StorageError where a folder holds files and nobody said to write over them."""
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"--out is {folder}, which is a file; name a folder")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise StorageError(
            f"{folder} holds files already; name another folder with --out, or write over files "
            "of the same name with --force"
        )


@contextmanager
def drafted(folder: Path, force: bool) -> Iterator[Path]:
    """Give a folder to fill, whose files go into ``folder`` once all of them are there."""
    require_free(folder, force)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as part:
        # A temporary folder is its owner's alone, and modes are copied along.
        place = Path(part) / "draft"
        place.mkdir()
        yield place
        shutil.copytree(place, folder, dirs_exist_ok=True)
