"""References: designs simulated so densely that a surrogate can be judged by them.

Some fill the feasible space; others are of the tenth that the surrogate finds best, where a
search has to tell designs apart. Every operating point of the study starts with some evenly
spaced angles. Points that put more than their part into the error of the design's expected time
get twice the angles, the earlier ones among them, until the error is small enough.

Only shifts that engage decide that. To look closer where a shift hung, and only there, would
make such shifts seem rarer than they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.config import Study
from pipeline.executor import Executor
from pipeline.filling import filling_designs
from pipeline.rows import study_mix
from sim.blocks import Block, even_blocks
from sim.clutch import Clutch
from sim.records import Record
from surrogate.covariance import Array
from surrogate.dataset import rows_of
from surrogate.model import Surrogate
from surrogate.over import Over

APART = 90_000  #: added to the seed of the surrogate's data for designs that it never sees
PRECISE = 0.008  #: relative standard error of a reference's expected time
MOST = 96  #: angles of an operating point at most


def reference_designs(study: Study, count: int) -> list[dict[str, float]]:
    """Return feasible designs that fill the space and are not among the surrogate's data."""
    designs = filling_designs(study, study.file.surrogate.seed + APART, border=False)
    return [next(designs) for _ in range(count)]


def best_designs(study: Study, surrogate: Surrogate) -> list[dict[str, float]]:
    """Return designs of the tenth that the surrogate finds best, as many as references.

    They are drawn after those of ``reference_designs``, and so are others.
    """
    pool = best_pool(study)
    if not len(pool):
        return []
    time = Over(surrogate, study_mix(study)).predict(pool)[0]
    best = np.argsort(time)[: study.file.surrogate.best_references]
    return [study.named(pool[place]) for place in sorted(best.tolist())]


def best_pool(study: Study) -> Array:
    """Return the feasible designs of which the best tenth become references, (m, d)."""
    fill = study.file.surrogate.references
    designs = reference_designs(study, fill + 10 * study.file.surrogate.best_references)[fill:]
    names = tuple(study.variables)
    rows = [[design[name] for name in names] for design in designs]
    return np.array(rows, dtype=float).reshape(-1, len(names))


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
            _finer(_rows(study, rows), count) for rows, count in zip(groups, counts, strict=True)
        ]
        if finer == counts:
            return
        counts = finer


def _blocks(study: Study, clutch: Clutch, counts: Sequence[int]) -> list[Block]:
    settings = study.file.surrogate
    first, seed = settings.reference_angles, settings.seed + APART
    finest = {count: even_blocks(clutch, study.points, count, seed, first) for count in set(counts)}
    return [finest[count][index] for index, count in enumerate(counts)]


def _rows(study: Study, found: Sequence[Sequence[Record]]) -> Array:
    """Return mean and standard error of the shifts that engage at each point, (m, 2), s."""
    names = tuple(study.variables)
    both = [rows_of(names, shifts)[0, len(names) + 2 : len(names) + 4] for shifts in found]
    return np.nan_to_num(np.array(both))


def _finer(found: Array, counts: Sequence[int]) -> list[int]:
    """Return the angles of the next round: twice at points with more than their part in the error.

    The same as before where the error is small enough.
    """
    size, (mean, error) = len(counts), found.T
    if np.hypot.reduce(error) / size <= PRECISE * mean.mean():
        return list(counts)
    part = PRECISE * mean.mean() * size**0.5
    return [
        2 * count if own > part and 2 * count <= MOST else count
        for own, count in zip(error.tolist(), counts, strict=True)
    ]
