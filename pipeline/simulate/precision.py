"""An expected shift time to a wanted standard error, with as few shifts as that needs.

Evenly spaced angles at every operating point; each round has twice the angles of the one
before and holds them. A standard error from few shifts may be small by luck, so none is
believed before there are 24.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.evaluation import expectation_of
from dogshape.pipeline.simulate.executor import Executor
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.shift_records import Record

FIRST = 6  #: angles of the first round
ENOUGH = 24  #: shifts from which a standard error is believed
MOST = 96  #: angles of the last round


@dataclass(frozen=True)
class Precise:
    """An expectation with the blocks and records it came from."""

    expectation: Expectation
    blocks: list[Block]
    rows: list[list[Record]]


def expect_to(
    study: Setup,
    points: Sequence[OperatingPoint],
    precision: float,
    executor: Executor,
    progress: WorkCounter,
) -> Precise:
    """Return the expectation over ``points`` to a relative standard error ``precision``.

    Where that cannot be reached, the last round is returned and progress says why.
    """
    count, seed = FIRST, study.file.expectation.seed
    while True:
        unsure = study.uncertainty
        blocks = even_blocks(study.clutch, points, count, seed, FIRST, uncertainty=unsure)
        rows = executor.run(blocks)
        found = expectation_of(study, points, rows)
        share = found.standard_error / found.mean
        shifts = len(points) * count
        if any(p.mean_engaged is None for p in found.points):
            progress.say("nothing engages at some operating point: no precision can be reached")
        elif share > precision and count >= MOST:
            progress.say(f"{share:.1%} is what {MOST} angles at each operating point give")
        elif share > precision or shifts < ENOUGH:
            few = ", from too few to trust" if share <= precision else ""
            progress.say(f"standard error {share:.1%} from {shifts} shifts{few}; twice the angles")
            count *= 2
            progress.extend(shifts)
            continue
        return Precise(found, blocks, rows)
