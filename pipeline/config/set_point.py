"""How a study operates a design: set-point of the mismatch, level and rise of the shift force.

They are searched together with the shape where ``[variables]`` holds them. A design's operating
points are those of the study, with

- the mismatch moved so that its mean over the mix is the set-point: the spread about it is the
  error of the speed control, and stays;
- the final force times its factor, with the rise time that ``[actuation]`` has for it;
- that rise time times its factor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from dogshape.pipeline.config.actuation import Actuation
from dogshape.sim.errors import InputError, refusal
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM

MISMATCH, FORCE, RISE = "mismatch_set_rpm", "force_factor", "rise_factor"
OPERATED = (MISMATCH, FORCE, RISE)  #: keys of ``[variables]`` that are none of the dog
WIDEST = {MISMATCH: (-2000.0, 2000.0), FORCE: (0.01, 100.0), RISE: (0.1, 10.0)}
DECIMALS = 6  #: of the study's own set-point


def own_set_point(points: Sequence[OperatingPoint]) -> dict[str, float]:
    """Return the keys of ``OPERATED`` as a study has them without any search."""
    return {MISMATCH: round(_mean(points) / RPM, DECIMALS), FORCE: 1.0, RISE: 1.0}


def operated_points(
    points: Sequence[OperatingPoint], actuation: Actuation, params: Mapping[str, float]
) -> tuple[OperatingPoint, ...]:
    """Return the operating points of a design; keys that are absent change nothing.

    Raises InputError for a force that ``[actuation]`` has no rise time for.
    """
    own = own_set_point(points)[MISMATCH]  # rounded alike, so that a study's own moves nothing
    move = (params.get(MISMATCH, own) - own) * RPM
    force, rise = params.get(FORCE, 1.0), params.get(RISE, 1.0)
    return tuple(_moved(point, actuation, move, force, rise) for point in points)


def require_ranges(
    points: Sequence[OperatingPoint],
    actuation: Actuation,
    ranges: Mapping[str, tuple[float, float]],
) -> None:
    """Refuse ranges of ``OPERATED`` whose ends no shift can have."""
    for key, (least, most) in WIDEST.items():
        for value in ranges.get(key, ()):
            if not least <= value <= most:
                unit = "1/min" if key == MISMATCH else ""
                rule = f"it must lie between {least:g} and {most:g} {unit}".rstrip()
                raise InputError(refusal(f"variables.{key}", value, unit, rule, "narrow the range"))
    for factor in ranges.get(FORCE, ()):
        try:
            operated_points(points, actuation, {FORCE: factor})
        except InputError as error:
            raise InputError(f"variables.{FORCE} of {factor:g}: {error}") from error


def _mean(points: Sequence[OperatingPoint]) -> float:
    weight = sum(point.weight for point in points)
    return sum(point.weight * point.mismatch for point in points) / weight


def _moved(
    point: OperatingPoint, actuation: Actuation, move: float, force: float, rise: float
) -> OperatingPoint:
    profile = point.profile
    if force != 1.0:
        profile = actuation.at_sleeve(profile.force * force)
    if rise != 1.0:
        profile = replace(profile, rise=profile.rise * rise)
    return replace(point, mismatch=point.mismatch + move, profile=profile)
