"""Matrices of a process kept on disk: asking starts in a blink, and not with a root of all rows.

The root and the inverse of the covariance of 2500 rows cost a third of a second and a second. Both
follow from the surrogate's file. So they are kept in a folder of the user, by the file's hash, and
mapped into memory when they are asked for again. Whatever is found there must do what only the
right matrix does: turn the weights of the process into its targets. Anything else is worked out
anew, and everything works where no folder can be written.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dogshape.surrogate.covariance import Array

PLACE = "DOGSHAPE_CACHE"  #: variable that names the folder; empty or "off" for none
KEPT = 8  #: files, those used last: 400 MB with 2500 rows
LEAST = 1000  #: rows; with fewer a matrix is there as fast as its file


def cache_folder() -> Path | None:
    """Find the user's folder of kept files: DOGSHAPE_CACHE, else where caches of the user lie.

    None where the variable is empty or ``off``, or the user has no home.
    """
    named = os.environ.get(PLACE)
    if named is not None:
        return None if named in ("", "off") else Path(named)
    usual = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(usual) if usual else Path.home() / ".cache") / "dogshape"
    except RuntimeError:  # nobody's home
        return None


@dataclass(frozen=True)
class KeptMatrices:
    """Square matrices of one process, by the hash of its surrogate's file.

    Parameters
    ----------
    folder : where they are kept.
    key : of the surrogate and the process.
    """

    folder: Path
    key: str

    def get(
        self, name: str, size: int, compute: Callable[[], Array], right: Callable[[Array], bool]
    ) -> Array:
        """Return a matrix (size, size): the kept one if it is ``right``, else computed and kept."""
        if size < LEAST:
            return compute()
        path = self.folder / f"{self.key}-{name}.npy"
        found = _mapped(path, size)
        if found is not None and right(found):
            return found
        made = compute()
        self._keep(path, made)
        return made

    def _keep(self, path: Path, matrix: Array) -> None:
        """Write a matrix under its whole name at once; leave it where that cannot be."""
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            try:
                with part.open("wb") as file:
                    np.save(file, matrix, allow_pickle=False)
                os.replace(part, path)
            finally:
                part.unlink(missing_ok=True)
            kept = sorted(self.folder.glob("*.npy"), key=lambda one: -one.stat().st_mtime)
            for old in kept[KEPT:]:
                old.unlink(missing_ok=True)
        except OSError:
            return


def _mapped(path: Path, size: int) -> Array | None:
    """Map a kept matrix into memory; None where there is none of that size."""
    try:
        found = np.load(path, mmap_mode="r", allow_pickle=False)
        os.utime(path)  # used now: others go before it
    except (OSError, ValueError, EOFError):
        return None
    if found.shape != (size, size) or found.dtype != np.float64:
        return None
    return np.asarray(found)
