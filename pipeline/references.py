"""References: designs simulated so densely that a surrogate can be judged by them.

Every operating point of the study starts with some evenly spaced angles. Points that put more
than their part into the error of the design's expected time get twice the angles, the
earlier ones among them, until the error is small enough. Where a shift hung crest on crest that
goes furthest: one such angle of twelve would otherwise stand for a twelfth of the pitch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pipeline.config import Study
from pipeline.evaluation import expectation_of
from pipeline.executor import Executor
from pipeline.filling import filling_designs
from sim.blocks import Block, even_blocks
from sim.clutch import Clutch
from sim.expectation import Expectation

APART = 90_000  #: added to the seed of the surrogate's data for designs that it never sees
PRECISE = 0.006  #: relative standard error of a reference's expected time
MOST = 96  #: angles of an operating point at most


def reference_designs(study: Study) -> list[dict[str, float]]:
    """Return feasible designs that fill the space and are not among the surrogate's data."""
    settings = study.file.surrogate
    designs = filling_designs(study, settings.seed + APART, border=False)
    return [next(designs) for _ in range(settings.references)]


def simulate_references(
    study: Study,
    designs: Sequence[dict[str, float]],
    executor: Executor,
    ahead: Callable[[int], None],
) -> None:
    """Simulate designs to ``PRECISE``, with ``MOST`` angles at an operating point at most.

    The shifts are in the executor's journal; ``ahead`` is told how many each round has.
    """
    clutches = [study.clutch.with_dog(study.dog_with(design)) for design in designs]
    counts = [[study.file.surrogate.reference_angles] * len(study.points) for _ in designs]
    while True:
        blocks = [_blocks(study, *both) for both in zip(clutches, counts, strict=True)]
        whole = [block for group in blocks for block in group]
        ahead(sum(len(block.angles) for block in whole))
        found = executor.run(whole)
        groups = [found[k : k + len(study.points)] for k in range(0, len(found), len(study.points))]
        finer = [
            _finer(expectation_of(study, study.points, rows), count)
            for rows, count in zip(groups, counts, strict=True)
        ]
        if finer == counts:
            return
        counts = finer


def _blocks(study: Study, clutch: Clutch, counts: Sequence[int]) -> list[Block]:
    settings = study.file.surrogate
    first, seed = settings.reference_angles, settings.seed + APART
    finest = {count: even_blocks(clutch, study.points, count, seed, first) for count in set(counts)}
    return [finest[count][index] for index, count in enumerate(counts)]


def _finer(found: Expectation, counts: Sequence[int]) -> list[int]:
    """Return the angles of the next round: twice at points with more than their part in the error.

    The same as before where the error is small enough.
    """
    if found.standard_error <= PRECISE * found.mean:
        return list(counts)
    size = len(counts)
    part = PRECISE * found.mean * size**0.5
    return [
        2 * count if point.standard_error > part and 2 * count <= MOST else count
        for point, count in zip(found.points, counts, strict=True)
    ]
