"""Verdicts of the closed-form checks on many designs, in arrays where all have the same limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import Design, design_of, limits_of
from dogshape.sim.clutch_tables import si_fields
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import Dog, Dogs
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.surrogate.covariance import Array, Mask

CHUNK = 5000  #: designs that are worked out at a time


@dataclass(frozen=True)
class Verdicts:
    """Verdicts of the checks on designs, (n,) each.

    Parameters
    ----------
    real : whether there is such a dog.
    feasible : whether it keeps every check before landing.
    margin : the smallest one, NaN where there is no dog.
    worst : the check that has it, empty without one.
    refusal : why there is no dog, or why it cannot be made; empty where it can.
    """

    real: Mask
    feasible: Mask
    margin: Array
    worst: list[str]
    refusal: list[str]


def verdicts(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    """Judge designs (n, d) in edge units by every check that needs no simulation."""
    if not judged_together(study, names):
        return _one_by_one(study, names, x)
    with np.errstate(all="ignore"):  # of shapes that cannot be
        found = [_together(study, names, x[k : k + CHUNK]) for k in range(0, len(x), CHUNK)]
    return Verdicts(
        np.concatenate([one.real for one in found]),
        np.concatenate([one.feasible for one in found]),
        np.concatenate([one.margin for one in found]),
        [name for one in found for name in one.worst],
        [words for one in found for words in one.refusal],
    )


def judged_together(study: Setup, names: Sequence[str]) -> bool:
    """Decide whether a study has the same limits for all designs, none on the shape of its own."""
    return not set(names) & set(OPERATED) and all(one.simulated for one, _ in limits_of(study))


def _one_by_one(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    designs = [_checked(study, dict(zip(names, row, strict=True))) for row in x.tolist()]
    weakest = [smallest_margin(one.checks) if one.checks else None for one in designs]
    return Verdicts(
        np.array([one.dog is not None for one in designs], dtype=bool),
        np.array([one.feasible for one in designs], dtype=bool),
        np.array([np.nan if check is None else check.margin for check in weakest]),
        ["" if check is None else check.name for check in weakest],
        [one.refusal or _unmade(_broken(one)) for one in designs],
    )


def _broken(design: Design) -> list[str]:
    """List the checks that keep a design from being made."""
    return [check.name for check in design.checks if check.name in MAKEABLE and not check.passed]


def _unmade(broken: Sequence[str]) -> str:
    return f"cannot be made: fails {', '.join(broken).replace('_', ' ')}" if broken else ""


def _checked(study: Setup, params: dict[str, float]) -> Design:
    """Return a design with its checks; values that no dog can have are no design either."""
    try:
        return design_of(study, params)
    except DogshapeError as error:
        return Design(params, None, (), str(error))


def _together(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    real = np.broadcast_to(_dogs(study, names, x).possible, len(x))
    # Why a shape cannot be is said in words by the dog itself.
    other = _one_by_one(study, names, x[~real])
    checks = strength_checks(_dogs(study, names, x[real]), study.limits)
    every = [check.name for check in checks]
    columns = np.column_stack([np.broadcast_to(check.margin, real.sum()) for check in checks])
    least = columns.argmin(axis=1)
    margin = np.full(len(x), np.nan)
    margin[real], margin[~real] = columns[np.arange(len(least)), least], other.margin
    worst, refusal = np.full(len(x), "", dtype=object), np.full(len(x), "", dtype=object)
    worst[real], worst[~real] = [every[place] for place in least], other.worst
    refusal[~real] = other.refusal
    made = [name for name in every if name in MAKEABLE]
    broken = columns[:, [every.index(name) for name in made]] < 0.0
    places = np.flatnonzero(real)
    for row in np.flatnonzero(broken.any(axis=1)).tolist():
        refusal[places[row]] = _unmade([made[k] for k in np.flatnonzero(broken[row])])
    dog = real.copy()
    dog[~real] = other.real
    return Verdicts(dog, dog & (margin >= 0.0), margin, worst.tolist(), refusal.tolist())


def _dogs(study: Setup, names: Sequence[str], x: Array) -> Dogs:
    """Give designs in edge units as dogs, what is not named from the study's dog."""
    shapes = si_fields(dict(zip(names, x.T, strict=True)))
    own = {f.name: getattr(study.clutch.dog, f.name) for f in fields(Dog)}
    return Dogs(**(own | shapes))
