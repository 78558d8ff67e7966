"""Operating points that a question names: one, or all of a study's."""

from __future__ import annotations

from dogshape.pipeline.config.study_file import Setup
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import require_stiff_enough
from dogshape.sim.units import RPM


def point_of(
    study: Setup, mismatch: float, force: float, rise: float | None, other_way: str = ""
) -> OperatingPoint:
    """Return an operating point from 1/min, nominal N and a rise time in s, None for the study's.

    ``other_way`` is what the verb offers for a force that the study's table lacks.
    """
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force, rise, other_way))
    require_stiff_enough(study.clutch, point.profile.force)
    return point


def points_of(
    study: Setup,
    mismatch: float | None,
    force: float | None,
    rise: float | None = None,
    other_way: str = "",
) -> tuple[OperatingPoint, ...]:
    """Return the one operating point that is asked for, or all of the study's."""
    if (mismatch is None) != (force is None):
        raise InputError("one operating point needs --mismatch-rpm and --force-N; give both")
    if mismatch is None or force is None:
        return study.points
    return (point_of(study, mismatch, force, rise, other_way),)
