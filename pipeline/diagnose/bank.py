"""The bank of simulations: shift times of benches, one line of a file for each series.

A series is a bench at one operating point and its even angles. Its key has all inputs of its first
shift and the programs' versions, so a clutch takes the series that another one shares with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dogshape.pipeline.store.folder import append, read_lines, sync
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, Runner
from dogshape.sim.statistics.shift_records import Record, content_key, unfinished
from dogshape.sim.versions import engine

TICK = 1e-5  #: s, in which times are kept
LATE = -1  #: stands for a shift that did not engage


@dataclass
class Bank:
    """Files of series, read in turn where they exist; the last one is written."""

    paths: Sequence[Path]
    series: dict[str, Record] = field(default_factory=dict)
    _sizes: dict[Path, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.read()

    def read(self) -> None:
        """Read what other runs may have written; StorageError for a line that is no series."""
        for path in filter(Path.exists, self.paths):
            if (size := path.stat().st_size) != self._sizes.get(path):
                rows = read_lines(path, lambda s: (s["key"], len(s["t"])), "a series of shifts")
                self.series.update((row["key"], row) for row in rows)
                self._sizes[path] = size

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
        done = run(list(left.values())) if left else []
        fresh = {key: _kept(key, rows) for key, rows in zip(left, done, strict=True)}
        self.series |= fresh
        pairs = zip(fresh.values(), done, strict=True)
        if whole := [row for row, rows in pairs if not any(map(unfinished, rows))]:
            append(self.paths[-1], *whole)
            sync(self.paths[-1])  # before the shifts leave their journal
            self._sizes[self.paths[-1]] = self.paths[-1].stat().st_size
        return [_rows(self.series[key]) for key in keys]


def series_key(block: Block) -> str:
    """Return the key of a block: its angles are even, so the first and their number are enough."""
    return content_key({"first": block.first_key, "n": len(block.angles), **engine()})


def _kept(key: str, rows: Sequence[Record]) -> Record:
    """Return the line of a series; None failed to integrate, ``LATE`` did not engage."""

    def ticks(row: Record, time: float | None) -> int | None:
        if row["outcome"] == Outcome.DIVERGED.value:
            return None
        return LATE if time is None else round(time / TICK)

    kept: Record = {"key": key, "t": [ticks(row, row["shift_time_s"]) for row in rows]}
    there = [ticks(row, row.get("actuator_time_s", row["shift_time_s"])) for row in rows]
    return kept if there == kept["t"] else {**kept, "actuator": there}


def _rows(kept: Record) -> list[Record]:
    times: list[int | None] = kept["t"]
    found: list[Record] = []
    for pair in zip(times, kept.get("actuator", times), strict=True):
        sleeve, actuator = (None if t in (None, LATE) else t * TICK for t in pair)
        outcome = Outcome.TIMED_OUT if sleeve is None else Outcome.ENGAGED
        outcome = Outcome.DIVERGED if pair[0] is None else outcome
        times_s = {"shift_time_s": sleeve, "actuator_time_s": actuator}
        found.append({"outcome": outcome.value, **times_s})
    return found
