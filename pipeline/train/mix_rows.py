"""Designs simulated at every operating point of the study.

Half of the angles of an operating point are even; in a few rounds the others halve the intervals
in which the time most likely jumps (``sim.statistics.expectation``). With as many even angles the
error of a design's expected time would be four times as large. Where more than the angle is
uncertain a time is no function of it, and all angles are even.

The first two thirds fill the space as the other rows do. The others are of the fifth that is
expected to be best then, where a search has to tell designs apart: they are chosen once and kept.
The file has a line for each design and not for each shift, or it would have hundreds of megabytes;
of what a run had not written when it was stopped, a few designs, shifts are simulated again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.store.journal import append, drop_torn_line
from dogshape.pipeline.train.filling import filling_designs, first_designs
from dogshape.pipeline.train.training_rows import row_record, study_mix, with_rows
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.expectation import halves, mean_round_the_pitch
from dogshape.sim.statistics.shift_records import Record, content_key, result_of, unfinished
from dogshape.sim.versions import engine
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import COLUMNS, row_of
from dogshape.surrogate.learning import fitted, mix_times
from dogshape.surrogate.mix_times import MixTimes
from dogshape.surrogate.model import MIN_DESIGNS

POOL = 60_000  #: added to the seed of the surrogate's data for designs of which the best are taken
LEAST = 16  #: angles of an operating point, at least
USUAL = 128  #: shifts of a design, at least
ROUNDS = (3, 3, 2)  #: sixteenths of the angles that halve intervals, round by round
MOST = 800  #: designs at most: more take longer to ask than they are worth
FILLS = 2.0 / 3.0  #: share of the designs that fill the space
BEST = 5  #: one in so many of the others' pool is taken
TOGETHER = 32  #: designs that are written at a time

Design = dict[str, float]
Lines = dict[str, list[list[float | None]]]  #: rows of a design by its key


def angles_of(study: Setup) -> int:
    """Return the angles of each operating point of a design: a power of two from ``LEAST`` on."""
    angles = LEAST
    while angles * len(study.points) < USUAL:
        angles *= 2
    return angles


def count_of(study: Setup) -> int:
    """Count the designs that the study's ``mix_shifts`` are enough for, ``MOST`` at most."""
    return min(MOST, study.file.surrogate.mix_shifts // (angles_of(study) * len(study.points)))


def require_mix(study: Setup) -> None:
    """Raise InputError if ``mix_shifts``, unless 0, is not enough for the designs of a fit."""
    given, each = study.file.surrogate.mix_shifts, angles_of(study) * len(study.points)
    least = math.ceil(MIN_DESIGNS / FILLS)  # the first of them choose the others
    if given and count_of(study) < least:
        raise InputError(
            f"surrogate.mix_shifts = {given} is enough for {count_of(study)} designs of {each} "
            f"shifts, but the expected time over the study's operating points needs {least} "
            f"at least; give {least * each} or more, or 0 to learn it from single points"
        )


def halved(study: Setup) -> tuple[int, ...]:
    """Count the angles of each round that halves intervals; none where all angles are even."""
    if study.uncertainty is not None:
        return ()
    return tuple(angles_of(study) * share // 16 for share in ROUNDS)


def mix_blocks(study: Setup, design: Design, index: int) -> list[Block]:
    """Return the even angles of the design at ``index``."""
    clutch = study.clutch.with_dog(study.dog_with(design))
    seed, size = study.file.surrogate.seed, len(study.points)
    return [
        even_block(
            clutch,
            point,
            angles_of(study) - sum(halved(study)),
            (seed, index * size + place),
            uncertainty=study.uncertainty,
        )
        for place, point in enumerate(study.points)
    ]


def simulate_mix_rows(study: Setup, folder: StudyFolder, executor: Executor) -> None:
    """Simulate the designs that a folder lacks; the executor's journal gets no shift of theirs."""
    count = count_of(study)
    if count == 0:
        return
    filling = first_designs(study, round(FILLS * count))
    known = _lines(folder.mix)
    _simulate(study, filling, 0, (folder.mix, known), executor)
    if not folder.chosen.exists():
        _choose(study, folder, filling, count - len(filling))
    chosen = _chosen(folder)
    _simulate(study, chosen, len(filling), (folder.mix, known), executor)


def mix_rows(study: Setup, folder: StudyFolder) -> Array:
    """Return the rows of a folder's designs, (n, d + 8)."""
    filling = first_designs(study, round(FILLS * count_of(study)))
    chosen = _chosen(folder) if folder.chosen.exists() else []
    return _rows(study, [*filling, *chosen], _lines(folder.mix))


def _rows(study: Setup, designs: Sequence[Design], lines: Lines) -> Array:
    blocks = (mix_blocks(study, design, index) for index, design in enumerate(designs))
    keys = (_key(study, of_design) for of_design in blocks)
    found = [row for key in keys for row in lines.get(key, [])]
    return np.array(found, dtype=float).reshape(-1, len(study.variables) + len(COLUMNS))


def _choose(study: Setup, folder: StudyFolder, filling: list[Design], count: int) -> None:
    """Choose designs of those that are expected to be best, and keep them."""
    rows = _rows(study, filling, _lines(folder.mix))
    model = fitted(mix_times(with_rows(study, rows[:0]), rows, study_mix(study)), points=False)
    seed = study.file.surrogate.seed + POOL
    drawn = islice(filling_designs(study, seed, border=False), BEST * count)
    pool = [design for design in drawn if design not in filling]
    best = np.argsort(expected(model, study.rows(pool)), kind="stable")[:count]
    write_json(folder.chosen, {"designs": [pool[place] for place in sorted(best.tolist())]})


def _chosen(folder: StudyFolder) -> list[Design]:
    """Read the designs that were chosen."""
    found: list[Design] = read_json(folder.chosen, "remove it and fit again")["designs"]
    return found


def expected(model: MixTimes, x: Array) -> Array:
    """Predict the expected time over the mix of designs (m, d) in edge units, (m,), s."""
    mean, variance = model.processes[0].predict(model.coordinates(x))
    return np.exp(mean + 0.5 * variance)


def _simulate(
    study: Setup,
    designs: Sequence[Design],
    first: int,
    known: tuple[Path, Lines],
    executor: Executor,
) -> None:
    """Simulate what the file lacks of designs that are counted from ``first`` on."""
    path, lines = known
    blocks = [mix_blocks(study, design, first + k) for k, design in enumerate(designs)]
    keys = [_key(study, of_design) for of_design in blocks]
    there = [k for k, key in enumerate(keys) if key in lines]
    if there and executor.known is not None:
        executor.known(len(there) * angles_of(study) * len(study.points))
    left = [k for k, key in enumerate(keys) if key not in lines]
    for start in range(0, len(left), TOGETHER):
        some = left[start : start + TOGETHER]
        with executor.apart() as own:
            found = iter(_shifts(own, [block for k in some for block in blocks[k]], halved(study)))
        for k in some:
            shifts = [next(found) for _ in blocks[k]]
            x = study.rows([designs[k]])[0].tolist()
            rows = row_record(
                np.array([_row(x, one, halved(study)) for one in shifts], dtype=float)
            )
            lines[keys[k]] = rows
            if not any(unfinished(shift) for one in shifts for shift in one):
                append(path, {"key": keys[k], "rows": rows})


def _shifts(
    executor: Executor, blocks: Sequence[Block], rounds: Sequence[int]
) -> list[list[Record]]:
    """Simulate blocks at their even angles, then round by round where their times jump."""
    found = executor.run(blocks)
    for count in rounds:
        nearer = [
            replace(block, angles=_nearer(block, shifts, count))
            for block, shifts in zip(blocks, found, strict=True)
        ]
        more = executor.run(nearer)
        found = [[*before, *new] for before, new in zip(found, more, strict=True)]
    return found


def _nearer(block: Block, shifts: Sequence[Record], count: int) -> tuple[float, ...]:
    """Choose ``count`` further angles of a block, rad."""
    pitch = block.clutch.dog.pitch_angle
    return tuple((halves(*_phases_and_times(shifts), count) * pitch).tolist())


def _phases_and_times(shifts: Sequence[Record]) -> tuple[Array, Array]:
    """Return the angles of shifts in fractions of a pitch and their times, (n,) each."""
    phases = [shift["relative_angle_deg"] * shift["count"] / 360.0 for shift in shifts]
    times = [result_of(shift).shift_time for shift in shifts]
    return np.array(phases), np.array([np.nan if t is None else t for t in times])


def _row(x: Sequence[float], shifts: Sequence[Record], rounds: Sequence[int]) -> list[float] | None:
    """Return the row of a design's shifts at one operating point.

    Its mean is over the pitch; the deviation is that of the even angles, which come first.
    """
    row = row_of(x, shifts[: len(shifts) - sum(rounds)])
    if row is None or not rounds:
        return row
    phases, times = _phases_and_times(shifts)
    mean, variance = mean_round_the_pitch(phases, times)
    sound = sum(result_of(shift).outcome is not Outcome.DIVERGED for shift in shifts)
    new = {"mean_s": mean, "standard_error_s": variance**0.5, "shifts": float(sound)}
    for name, value in {**new, "engaged": float(np.isfinite(times).sum())}.items():
        row[len(x) + COLUMNS.index(name)] = value
    return row


def _key(study: Setup, blocks: Sequence[Block]) -> str:
    """Return the key that tells a design's shifts from all others."""
    first = [[block.only([0]).keys[0], len(block.angles)] for block in blocks]
    return content_key({"blocks": first, "halved": list(halved(study)), **engine()})


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
