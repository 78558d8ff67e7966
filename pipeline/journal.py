"""The journal of shifts: one JSON line for every finished simulation.

Workers append with one write each, so lines of several processes do not mix
and a kill costs at most the line being written. Opening cuts off a torn last line.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
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
        """Take up rows that a worker has already written."""
        self.rows.update((row["key"], row) for row in rows)

    def frame(self) -> pd.DataFrame:
        """Return all finished shifts as a table."""
        return pd.DataFrame(list(self.rows.values()))


def drop_torn_line(path: Path) -> None:
    """Cut off a last line that a kill left unfinished, so that the next one starts clean."""
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        os.truncate(path, whole)


def append(path: Path, row: Record) -> None:
    """Append one finished shift as a single write."""
    line = json.dumps(row, allow_nan=False) + "\n"
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(descriptor, line.encode())
    finally:
        os.close(descriptor)
