"""One writer to a folder."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dogshape.sim.errors import StorageError


@contextmanager
def writing(root: Path) -> Iterator[None]:
    """Hold a folder for writing, made where it is missing; another writer raises StorageError.

    The lock is the operating system's and ends with the process, killed or not.
    """
    try:
        root.mkdir(parents=True, exist_ok=True)
        handle = (root / ".lock").open("w")
    except OSError as error:
        raise StorageError(
            f"{root} cannot be written ({error.strerror}); choose another folder"
        ) from error
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise StorageError(
                f"{root} is in use by another run; wait for it or choose another folder"
            ) from error
        yield
