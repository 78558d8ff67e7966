"""An expected shift time to a wanted standard error, with as few shifts as that needs.

Even angles at every operating point, fewer where the planar model takes over most of the
spread; each round has twice the angles of the one before and holds them. A standard error
from few shifts may be small by luck, so none is believed before there are 24.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.config import Study
from pipeline.executor import Executor
from pipeline.progress import ShiftProgress
from sim.batch import Block, Record, pitch_angles, result_of
from sim.clutch import OperatingPoint
from sim.control import control_of, trusted
from sim.expectation import Expectation, even_phases, expect, expect_point

FIRST, FIRST_TRUSTED = 6, 4  #: angles of the first round
ENOUGH = 24  #: shifts from which a standard error is believed
MOST = 16  #: times as many angles as in the first round, at the most


@dataclass(frozen=True)
class Precise:
    """An expectation with the blocks and records it came from."""

    expectation: Expectation
    blocks: list[Block]
    rows: list[list[Record]]


def expect_to(
    study: Study,
    points: Sequence[OperatingPoint],
    precision: float,
    executor: Executor,
    progress: ShiftProgress,
) -> Precise:
    """Return the expectation over ``points`` to a relative standard error ``precision``.

    The angles of a round contain those of the round before, so no shift is lost.
    """
    relied = trusted(study.clutch, points)
    factor = 1
    while True:
        blocks = _blocks(study, points, relied, factor)
        result = _round(study, blocks, relied, executor)
        found = result.expectation
        share = found.standard_error / found.mean
        shifts = sum(len(block.angles) for block in blocks)
        if found.is_lower_bound:
            progress.say("nothing engages at some operating point: no precision can be reached")
            return result
        if share <= precision and shifts >= ENOUGH:
            return result
        if factor >= MOST:
            progress.say(f"{share:.1%} after {shifts} shifts is what {MOST} rounds of angles give")
            return result
        factor *= 2
        progress.say(f"standard error {share:.1%} so far; twice the angles")


def _blocks(
    study: Study, points: Sequence[OperatingPoint], relied: list[bool], factor: int
) -> list[Block]:
    seed = study.file.expectation.seed
    blocks = []
    for index, (point, rely) in enumerate(zip(points, relied, strict=True)):
        base = FIRST_TRUSTED if rely else FIRST
        phases = even_phases(base * factor, seed, index, base)
        blocks.append(Block(study.clutch, point, pitch_angles(study.clutch, phases)))
    return blocks


def _round(study: Study, blocks: list[Block], relied: list[bool], executor: Executor) -> Precise:
    rows = executor.run(blocks)
    results = []
    for index, (block, mine, rely) in enumerate(zip(blocks, rows, relied, strict=True)):
        seed = (study.file.expectation.seed, index)
        control = control_of(study.clutch, block.point, block.angles, seed) if rely else None
        shifts = [result_of(row) for row in mine]
        timeout, retraction = study.clutch.timeout, study.retraction
        results.append(expect_point(block.point, shifts, timeout, retraction, control=control))
    return Precise(expect(results), blocks, rows)
