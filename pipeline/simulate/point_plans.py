"""Plan of a design's simulations: numbers of angles at the study's operating points."""

from __future__ import annotations

from collections.abc import Sequence

from dogshape.pipeline.config.study_file import Setup
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.statistics.numerical_error import repeated

Plan = list[int]  #: angles at each operating point of the study, 0 where nothing is simulated


def whole_plan(study: Setup, angles: int | None = None) -> Plan:
    """Return the plan of every operating point; as many angles as the study says if not given."""
    return [angles or study.own_angles] * len(study.points)


def is_whole(plan: Sequence[int]) -> bool:
    """Decide whether every operating point is simulated."""
    return all(count > 0 for count in plan)


def blocks_of(
    study: Setup, clutch: Clutch, plan: Sequence[int], seed: int, base: int | None = None
) -> list[Block]:
    """Return the blocks of a plan, one for each operating point that has angles.

    ``base`` as for ``sim.statistics.expectation.even_phases``.
    """
    return [
        even_block(clutch, point, count, (seed, index), base, uncertainty=study.uncertainty)
        for index, (point, count) in enumerate(zip(study.points, plan, strict=True))
        if count
    ]


def most_to_search(study: Setup, designs: int, partial: bool, prototype: bool) -> int:
    """Count the shifts of so many designs, at most; one that fails a check takes none.

    With ``partial`` they are simulated at ``search.points`` operating points, but for the
    ``prototype`` where it is among them.
    """
    every = len(study.points)
    own = study.file.search.points if partial else None
    points = designs * (own or every) + (every - (own or every) if prototype else 0)
    return points * study.own_angles


def most_to_confirm(study: Setup, designs: int) -> int:
    """Count the shifts that confirm the prototype and so many designs, at most.

    For prototype and chosen design those for the numerical error come on top.
    """
    each = len(study.points) * study.file.search.confirm_angles
    return (1 + designs) * each + 2 * repeated(each)
