"""Tables of flights as one small file, kept by what flies.

A key has the bench at rest and with each effect at several values, so that an effect of other
physics or another prior is another table. Contact and engine are no part of a flight.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from dogshape.diagnosis.prediction.flight import flown
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine
from dogshape.sim.writers import adding


@dataclass
class FlightStore:
    """Files of tables; ``paths`` are read in turn, one that does not exist is empty.

    Tables are arrays (4, n1, n2, ...), whatever they mean.
    """

    paths: Sequence[Path] = ()
    new: dict[str, Array] = field(default_factory=dict, init=False)

    @cached_property
    def _kept(self) -> dict[str, Array]:
        """All tables of the files; StorageError where a file is none."""
        found: dict[str, Array] = {}
        for path in self.paths:
            if path.exists():
                found.update(_read(path))
        return found

    def get(self, key: str) -> Array | None:
        """Return a table, None where there is none."""
        return self.new.get(key, self._kept.get(key))

    def add(self, key: str, table: Array) -> Array:
        """Keep a table until ``save``; return it as a file will give it again."""
        self.new[key] = table.astype(np.float32).astype(float)
        return self.new[key]

    def take(self, path: Path) -> None:
        """Take over the tables of another file, if there is one."""
        self.new.update(_read(path) if path.exists() else {})

    def save(self) -> None:
        """Add the new flights to the last file, which is written as a whole or not at all.

        Runs that save to the same file do so one after the other, so that each keeps its tables.
        Raises StorageError where it cannot be read or written.
        """
        if not self.new or not self.paths:
            return
        path = self.paths[-1]
        with adding(path):
            mine, file = {**(_read(path) if path.exists() else {}), **self.new}, io.BytesIO()
            kept = {key: table.astype(np.float32) for key, table in mine.items()}
            np.savez_compressed(file, **kept)  # type: ignore[arg-type]  # keys are no options
            try:
                write_whole(path, file.getvalue())
            except OSError as error:
                raise StorageError(
                    f"{path} cannot be written ({error.strerror}); make room or give another folder"
                ) from error
        self.new.clear()


def key_of(names: Sequence[str], tried: Sequence[Setting], sizes: Sequence[int]) -> str:
    """Return the key of a table: effects, settings at which they are tried, and its size."""
    every = [content_key(flown(setting)) for setting in tried]
    return content_key({"effects": list(names), "n": list(sizes), "t": every, **engine()})


def _read(path: Path) -> dict[str, Array]:
    try:
        with np.load(path) as file:
            return {key: file[key].astype(float) for key in file.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise StorageError(
            f"{path} is not a file of flights ({type(error).__name__}); remove it to make it again"
        ) from error
