"""The journal of shifts: one JSON line for every finished simulation.

Workers append one at a time, under a lock of the operating system's, so lines do not mix. What
a kill or a full disk left of a line is cut off before the next one is written, and on opening.
The parent forces lines to the disk before it counts their shifts as finished. Lines go only where
their shifts are kept elsewhere by then (``ShiftJournal.drop``).

A shift that the clock ended, on a machine that was too busy, is a result of this run alone: it
is in memory, not in the file, and the next run simulates it again.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dogshape.sim.errors import StorageError
from dogshape.sim.files import sync_folder, write_whole
from dogshape.sim.statistics.shift_records import Record, landing_of, result_of, unfinished

KEY = re.compile(rb'\{"key": "(\w+)"')  #: begin of a line


class ShiftJournal:
    """Shifts by their content key: those that are finished on disk too.

    ``only_read`` leaves the file alone, in which another run may be writing a line.
    """

    def __init__(self, path: Path, only_read: bool = False) -> None:
        self.path = path.absolute()  # workers may stand in another folder
        self.rows: dict[str, Record] = {}
        self.read_new(only_read)

    def read_new(self, only_read: bool = False) -> list[Record]:
        """Read what workers wrote and did not hand over; return the rows that are new."""
        known = set(self.rows)
        if self.path.exists():
            self._read(only_read)
        return [row for key, row in self.rows.items() if key not in known]

    def _read(self, only_read: bool) -> None:
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
        """Take up rows that a worker has already written; from now on a power cut leaves them.

        Raises StorageError where the disk does not take them.
        """
        if self.path.exists():
            with _writing(self.path):
                with self.path.open("rb+") as file:
                    os.fsync(file.fileno())
                sync_folder(self.path.parent)
        self.rows.update((row["key"], row) for row in rows)

    def drop(self, keys: Collection[str]) -> None:
        """Remove shifts that are kept elsewhere; a kill leaves the file before or after, whole.

        What another process appends meanwhile stays. Raises OSError where the disk refuses.
        """
        with _alone_in(self.path):
            with self.path.open("rb") as file:
                found = [(line, KEY.match(line)) for line in file]
            left = [line for line, key in found if key is None or key[1].decode() not in keys]
            write_whole(self.path, b"".join(left))
        self.rows = {key: row for key, row in self.rows.items() if key not in keys}

    @property
    def finished(self) -> list[str]:
        """Keys of the shifts that are finished, without those that the clock ended."""
        return [key for key, row in self.rows.items() if not unfinished(row)]

    def say_unfinished(self, say: Callable[[str], None]) -> None:
        """Report the number of shifts that the clock ended, if any."""
        if ended := len(self.rows) - len(self.finished):
            say(
                f"{ended} of the shifts failed at solver.time_limit_s, as on a busy machine; "
                "they are not kept, and the same command simulates them again"
            )


def drop_torn_line(path: Path) -> None:
    """Cut off a last line that a kill left unfinished, so that the next one starts clean."""
    content = path.read_bytes()
    if content and not content.endswith(b"\n"):
        with _alone_in(path) as descriptor:
            _drop_torn_line(descriptor)


def append(path: Path, *rows: Record) -> None:
    """Append finished shifts, all of them or none; those that the clock ended are left out.

    Raises StorageError where there is no room or no right to write.
    """
    kept = [row for row in rows if not unfinished(row)]
    lines = "".join(json.dumps(row, allow_nan=False) + "\n" for row in kept).encode()
    with _writing(path), _alone_in(path) as descriptor:
        end = _drop_torn_line(descriptor)
        try:
            while lines:  # a disk that fills up takes a part first and then refuses
                lines = lines[os.write(descriptor, lines) :]
        except OSError:
            os.ftruncate(descriptor, end)
            raise


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn what a disk refuses into one sentence."""
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"{path} cannot be written ({error.strerror}); the shifts before are kept: make room "
            "or give the right to write, and run the command again to go on"
        ) from error


@contextmanager
def _alone_in(path: Path) -> Iterator[int]:
    """Open a file for appending and hold its lock, which ends with the process.

    Who waited while the file was exchanged (``ShiftJournal.drop``) takes the new one.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            if path.exists() and os.path.samestat(os.stat(path), os.fstat(descriptor)):
                yield descriptor
                return
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
