"""The bank of simulations: shift times of benches, one line of a file for each series.

A series is a bench at one operating point and its even angles. Its key has all inputs of its first
shift and the programs' versions, so a clutch takes the series that another one shares with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dogshape.pipeline.store.folder import append, read_lines, sync
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, Runner
from dogshape.sim.statistics.shift_records import (
    Record,
    content_key,
    diverged,
    key_of,
    result_of,
    unfinished,
)
from dogshape.sim.versions import engine_versions

TICK = 1e-5  #: resolution of stored times, s
NOT_ENGAGED = -1  #: ticks of a shift that did not engage


@dataclass
class Bank:
    """Stored series of shifts by key, from files in turn; new series go to the last file."""

    paths: Sequence[Path]
    series: dict[str, Record] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Read the files; StorageError for a line that is no series."""
        for path in self.paths:
            rows = read_lines(path, _require_series, "a series of shifts")
            self.series.update((key_of(row), row) for row in rows)

    def times(self, blocks: Sequence[Block], run: Runner) -> list[list[Record]]:
        """Return the shifts of blocks; simulate missing series by ``run`` and write them.

        A series that the clock cut short is simulated again the next time.
        """
        keys = [series_key(block) for block in blocks]
        missing = {
            key: block for key, block in zip(keys, blocks, strict=True) if key not in self.series
        }
        simulated = run(list(missing.values())) if missing else []
        finished_series = []
        for key, rows in zip(missing, simulated, strict=True):
            series = _series_record(key, rows)
            self.series[key] = series
            if not any(map(unfinished, rows)):
                finished_series.append(series)
        if finished_series:
            path = self.paths[-1]
            append(path, *finished_series)
            sync(path)  # before the shifts leave their journal
        return [_shift_records(self.series[key]) for key in keys]


def _require_series(row: Record) -> None:
    """Raise KeyError or TypeError unless a row is a series."""
    for key in ("key", "t"):
        len(row[key])


def series_key(block: Block) -> str:
    """Hash the inputs of a block; of even angles the first and their number."""
    if block.seed is None:
        return content_key({"shifts": " ".join(block.keys), **engine_versions()})
    return content_key({"first": block.first_key, "n": len(block.angles), **engine_versions()})


def _series_record(key: str, rows: Sequence[Record]) -> Record:
    """Convert the shifts of a series to its line, with times of the actuator if they differ."""
    sleeve_ticks = []
    actuator_ticks = []
    for row in rows:
        time = result_of(row).shift_time
        sleeve_ticks.append(_ticks(row, time))
        actuator_ticks.append(_ticks(row, row.get("actuator_time_s", time)))
    actuator = {} if actuator_ticks == sleeve_ticks else {"actuator": actuator_ticks}
    return {"key": key, "t": sleeve_ticks, **actuator}


def _ticks(row: Record, time: float | None) -> int | None:
    """Convert a time of a shift, s, to ticks; None for a failed integration."""
    if diverged(row):
        return None
    return NOT_ENGAGED if time is None else round(time / TICK)


def _shift_records(series: Record) -> list[Record]:
    """Convert the line of a series to shifts with outcome and times, s."""
    sleeve_ticks: list[int | None] = series["t"]
    actuator_ticks: list[int | None] = series.get("actuator", sleeve_ticks)
    records: list[Record] = []
    for sleeve, actuator in zip(sleeve_ticks, actuator_ticks, strict=True):
        outcome = Outcome.ENGAGED
        if sleeve is None:
            outcome = Outcome.DIVERGED
        elif sleeve == NOT_ENGAGED:
            outcome = Outcome.TIMED_OUT
        record = {
            "outcome": outcome.value,
            "shift_time_s": _seconds(sleeve),
            "actuator_time_s": _seconds(actuator),
        }
        records.append(record)
    return records


def _seconds(ticks: int | None) -> float | None:
    """Convert ticks to s; None for a shift without a time."""
    if ticks is None or ticks == NOT_ENGAGED:
        return None
    return ticks * TICK
