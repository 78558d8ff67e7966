"""Lock of a folder: one writer at a time."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dogshape.sim.errors import StorageError

RETRY_PAUSE_S = 0.2  #: between two attempts to lock a folder


@contextmanager
def lock_folder(
    root: Path, patience: float = 0.0, say: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Lock a folder for writing, and create it if missing.

    Raises StorageError if another process holds it for ``patience`` s; ``say`` receives the message
    that one waits. The lock is the operating system's and ends with the process.
    """
    deadline = time.monotonic() + patience
    try:
        root.mkdir(parents=True, exist_ok=True)
        handle = (root / ".lock").open("w")
    except OSError as error:
        raise StorageError(
            f"{root} cannot be written ({error.strerror}); choose another folder"
        ) from error
    with handle:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                if time.monotonic() >= deadline:
                    raise StorageError(
                        f"{root} is in use by another run; wait for it or choose another folder"
                    ) from None
                if say is not None:
                    say(f"waiting for another run that uses {root}")
                    say = None
            time.sleep(RETRY_PAUSE_S)
        yield
