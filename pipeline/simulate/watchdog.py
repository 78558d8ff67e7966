"""A watch over processes that simulate: no shift hangs for ever, no worker outlives its parent.

A worker marks the shift it is at in a file of its own. A shift that takes too long, or breaks
the process, ends it; the C library's side of Python then writes its last words into that file,
which also works for code that never comes back to Python. Marks without last words are of
workers that were stopped from outside and say nothing against their shift.
"""

from __future__ import annotations

import faulthandler
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TextIO

from dogshape.sim.shift.outcome import HUNG

MARK = ".running-"  #: with the number of the process
LOOK = 1.0  #: s between looks whether the parent, or a cluster's worker, is alive


@cache
def end_with_parent() -> None:
    """End this process soon after its parent, of which nothing else tells it if it was killed.

    A process whose parent is gone has another one. The thread is started once in a process.
    """
    parent = os.getppid()

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK)
        os._exit(1)

    threading.Thread(target=look, name="parent", daemon=True).start()


@contextmanager
def ended_after(limit: float, file: TextIO | None = None) -> Iterator[None]:
    """End the process after ``limit`` in s, with its last words in a file, else on stderr."""
    faulthandler.dump_traceback_later(limit, exit=True, file=file or sys.__stderr__ or 2)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def watched(folder: Path, key: str, limit: float) -> Iterator[None]:
    """Mark the shift ``key`` as this process's own, and end the process after ``limit`` in s."""
    path = folder / f"{MARK}{os.getpid()}"
    with path.open("w", encoding="utf-8") as file:
        file.write(f"{key}\n")
        file.flush()
        faulthandler.enable(file)
        try:
            with ended_after(limit, file):
                yield
        finally:
            faulthandler.enable(sys.__stderr__ or 2)
    path.unlink(missing_ok=True)


def broken(folder: Path) -> dict[str, str]:
    """Return why shifts ended the processes they ran in, by their keys; remove all marks."""
    found = {}
    for path in sorted(folder.glob(f"{MARK}*")):
        key, *words = path.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
        path.unlink(missing_ok=True)
        if words:
            found[key] = _reason(words[0])
    return found


def _reason(words: str) -> str:
    if words.startswith("Timeout"):
        return f"{HUNG}: it did not come back and its process was ended"
    return f"crashed: {words.removeprefix('Fatal Python error: ')}"
