"""One writer at a time, to a folder or to a file that many runs add to."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from dogshape.sim.errors import StorageError

PAUSE = 0.2  #: s between two tries to hold a folder


@contextmanager
def writing(root: Path, patience: float = 0.0) -> Iterator[None]:
    """Hold a folder for writing, made where it is missing; another writer raises StorageError.

    That it does after ``patience`` s of waiting. The lock is the operating system's and ends with
    the process, killed or not.
    """
    until = time.monotonic() + patience
    with _handle(root, ".lock") as handle:
        while not _locked(handle):
            if time.monotonic() >= until:
                raise StorageError(
                    f"{root} is in use by another run; wait for it or choose another folder"
                )
            time.sleep(PAUSE)
        yield


def _locked(handle: IO[str]) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


@contextmanager
def adding(path: Path) -> Iterator[None]:
    """Hold a file from reading to writing it; another that adds to it waits until it is done.

    For what takes a moment. A run that holds the folder (``writing``) does not hold its files.
    Raises StorageError where the folder cannot be written.
    """
    with _handle(path.parent, f".{path.name}.lock") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def _handle(root: Path, name: str) -> IO[str]:
    """Open a lock file in a folder, both made where they are missing."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        return (root / name).open("w")
    except OSError as error:
        raise StorageError(
            f"{root} cannot be written ({error.strerror}); choose another folder"
        ) from error
