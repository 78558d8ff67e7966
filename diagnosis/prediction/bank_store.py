"""The times of a bank's shifts as one small file, kept by the inputs of the simulation.

A journal holds every shift of a bank that is under way. The file holds the times alone, series by
series (a bench at one operating point and its angles). The key of a series has all inputs of its
first shift and the programs' versions. So another bank takes the series that it shares and
simulates the others.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, Runner
from dogshape.sim.statistics.shift_records import Record, content_key, unfinished
from dogshape.sim.versions import engine

Ticks = list[int | None]

TICK = 1e-5  #: s, in which times are kept
LATE = -1  #: stands for a shift that did not engage
FORMAT = 2


@dataclass
class BankStore:
    """Files of series, the last of which is written.

    ``paths`` are read in turn; one that does not exist is empty.
    """

    paths: Sequence[Path]

    @cached_property
    def series(self) -> dict[str, Record]:
        """All series of the files, by key; StorageError where a file is none."""
        found: dict[str, Record] = {}
        for path in self.paths:
            found.update(_read(path) if path.exists() else {})
        return found

    def missing(self, blocks: Iterable[Block]) -> list[Block]:
        """List the blocks that no file has, each series once."""
        found = {series_key(block): block for block in blocks}
        return [block for key, block in found.items() if key not in self.series]

    def times(self, blocks: Sequence[Block], run: Runner) -> list[list[Record]]:
        """Return the shifts of blocks; what no file has is simulated by ``run`` and written.

        A series that the clock cut short is simulated again the next time.
        """
        keys = [series_key(block) for block in blocks]
        left = {k: b for k, b in zip(keys, blocks, strict=True) if k not in self.series}
        fresh = dict[str, Record]()
        for key, rows in zip(left, run(list(left.values())) if left else [], strict=True):
            self.series[key] = _kept(rows)
            if not any(unfinished(row) for row in rows):
                fresh[key] = self.series[key]
        if fresh:
            path = self.paths[-1]
            self._put(path, {**(_read(path) if path.exists() else {}), **fresh})
        return [_rows(self.series[key]) for key in keys]

    def save(self, path: Path, keys: Iterable[str]) -> None:
        """Write the series of some keys to a file of their own; KeyError where one is missing."""
        self._put(path, {key: self.series[key] for key in keys})

    def _put(self, path: Path, mine: dict[str, Record]) -> None:
        lines = [
            f"{json.dumps(key)}:{json.dumps(mine[key], separators=(',', ':'))}" for key in mine
        ]
        text = f'{{"bank":{FORMAT},"series":{{\n' + ",\n".join(lines) + "\n}}\n"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, text)
        except OSError as error:
            raise StorageError(
                f"{path} cannot be written ({error.strerror}); make room or give another folder"
            ) from error


def series_key(block: Block) -> str:
    """Return the key of a block: its angles are even, so the first and their number are enough."""
    return content_key({"first": block.first_key, "n": len(block.angles), **engine()})


def _kept(rows: Sequence[Record]) -> Record:
    """Return the times of a series; None failed to integrate, ``LATE`` did not engage."""

    def ticks(row: Record, time: float | None) -> int | None:
        if row["outcome"] == Outcome.DIVERGED.value:
            return None
        return LATE if time is None else round(time / TICK)

    kept: Record = {"t": [ticks(row, row["shift_time_s"]) for row in rows]}
    there = [ticks(row, row.get("actuator_time_s", row["shift_time_s"])) for row in rows]
    return kept if there == kept["t"] else {**kept, "actuator": there}


def _rows(kept: Record) -> list[Record]:
    times: Ticks = kept["t"]
    found: list[Record] = []
    for time, there in zip(times, kept.get("actuator", times), strict=True):
        if time is None:
            found.append({"outcome": Outcome.DIVERGED.value, "shift_time_s": None})
            continue
        sleeve, actuator = (None if t in (None, LATE) else t * TICK for t in (time, there))
        outcome = Outcome.TIMED_OUT if sleeve is None else Outcome.ENGAGED
        found.append(
            {"outcome": outcome.value, "shift_time_s": sleeve, "actuator_time_s": actuator}
        )
    return found


def _read(path: Path) -> dict[str, Record]:
    broken = f"{path} is not a bank of shifts; remove it to make it again"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StorageError(f"{broken} ({type(error).__name__})") from error
    series = found.get("series") if isinstance(found, dict) else None
    if not isinstance(series, dict) or found.get("bank") != FORMAT:
        raise StorageError(broken)
    if not all(isinstance(one, dict) and isinstance(one.get("t"), list) for one in series.values()):
        raise StorageError(broken)
    return series
