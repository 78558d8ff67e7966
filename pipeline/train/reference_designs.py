"""References: designs simulated so densely that a surrogate can be judged by them.

Some fill the feasible space; others are of the tenth that the surrogate finds best, where a
search has to tell designs apart. Every operating point of the study starts with some evenly
spaced angles. Points that put more than their part into the error of the expected time get twice
the angles, the earlier ones among them, until the error is small enough.

Points are judged over all designs together. To look closer where one design's own error is large
would correct unlucky draws and keep lucky ones, which are low in mean and error alike; and to
look closer where a shift hung would make such shifts seem rarer than they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.train.filling import filling_designs
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.shift_records import Record
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of

APART = 90_000  #: added to the seed of the surrogate's data for designs that it never sees
MOST = 96  #: angles of an operating point at most


def reference_designs(study: Setup, count: int) -> list[dict[str, float]]:
    """Return feasible designs that fill the space and are not among the surrogate's data."""
    designs = filling_designs(study, study.file.surrogate.seed + APART, border=False)
    return list(islice(designs, count))


def best_designs(study: Setup, times: Callable[[Array], Array]) -> list[dict[str, float]]:
    """Return designs of the tenth that is expected to be best, as many as references.

    They are drawn after those of ``reference_designs``, and so are others; ``times`` predicts
    those of designs (m, d) in edge units, (m,).
    """
    pool = best_pool(study)
    if not len(pool):
        return []
    best = np.argsort(times(pool))[: study.file.surrogate.best_references]
    return [study.named(pool[place]) for place in sorted(best.tolist())]


def best_pool(study: Setup) -> Array:
    """Return the feasible designs of which the best tenth become references, (m, d)."""
    fill = study.file.surrogate.references
    designs = reference_designs(study, fill + 10 * study.file.surrogate.best_references)[fill:]
    return study.rows(designs)


def simulate_references(
    study: Setup,
    designs: Sequence[dict[str, float]],
    executor: Executor,
    more: Callable[[int], None],
) -> None:
    """Simulate designs to the study's error of references, at most ``MOST`` angles at a point.

    The shifts are in the executor's journal. ``more`` is called with the number of shifts that each
    round adds to ``first_shifts``.
    """
    clutches = [study.clutch.with_dog(study.dog_with(design)) for design in designs]
    counts, size = [study.file.surrogate.reference_angles] * len(study.points), len(study.points)
    while clutches:
        blocks = [
            block
            for index, clutch in enumerate(clutches)
            for block in _blocks(study, clutch, counts, index)
        ]
        found = executor.run(blocks)
        rows = np.array([_mean_and_error(study, shifts) for shifts in found])
        wanted = study.file.surrogate.reference_error
        finer = finer_counts(rows.reshape(-1, size, 2), counts, wanted, study_mix(study).weights)
        if finer == counts:
            return
        more((sum(finer) - sum(counts)) * len(clutches))
        counts = finer


def first_shifts(study: Setup) -> int:
    """Count the shifts of the first round of references."""
    settings = study.file.surrogate
    designs = settings.references + settings.best_references
    return designs * len(study.points) * settings.reference_angles


def _blocks(study: Setup, clutch: Clutch, counts: Sequence[int], index: int) -> list[Block]:
    """Return the shifts of a reference; with common angles errors would look like a bias."""
    settings = study.file.surrogate
    first, seed = settings.reference_angles, settings.seed + APART + index
    finest = {
        count: even_blocks(clutch, study.points, count, seed, first, uncertainty=study.uncertainty)
        for count in set(counts)
    }
    return [finest[count][index] for index, count in enumerate(counts)]


def _mean_and_error(study: Setup, shifts: Sequence[Record]) -> tuple[float, float]:
    """Return mean and standard error of shifts that engage, s; zeros where too few did."""
    names = tuple(study.variables)
    mean, error, _, engaged = rows_of(names, shifts)[0, len(names) + 2 : len(names) + 6]
    return (float(mean), float(error)) if engaged > 2 else (0.0, 0.0)


def finer_counts(found: Array, counts: Sequence[int], wanted: float, weights: Array) -> list[int]:
    """Return the angles of the next round from means and errors of designs at points, (k, m, 2).

    Twice at points with more than their part in the error of the expected time, over all designs;
    the same as before where that is at most ``wanted`` of the time. ``weights`` of the points add
    up to one, (m,).
    """
    variance = weights**2 * (found[:, :, 1] ** 2).mean(axis=0)
    allowed = (wanted * float((found[:, :, 0] @ weights).mean())) ** 2
    if variance.sum() <= allowed:
        return list(counts)
    return [
        2 * count if own * len(counts) > allowed and 2 * count <= MOST else count
        for own, count in zip(variance.tolist(), counts, strict=True)
    ]
