"""Designs that fill their space, for the surrogate to learn from.

Designs are those of a scrambled Sobol sequence over the search ranges that pass every check;
every third one instead breaks a limit by up to ``SLACK`` of it, so that the border, where the
best designs are, has data on both sides. What lets go of itself stays so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import count, islice

from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import none_passes, worth_simulating
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.surrogate.covariance import Array

Values = dict[str, float]  #: a design by its variables, edge units
SLACK = 0.15  #: of a limit, by which designs beyond the border break it
BEYOND = 3  #: one design in so many lies beyond the border
DRAWS = 2**16  #: draws without a new design after which there is none


def filling_designs(study: Setup, seed: int, *, border: bool = True) -> Iterator[Values]:
    """Yield designs that fill the feasible space and, with ``border``, a band beyond it."""
    inside = _sobol_designs(study, seed)
    beyond = _sobol_designs(study, seed + 1, beyond=True)
    for index in count(1):
        design = next(beyond, None) if border and index % BEYOND == 0 else None
        design = design or next(inside, None)
        if design is None:
            return  # whole numbers alone run out
        yield design


def own_designs(study: Setup) -> list[Values]:
    """List the study's own dog, unless it cannot be made or its face is held by friction."""
    try:
        require_makeable(study.clutch.dog, study.limits.manufacturing)
    except GeometryError:
        return []
    slides = study.clutch.dog.chamfer > math.atan(study.limits.load.friction_release)
    return [study.prototype] if slides else []


def first_designs(study: Setup, count: int, apart: int = 0, *, border: bool = True) -> list[Values]:
    """List the first designs of a sequence: that of the study's seed and a number ``apart``."""
    sequence = filling_designs(study, study.file.surrogate.seed + apart, border=border)
    return list(islice(sequence, count))


def _sobol_designs(study: Setup, seed: int, beyond: bool = False) -> Iterator[Values]:
    sequence = qmc.Sobol(len(study.variables), seed=seed)
    wanted = _just_beyond if beyond else worth_simulating
    seen: set[tuple[float, ...]] = set()
    missed = 0
    while missed < DRAWS:
        for unit in sequence.random(256):
            design = _design(study, unit)
            missed += 1
            if tuple(design.values()) not in seen and wanted(study, design):
                missed = 0
                seen.add(tuple(design.values()))
                yield design
    if not seen and not beyond:
        raise InputError(
            none_passes(study, f"none of {DRAWS} designs drawn from the search ranges")
        )


def _design(study: Setup, unit: Array) -> Values:
    return {
        name: int(low + math.floor(share * (high - low + 1.0)))
        if name == "count"
        else round(float(low + share * (high - low)), 3)
        for (name, (low, high)), share in zip(study.variables.items(), unit, strict=True)
    }


def _just_beyond(study: Setup, design: Values) -> bool:
    """Check whether a design breaks a limit, none by more than ``SLACK``, and lets go."""
    try:
        checks = strength_checks(study.dog_with(design), study.limits)
    except GeometryError:
        return False
    releases = [check for check in checks if check.name.endswith("_release")]
    within = all(check.margin >= -SLACK for check in checks)
    return within and feasible(releases) and not feasible(checks)
