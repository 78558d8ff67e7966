"""Operating points of a study: a bundled set, a grid, a list, or a draw from distributions.

A draw is made once: points of a scrambled Sobol sequence with equal weights, so that search,
mix and surrogate see a list of points whatever they came from. A quantity that is a list while
the other is drawn goes with every draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dogshape.pipeline.config.duty_cycles import duty_cycle
from dogshape.pipeline.config.schema import DistributionSection, OperatingSection
from dogshape.sim.errors import InputError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.uncertainty import sobol_shares
from dogshape.sim.units import RPM

AXES = ("mismatch_rpm", "force_N")
OWN = (*AXES, "mismatch_weight", "force_weight", "samples", "seed")  #: keys of grid and draw
SAMPLES = 24  #: points that are drawn where the study does not say
DECIMALS = 3  #: of drawn speeds and forces
Profiles = Callable[[float], ForceProfile]  #: the force profile of a nominal force in N
Weighted = list[tuple[float, float]]  #: values in edge units with their weights


def points_of(section: OperatingSection, profile: Profiles) -> tuple[OperatingPoint, ...]:
    """Return the operating points; mistakes raise InputError."""
    if section.set is not None:
        return _of_set(section, section.set, profile)
    if section.points is not None:
        return _listed(section, profile)
    drawn = _drawn(section)
    if drawn is None:
        rows = _grid(section)
    else:
        _refuse(section, ("mismatch_weight", "force_weight"), "goes with a grid of lists")
        rows = drawn
    return tuple(
        OperatingPoint(mismatch * RPM, profile(force), weight) for mismatch, force, weight in rows
    )


def axes_of(
    section: OperatingSection, points: Sequence[OperatingPoint], factor: float = 1.0
) -> list[list[float]]:
    """Return mismatches in 1/min and nominal forces in N of a study, each once, in their order.

    ``factor`` is the share of the nominal force that the points have.
    """
    found = (
        [round(point.mismatch / RPM, 9) for point in points],
        [point.profile.force / factor for point in points],
    )
    axes = []
    for name, values in zip(AXES, found, strict=True):
        given = getattr(section, name)
        axes.append(list(given) if isinstance(given, list) else list(dict.fromkeys(values)))
    return axes


def operating_text(section: OperatingSection, axes: Sequence[Sequence[float]], count: int) -> str:
    """Return in words which operating points a study has, ``count`` of them."""
    if section.points is not None or section.set is not None:
        kind = "listed" if section.set is None else f"of the set {section.set}"
        (slow, *_, fast), (weak, *_, strong) = (sorted([*values, *values]) for values in axes)
        ends = f"{slow:g} to {fast:g} 1/min with {weak:g} to {strong:g} N"
        return f"{count} {kind}, {ends}, by weight"
    parts = []
    for name, unit, values in zip(AXES, ("1/min", "N"), axes, strict=True):
        given = getattr(section, name)
        text = ", ".join(f"{value:g}" for value in values)
        if isinstance(given, DistributionSection):
            text = given.named(name).text
        parts.append(f"{text} {unit}")
    weighted = section.mismatch_weight is not None or section.force_weight is not None
    drawn = f"; {count} drawn" if _distributions(section) else ", weighted" if weighted else ""
    return f"{parts[0]}, each with {parts[1]}{drawn}"


def _of_set(section: OperatingSection, name: str, profile: Profiles) -> tuple[OperatingPoint, ...]:
    _refuse(section, (*OWN, "points"), f"cannot stand beside operating.set = '{name}'")
    cycle = duty_cycle(name)
    try:
        return tuple(OperatingPoint(m * RPM, profile(force), w) for m, force, w in cycle.rows)
    except InputError as error:
        raise InputError(f"operating.set '{name}': {error}") from error


def _listed(section: OperatingSection, profile: Profiles) -> tuple[OperatingPoint, ...]:
    _refuse(section, OWN, "cannot stand beside operating.points")
    points = section.points or []
    places = [(point.mismatch_rpm, point.force_N) for point in points]
    for place in places:
        if places.count(place) > 1:
            raise InputError(
                f"operating.points has {place[0]:.6g} 1/min with {place[1]:.6g} N twice; "
                "give it once with the sum of both weights"
            )
    return tuple(OperatingPoint(p.mismatch_rpm * RPM, profile(p.force_N), p.weight) for p in points)


def _refuse(section: OperatingSection, names: Sequence[str], rule: str) -> None:
    for name in names:
        if getattr(section, name) is not None:
            raise InputError(f"operating.{name} {rule}; remove one of the two")


def _distributions(section: OperatingSection) -> list[str]:
    return [name for name in AXES if isinstance(getattr(section, name), DistributionSection)]


def _drawn(section: OperatingSection) -> list[tuple[float, float, float]] | None:
    """Return drawn points with their weights, None where nothing is a distribution."""
    names = _distributions(section)
    if not names:
        _refuse(section, ("samples", "seed"), "is for a distribution, but all are lists")
        return None
    count = section.samples or SAMPLES
    shares = sobol_shares(count, len(names), section.seed if section.seed is not None else 1)
    drawn = {
        name: np.round(getattr(section, name).named(f"operating.{name}").at(column), DECIMALS)
        for name, column in zip(names, shares.T, strict=True)
    }
    if len(names) == len(AXES):
        return [(m, f, 1.0) for m, f in zip(*(drawn[n].tolist() for n in AXES), strict=True)]
    mismatches, forces = (
        drawn[name].tolist() if name in drawn else _values(section, name) for name in AXES
    )
    return [(mismatch, force, 1.0) for mismatch in mismatches for force in forces]


def _grid(section: OperatingSection) -> list[tuple[float, float, float]]:
    speeds = _weighted(section, "mismatch_rpm", "mismatch_weight")
    forces = _weighted(section, "force_N", "force_weight")
    return [(speed, force, v * w) for speed, v in speeds for force, w in forces]


def _values(section: OperatingSection, name: str) -> list[float]:
    values = getattr(section, name)
    if values is None:
        raise InputError(
            f"'operating.{name}' is missing; add it, or list the points as [[operating.points]]"
        )
    if len(set(values)) < len(values):
        raise InputError(f"operating.{name} has a value twice; give each once")
    return list(values)


def _weighted(section: OperatingSection, name: str, weight: str) -> Weighted:
    values, weights = _values(section, name), getattr(section, weight)
    if weights is None:
        return [(value, 1.0) for value in values]
    if len(weights) != len(values):
        raise InputError(
            f"operating.{weight} has {len(weights)} and operating.{name} {len(values)} values, "
            "but each needs its weight; give lists of equal length"
        )
    for value in weights:
        if not 0.0 < value < float("inf"):
            raise InputError(
                f"operating.{weight} has {value:.6g}, but weights must be positive; "
                "leave out what does not count"
            )
    return list(zip(values, weights, strict=True))
