"""The journal of shifts: one JSON line for every finished simulation.

Workers append one at a time, under a lock of the operating system's, so lines do not mix. What
a kill or a full disk left of a line is cut off before the next one is written, and on opening.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from sim.errors import StorageError
from sim.records import Record, landing_of, result_of


class ShiftJournal:
    """Finished shifts by their content key, on disk and in memory.

    ``only_read`` leaves the file alone, in which another run may be writing a line.
    """

    def __init__(self, path: Path, only_read: bool = False) -> None:
        self.path = path.absolute()  # workers may stand in another folder
        self.rows: dict[str, Record] = {}
        if path.exists():
            self._read(only_read)

    def read_new(self) -> list[Record]:
        """Read what workers wrote and did not hand over; return the rows that are new."""
        known = set(self.rows)
        if self.path.exists():
            self._read()
        return [row for key, row in self.rows.items() if key not in known]

    def _read(self, only_read: bool = False) -> None:
        if not only_read:
            drop_torn_line(self.path)
        content = self.path.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        for number, line in enumerate(whole.splitlines(), start=1):
            try:
                row = json.loads(line)
                result_of(row)
                landing_of(row)
                self.rows[row["key"]] = row
            except (ValueError, KeyError, TypeError) as error:
                raise StorageError(
                    f"{self.path}, line {number} is not a finished shift; remove the line "
                    "or start the study in another folder"
                ) from error

    def add(self, rows: Iterable[Record]) -> None:
        """Take up rows that a worker has already written."""
        self.rows.update((row["key"], row) for row in rows)

    def frame(self) -> pd.DataFrame:
        """Return all finished shifts as a table."""
        return pd.DataFrame(list(self.rows.values()))


def drop_torn_line(path: Path) -> None:
    """Cut off a last line that a kill left unfinished, so that the next one starts clean."""
    content = path.read_bytes()
    if content and not content.endswith(b"\n"):
        with _alone_in(path) as descriptor:
            _drop_torn_line(descriptor)


def append(path: Path, *rows: Record) -> None:
    """Append finished shifts, all of them or none.

    Raises StorageError where there is no room or no right to write.
    """
    lines = "".join(json.dumps(row, allow_nan=False) + "\n" for row in rows).encode()
    try:
        with _alone_in(path) as descriptor:
            end = _drop_torn_line(descriptor)
            try:
                _write(descriptor, lines)
            except OSError:
                os.ftruncate(descriptor, end)
                raise
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); the shifts before are kept: make room "
            "or give the right to write, and run the command again to go on"
        ) from error


@contextmanager
def _alone_in(path: Path) -> Iterator[int]:
    """Open a file for appending and hold its lock, which ends with the process."""
    descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def _drop_torn_line(descriptor: int) -> int:
    """Cut off what follows the last whole line; return where the file then ends."""
    end = os.fstat(descriptor).st_size
    if end == 0 or os.pread(descriptor, 1, end - 1) == b"\n":
        return end
    whole = os.pread(descriptor, end, 0).rfind(b"\n") + 1
    os.ftruncate(descriptor, whole)
    return whole


def _write(descriptor: int, content: bytes) -> None:
    """Write all of it; a disk that fills up takes a part first and then refuses."""
    while content:
        content = content[os.write(descriptor, content) :]
