"""Simulation of designs at every operating point of the study, a row for each point.

Half of the angles of an operating point are even; in a few rounds the others halve the intervals
in which the time most likely jumps (``sim.statistics.bisection``). With as many even angles the
error of a design's expected time would be four times as large. Where more than the angle is
uncertain a time is no function of it, and all angles are even.

The file has a line for each design and not for each shift, or it would have hundreds of megabytes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.journal import append, drop_torn_line
from dogshape.pipeline.train.filling import Values
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.errors import StorageError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.bisection import halves, mean_round_the_pitch
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.shift_records import Record, content_key, result_of, unfinished
from dogshape.sim.versions import engine
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS, row_of

ROUNDS = (3, 3, 2)  #: sixteenths of the angles that halve intervals, round by round
BATCH = 32  #: designs that are simulated before their rows are written

Lines = dict[str, list[list[float | None]]]  #: rows of a design by its key


@dataclass(frozen=True)
class Job:
    """A design with the number of its angles at each point, and the draw of the even ones."""

    design: Values
    angles: int
    seed: int
    index: int

    def rounds(self, study: Setup) -> tuple[int, ...]:
        """Count the angles of each round that halves intervals; none where all are even."""
        if study.uncertainty is not None:
            return ()
        return tuple(self.angles * share // 16 for share in ROUNDS)

    def blocks(self, study: Setup) -> list[Block]:
        """List the even angles of the design at each operating point."""
        clutch = study.clutch.with_dog(study.dog_with(self.design))
        even, size = self.angles - sum(self.rounds(study)), len(study.points)
        return [
            even_block(
                clutch, point, even, (self.seed, self.index * size + place),
                uncertainty=study.uncertainty,
            )
            for place, point in enumerate(study.points)
        ]  # fmt: skip

    def key(self, study: Setup) -> str:
        """Hash what tells the design's shifts from all others."""
        first = [[block.first_key, len(block.angles)] for block in self.blocks(study)]
        return content_key({"blocks": first, "halved": list(self.rounds(study)), **engine()})


def jobs_of(designs: Sequence[Values], angles: int, seed: int) -> list[Job]:
    """List the jobs of designs, each with angles of its own: common ones err like a bias."""
    return [Job(design, angles, seed, index) for index, design in enumerate(designs)]


def simulate_designs(study: Setup, path: Path, jobs: Sequence[Job], executor: Executor) -> None:
    """Simulate designs whose rows the file lacks; the executor's journal forgets their shifts."""
    lines = _lines(path)
    keys = {job.key(study): job for job in jobs}
    there = sum(job.angles for key, job in keys.items() if key in lines) * len(study.points)
    if there and executor.known is not None:
        executor.known(there)
    left = [key for key in keys if key not in lines]
    for batch in (left[start : start + BATCH] for start in range(0, len(left), BATCH)):
        found = _shifts(study, [keys[key] for key in batch], executor)
        for key, shifts in zip(batch, found, strict=True):
            rows = [_row(study, keys[key], one) for one in shifts]
            if not any(unfinished(shift) for one in shifts for shift in one):
                append(path, {"key": key, "rows": row_record(np.array(rows, dtype=float))})
        executor.forget()


def simulated_rows(study: Setup, path: Path, jobs: Sequence[Job]) -> Array:
    """Read the rows of designs that the file has, (n, d + 8)."""
    lines = _lines(path)
    found = [row for job in jobs for row in lines.get(job.key(study), [])]
    return np.array(found, dtype=float).reshape(-1, len(study.variables) + len(COLUMNS))


def _shifts(study: Setup, jobs: Sequence[Job], executor: Executor) -> list[list[list[Record]]]:
    """Simulate designs at their even angles, then round by round where their times jump.

    Returns the shifts of each design by operating point.
    """
    blocks = [block for job in jobs for block in job.blocks(study)]
    rounds = [job.rounds(study) for job in jobs for _ in study.points]
    found = executor.run(blocks)
    for number in range(len(rounds[0])):
        nearer = []
        for block, shifts, counts in zip(blocks, found, rounds, strict=True):
            pitch = block.clutch.dog.pitch_angle
            angles = halves(*_phases_and_times(shifts), counts[number]) * pitch
            nearer.append(replace(block, angles=tuple(angles.tolist())))
        more = executor.run(nearer)
        found = [[*before, *new] for before, new in zip(found, more, strict=True)]
    size = len(study.points)
    return [found[k : k + size] for k in range(0, len(found), size)]


def _phases_and_times(shifts: Sequence[Record]) -> tuple[Array, Array]:
    """Return the angles of shifts in fractions of a pitch and their times, (n,) each."""
    phases = [shift["relative_angle_deg"] * shift["count"] / 360.0 for shift in shifts]
    times = [result_of(shift).shift_time for shift in shifts]
    return np.array(phases), np.array([np.nan if t is None else t for t in times])


def _row(study: Setup, job: Job, shifts: Sequence[Record]) -> list[float] | None:
    """Return the row of a design's shifts at one operating point.

    Mean and share engaged are over the pitch: angles are dense where shifts hang. The deviation is
    that of the even angles, which come first.
    """
    x, halved = study.rows([job.design])[0].tolist(), sum(job.rounds(study))
    row = row_of(x, shifts[: len(shifts) - halved])
    if row is None or not halved:
        return row
    phases, times = _phases_and_times(shifts)
    mean, variance = mean_round_the_pitch(phases, times)
    order = np.argsort(phases)
    gaps = np.diff(phases[order], append=phases[order[0]] + 1.0)
    widths = 0.5 * (gaps + np.roll(gaps, 1))
    share = float(widths @ np.isfinite(times[order]))
    sound = sum(result_of(shift).outcome is not Outcome.DIVERGED for shift in shifts)
    new = {"mean_s": mean, "standard_error_s": variance**0.5, "shifts": float(sound)}
    for name, value in {**new, "engaged": round(share * sound, 6)}.items():
        row[len(x) + COLUMNS.index(name)] = value
    return row


def _lines(path: Path) -> Lines:
    """Read the rows of each design by its key."""
    if not path.exists():
        return {}
    drop_torn_line(path)
    found: Lines = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            record = json.loads(line)
            found[record["key"]] = record["rows"]
        except (ValueError, KeyError, TypeError) as error:
            raise StorageError(
                f"{path}, line {number} is not a finished design; remove the line or fit the "
                "study in another folder"
            ) from error
    return found
