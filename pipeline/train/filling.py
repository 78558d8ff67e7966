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
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import count, islice

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import worth_simulating
from dogshape.pipeline.simulate.failing import none_passes
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import Block, even_block
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import RPM

SLACK = 0.15  #: of a limit, by which designs beyond the border break it
BEYOND = 3  #: one design in so many lies beyond the border
MOST = 2**16  #: draws without a new design after which there is none
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
    while missed < MOST:
        for unit in sequence.random(256):
            design = _design(names, bounds, unit)
            missed += 1
            if tuple(design.values()) not in seen and wanted(study, design):
                missed = 0
                seen.add(tuple(design.values()))
                yield design
    if not seen and not beyond:
        raise InputError(none_passes(study, f"none of {MOST} designs drawn from the search ranges"))


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
