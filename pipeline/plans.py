"""What is simulated of a design: how many angles at which of the study's operating points."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.config import Study
from sim.blocks import Block, even_block
from sim.clutch import Clutch

Plan = list[int]  #: angles at each operating point of the study, 0 where nothing is simulated


def whole_plan(study: Study, angles: int | None = None) -> Plan:
    """Return the plan of every operating point; as many angles as the study says if not given."""
    return [angles or study.file.expectation.angles] * len(study.points)


def is_whole(plan: Sequence[int]) -> bool:
    """Tell whether every operating point is simulated."""
    return all(count > 0 for count in plan)


def blocks_of(study: Study, clutch: Clutch, plan: Sequence[int], seed: int) -> list[Block]:
    """Return the blocks of a plan, one for each operating point that has angles."""
    return [
        even_block(clutch, point, count, (seed, index), uncertainty=study.uncertainty)
        for index, (point, count) in enumerate(zip(study.points, plan, strict=True))
        if count
    ]
