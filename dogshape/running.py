"""Receiver of progress and relative angles as verbs take them."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

from dogshape.pipeline.progress import SILENT, Progress
from dogshape.sim.errors import InputError, Refusal, require_between
from dogshape.sim.interface import argument
from dogshape.sim.units import DEG

Angles = int | Sequence[float] | None  #: number of evenly spaced angles, or listed ones, deg


def receiver(progress: Progress | bool | None) -> Progress:
    """Build the receiver of progress: a bar for True, a silent one for False, or the given one.

    None is a bar where a person watches: in a terminal and in a notebook.
    """
    from dogshape.terminal import ProgressBar  # noqa: PLC0415  # rich, which few calls need

    if isinstance(progress, Progress):
        return progress
    if progress is False:
        return SILENT
    bar = ProgressBar()
    return bar if progress or bar.is_watched else SILENT


def in_radians(angles: int | Sequence[float]) -> int | tuple[float, ...]:
    """Convert listed relative angles to rad, check a number of angles; InputError out of range."""
    if isinstance(angles, int | Integral):
        require_between(argument("angles"), int(angles), 1, 100_000, "give for instance 24")
        return int(angles)
    for angle in angles:
        if not abs(angle) <= 1e6:
            rule, remedy = "it must be a finite angle", "give an angle in degrees"
            raise InputError(Refusal("relative angle", angle, "deg", rule, remedy))
    return tuple(angle * DEG for angle in angles)
