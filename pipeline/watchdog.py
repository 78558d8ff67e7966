"""A watch over processes that simulate: which shift hung or crashed, and no waiting for ever.

A worker marks the shift it is at in a file of its own. A shift that takes too long, or breaks
the process, ends it; the C library's side of Python then writes its last words into that file,
which also works for code that never comes back to Python. Marks without last words are of
workers that were stopped from outside and say nothing against their shift.
"""

from __future__ import annotations

import faulthandler
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MARK = ".running-"  #: with the number of the process


@contextmanager
def watched(folder: Path, key: str, limit: float) -> Iterator[None]:
    """Mark the shift ``key`` as this process's own, and end the process after ``limit`` in s."""
    path = folder / f"{MARK}{os.getpid()}"
    with path.open("w", encoding="utf-8") as file:
        file.write(f"{key}\n")
        file.flush()
        faulthandler.enable(file)
        faulthandler.dump_traceback_later(limit, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
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
        return "hung: it did not come back and its process was ended"
    return f"crashed: {words.removeprefix('Fatal Python error: ')}"
