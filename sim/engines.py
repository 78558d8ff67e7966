"""The engine of a clutch: Drake's plant or the compiled one, chosen by its solver.

Each is loaded when it is first asked for: either takes a second or more, and few runs want both.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement


@lru_cache(maxsize=2)
def _prepared(clutch: Clutch) -> Callable[[OperatingPoint, float], Engagement]:
    """Build the plant of a clutch once in this process; it is the first argument of a shift."""
    if clutch.solver.engine == "planar":
        from dogshape.sim.planar import engagement as planar  # noqa: PLC0415

        return partial(planar.engage, planar.planar_clutch(clutch))
    from dogshape.sim.shift import engagement as drake  # noqa: PLC0415
    from dogshape.sim.shift.plant import ClutchPlant  # noqa: PLC0415

    return partial(drake.engage, ClutchPlant(clutch))


def engage(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift with the engine of the clutch's solver; ``relative_angle`` in rad."""
    return _prepared(clutch)(point, relative_angle)
