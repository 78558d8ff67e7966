"""The times of a bank's shifts as one small file, kept by the inputs of the simulation.

A series is a bench at one operating point and its angles. Its key has all inputs of its first shift
and the programs' versions, so another bank takes the series that it shares.
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
    """Files of series, read in turn where they exist; the last one is written."""

    paths: Sequence[Path]

    @cached_property
    def series(self) -> dict[str, Record]:
        """All series of the files, by key; StorageError where a file is none."""
        found: dict[str, Record] = {}
        for path in self.paths:
            found |= _read(path)
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
            _write(self.paths[-1], _read(self.paths[-1]) | fresh)
        return [_rows(self.series[key]) for key in keys]

    def save(self, path: Path, keys: Iterable[str]) -> None:
        """Write the series of some keys to a file of their own; KeyError where one is missing."""
        _write(path, {key: self.series[key] for key in keys})


def _write(path: Path, series: Record) -> None:
    lines = [f"{json.dumps(k)}:{json.dumps(s, separators=(',', ':'))}" for k, s in series.items()]
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
    for pair in zip(times, kept.get("actuator", times), strict=True):
        sleeve, actuator = (None if t in (None, LATE) else t * TICK for t in pair)
        outcome = Outcome.TIMED_OUT if sleeve is None else Outcome.ENGAGED
        outcome = Outcome.DIVERGED if pair[0] is None else outcome
        times_s = {"shift_time_s": sleeve, "actuator_time_s": actuator}
        found.append({"outcome": outcome.value, **times_s})
    return found


def _read(path: Path) -> dict[str, Record]:
    """Read the series of a file, none where it is missing; StorageError where it is no bank."""
    if not path.exists():
        return {}
    broken = f"{path} is not a bank of shifts; remove it to make it again"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if found["bank"] != FORMAT or not all(
            isinstance(s["t"], list) for s in found["series"].values()
        ):
            raise StorageError(broken)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StorageError(f"{broken} ({type(error).__name__})") from error
    return dict(found["series"])
