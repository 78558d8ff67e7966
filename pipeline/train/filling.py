"""Designs and operating points that fill their space, for the surrogate to learn from.

Designs are those of a scrambled Sobol sequence over the search ranges that pass every
check; every third one instead breaks a limit by up to ``SLACK`` of it, so that the border,
where the best designs are, has data on both sides. What lets go of itself stays so: beyond
the friction angle the physics is another.

Each design gets operating points of its own, the next ones of a sequence that fills the range
of mismatch and force evenly (Roberts 2018, from the plastic number), drawn towards the edges
by a cosine, since a process knows least there. All sequences go on where they ended, so
more designs add to those simulated before.

The study's own dog and the reference of its search come first, with all operating points of the
study: predictions are conditioned on the design that is asked about first.

**References** are designs simulated so densely that a surrogate can be judged by them. Some fill
the feasible space; others are of the tenth that the surrogate finds best, where a search has to
tell designs apart. Every operating point of the study starts with some evenly spaced angles. Points
that put more than their part into the error of the expected time get twice the angles, the earlier
ones among them, until the error is small enough.

Points are judged over all designs together. To look closer where one design's own error is large
would correct unlucky draws and keep lucky ones, which are low in mean and error alike; and to
look closer where a shift hung would make such shifts seem rarer than they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import count, islice

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import worth_simulating
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.failing import none_passes
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_block, even_blocks
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import RPM
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import rows_of

SLACK = 0.15  #: of a limit, by which designs beyond the border break it
BEYOND = 3  #: one design in so many lies beyond the border
DRAWS = 2**16  #: draws without a new design after which there is none
OWN = 30_000  #: added to the seed for the study's own designs
DENSER = 2  #: times the angles of other rows for the study's own designs
OWN_SHIFTS = 1344  #: for each of them, at least
PLASTIC = 1.32471795724474602596  #: root of x^3 = x + 1


def filling_designs(study: Setup, seed: int, *, border: bool = True) -> Iterator[dict[str, float]]:
    """Yield designs that fill the feasible space and, with ``border``, a band beyond it."""
    inside = _sobol_designs(study, seed)
    beyond = _sobol_designs(study, seed + 1, beyond=True)
    for index in count(1):
        design = next(beyond, None) if border and index % BEYOND == 0 else None
        design = design or next(inside, None)
        if design is None:
            return  # whole numbers alone run out
        yield design


def own_designs(study: Setup) -> list[dict[str, float]]:
    """Return the study's own dog and the reference of its search, as far as they can be simulated.

    A dog that cannot be made, or whose face holds by friction, teaches nothing about others.
    """
    reference = study.file.search.reference or {}
    wanted = [study.prototype]
    if set(reference) <= set(study.variables):
        wanted.append({**study.prototype, **reference})
    return [
        design
        for place, design in enumerate(wanted)
        if design not in wanted[:place] and _slides(study, design)
    ]


def _slides(study: Setup, design: dict[str, float]) -> bool:
    """Test that a dog can be made and that its face lets go of itself."""
    try:
        dog = study.dog_with(design)
        require_makeable(dog, study.limits.manufacturing)
    except GeometryError:
        return False
    return dog.chamfer > math.atan(study.limits.load.friction_release)


def own_blocks(study: Setup) -> list[Block]:
    """Return the shifts of the study's own designs at all of its operating points."""
    settings, size = study.file.surrogate, len(study.points)
    angles = max(DENSER * settings.angles, math.ceil(OWN_SHIFTS / size))
    return [
        even_block(
            study.clutch.with_dog(study.dog_with(design)),
            point,
            angles,
            (settings.seed + OWN, index * size + place),
            uncertainty=study.uncertainty,
        )
        for index, design in enumerate(own_designs(study))
        for place, point in enumerate(study.points)
    ]


def first_designs(study: Setup, count: int) -> list[dict[str, float]]:
    """Return the first designs that fill the space of a study."""
    return list(islice(filling_designs(study, study.file.surrogate.seed), count))


def _sobol_designs(study: Setup, seed: int, beyond: bool = False) -> Iterator[dict[str, float]]:
    names = list(study.variables)
    bounds = np.array(list(study.variables.values()), dtype=float)
    sequence = qmc.Sobol(len(names), seed=seed)
    wanted = _just_beyond if beyond else worth_simulating
    seen: set[tuple[float, ...]] = set()
    missed = 0
    while missed < DRAWS:
        for unit in sequence.random(256):
            design = _design(names, bounds, unit)
            missed += 1
            if tuple(design.values()) not in seen and wanted(study, design):
                missed = 0
                seen.add(tuple(design.values()))
                yield design
    if not seen and not beyond:
        raise InputError(
            none_passes(study, f"none of {DRAWS} designs drawn from the search ranges")
        )


def _design(names: list[str], bounds: np.ndarray, unit: np.ndarray) -> dict[str, float]:
    design: dict[str, float] = {}
    for name, (low, high), share in zip(names, bounds, unit, strict=True):
        if name == "count":
            design[name] = int(low + math.floor(share * (high - low + 1.0)))
        else:
            design[name] = round(float(low + share * (high - low)), 3)
    return design


def _just_beyond(study: Setup, design: dict[str, float]) -> bool:
    """Check whether a design breaks a limit, none by more than ``SLACK``, and lets go."""
    try:
        checks = strength_checks(study.dog_with(design), study.limits)
    except GeometryError:
        return False
    releases = [check for check in checks if check.name.endswith("_release")]
    within = all(check.margin >= -SLACK for check in checks)
    return within and feasible(releases) and not feasible(checks)


def filling_point(study: Setup, seed: int, index: int) -> OperatingPoint:
    """Return the operating point of a place in the sequence."""
    start = np.random.default_rng(seed).random(2)
    steps = np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])
    u, v = 0.5 - 0.5 * np.cos(math.pi * ((start + index * steps) % 1.0))
    mismatch, force = _between(study.mismatches, float(u)), _between(study.forces, float(v))
    return OperatingPoint(mismatch * RPM, study.actuation.at_sleeve(force))


def _between(values: Sequence[float], share: float) -> float:
    """Return the value at ``share`` of a range: of the logarithm where all have one sign."""
    low, high = min(values), max(values)
    drawn = low + share * (high - low)
    if low * high > 0.0:
        drawn = float(low * (high / low) ** share)
    return min(max(round(drawn, 2), low), high)


def filling_blocks(study: Setup, design: dict[str, float], index: int, seed: int) -> list[Block]:
    """Return the shifts of the design at ``index``, a block for each of its operating points."""
    points = study.file.surrogate.points
    clutch = study.clutch.with_dog(study.dog_with(design))
    return [
        even_block(
            clutch,
            filling_point(study, seed, row),
            study.file.surrogate.angles,
            (seed, row),
            uncertainty=study.uncertainty,
        )
        for row in range(index * points, (index + 1) * points)
    ]


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
