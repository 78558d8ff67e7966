"""The journal of shifts: one JSON line for every finished simulation.

Workers append one at a time, under a lock of the operating system's. What a kill or a full disk
left of a line is not read, and cut off before the next one is written.

A shift that the clock ended, on a machine that was too busy, is a result of this run alone: it
is in memory, not in the file, and the next run simulates it again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dogshape.sim.errors import StorageError
from dogshape.sim.files import sync_folder, write_whole
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished


class ShiftJournal:
    """Shifts by their content key: those that are finished on disk too."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()  # workers may stand in another folder
        self.rows: dict[str, Record] = {}
        self.read_new()

    def read_new(self) -> list[Record]:
        """Read what workers wrote and did not hand over; return the rows that are new."""

        def require(row: Record) -> None:
            result_of(row)
            landing_of(row)

        found = {row["key"]: row for row in read_lines(self.path, require, "a finished shift")}
        new = {key: row for key, row in found.items() if key not in self.rows}
        self.rows.update(new)
        return list(new.values())

    def add(self, rows: Iterable[Record]) -> None:
        """Take up rows that a worker has already written; from now on a power cut leaves them."""
        if self.path.exists():
            with _alone_in(self.path) as descriptor:
                os.fsync(descriptor)
                sync_folder(self.path.parent)
        self.rows.update((row["key"], row) for row in rows)

    def drop(self, keys: Collection[str]) -> None:
        """Remove shifts whose results are stored elsewhere; StorageError as ``append``.

        A kill leaves the file before or after, whole; lines of other processes stay.
        """
        with _alone_in(self.path):
            content = self.path.read_bytes()
            lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True)
            left = [line for line in lines if json.loads(line)["key"] not in keys]
            write_whole(self.path, b"".join(left))
        self.rows = {key: row for key, row in self.rows.items() if key not in keys}

    def say_unfinished(self, say: Callable[[str], None]) -> None:
        """Report the number of shifts that the clock ended, if any."""
        if ended := sum(map(unfinished, self.rows.values())):
            say(
                f"{ended} of the shifts failed at solver.time_limit_s, as on a busy machine; "
                "they are not kept"
            )


def read_lines(path: Path, require: Callable[[Record], Any], kind: str) -> Iterator[Record]:
    """Yield the whole lines of a file; StorageError for one that ``require`` raises at."""
    content = path.read_bytes() if path.exists() else b""
    for number, line in enumerate(content[: content.rfind(b"\n") + 1].splitlines(), start=1):
        try:
            row = json.loads(line)
            require(row)
        except (ValueError, KeyError, TypeError) as error:
            raise StorageError(
                f"{path}, line {number} is not {kind}; remove the line or start the study in "
                "another folder"
            ) from error
        yield row


def append(path: Path, *rows: Record) -> None:
    """Append finished shifts, all of them or none; those that the clock ended are left out.

    Raises StorageError where there is no room or no right to write.
    """
    kept = [row for row in rows if not unfinished(row)]
    lines = "".join(json.dumps(row, allow_nan=False) + "\n" for row in kept).encode()
    with _alone_in(path) as descriptor:
        end = os.fstat(descriptor).st_size
        if end and os.pread(descriptor, 1, end - 1) != b"\n":
            end = os.pread(descriptor, end, 0).rfind(b"\n") + 1
            os.ftruncate(descriptor, end)
        try:
            while lines:  # a disk that fills up takes a part first and then refuses
                lines = lines[os.write(descriptor, lines) :]
        except OSError:
            os.ftruncate(descriptor, end)
            raise


@contextmanager
def _alone_in(path: Path) -> Iterator[int]:
    """Open a file for appending and hold its lock, which ends with the process.

    Who waited while the file was exchanged (``ShiftJournal.drop``) takes the new one.
    """
    try:
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX)
                if path.exists() and os.path.samestat(os.stat(path), os.fstat(descriptor)):
                    yield descriptor
                    return
            finally:
                os.close(descriptor)
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); the shifts before are kept: make room "
            "or give the right to write, and run the command again to go on"
        ) from error
