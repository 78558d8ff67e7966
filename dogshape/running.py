"""Receiver of progress and relative angles as verbs take them."""

from __future__ import annotations

from collections.abc import Sequence

from dogshape.pipeline.progress import SILENT, Progress
from dogshape.sim.errors import InputError, refusal, require_between

Angles = int | Sequence[float] | None  #: how many evenly spaced ones, or listed ones, deg


def receiver(wanted: Progress | bool) -> Progress:
    """Give what receives progress: a bar in terminal or notebook for True, nothing for False."""
    from dogshape.terminal import ProgressBar  # noqa: PLC0415  # rich, which few calls need

    bar = ProgressBar() if wanted else SILENT
    return bar if isinstance(wanted, bool) else wanted


def require_angles(angles: Angles) -> None:
    """Raise InputError for no relative angle, or angles, deg, of which one is not finite."""
    if isinstance(angles, int):
        require_between("--angles", angles, 1, 100_000, "give for instance 24")
    for angle in () if angles is None or isinstance(angles, int) else angles:
        if not abs(angle) <= 1e6:
            rule, remedy = "it must be a finite angle", "give an angle in degrees"
            raise InputError(refusal("relative angle", angle, "deg", rule, remedy))
