"""The engine of a clutch: Drake's plant or the compiled one, chosen by its solver.

Each is loaded when it is first asked for: either takes a second or more, and few runs want both.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement

if TYPE_CHECKING:
    from dogshape.sim.planar.engagement import PlanarClutch
    from dogshape.sim.shift.plant import ClutchPlant

    Plant = ClutchPlant | PlanarClutch


@lru_cache(maxsize=2)
def plant_of(clutch: Clutch) -> Plant:
    """Build the plant of a clutch once in this process."""
    if clutch.solver.engine == "planar":
        from dogshape.sim.planar.engagement import planar_clutch  # noqa: PLC0415

        return planar_clutch(clutch)
    from dogshape.sim.shift.plant import ClutchPlant  # noqa: PLC0415

    return ClutchPlant(clutch)


def engage(clutch: Clutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift with the engine of the clutch's solver; ``relative_angle`` in rad."""
    plant = plant_of(clutch)
    if clutch.solver.engine == "planar":
        from dogshape.sim.planar import engagement as planar  # noqa: PLC0415

        return planar.engage(plant, point, relative_angle)  # type: ignore[arg-type]
    from dogshape.sim.shift import engagement as drake  # noqa: PLC0415

    return drake.engage(plant, point, relative_angle)  # type: ignore[arg-type]
