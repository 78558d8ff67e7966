"""Lock of a folder: one writer at a time."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dogshape.pipeline.store.folder import create_folder, unwritable_folder
from dogshape.sim.errors import StorageError


@contextmanager
def lock_folder(root: Path) -> Iterator[None]:
    """Lock a folder for writing, and create it if missing; StorageError if another run holds it.

    The lock is the operating system's and ends with the process.
    """
    create_folder(root)
    try:
        handle = (root / ".lock").open("w")
    except OSError as error:
        raise unwritable_folder(root, error) from error
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StorageError(
                f"{root} is in use by another run; wait for it or choose another folder"
            ) from None
        yield
