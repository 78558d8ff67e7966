r"""Edge on edge: two rounded edges of steel as a line contact, and the blow that they take.

Two like cylinders of radius :math:`\varrho` under a load *w* for each length touch on a strip of
the half width :math:`a = \sqrt{4 w R/(\pi E^*)}` with :math:`R = \varrho/2` and
:math:`E^* = E/(2 (1 - \nu^2))`. The largest pressure is :math:`\sqrt{w E^*/(\pi R)}`, and the
stiffness :math:`\pi E^*/(2 \ln(4 \varrho/a) - 2)` for each length (Hertz; Johnson, *Contact
Mechanics*, 1985, 5.57, for both halves).

The simulation has a bed of springs in its place, which stands for a dog that bends and is pressed.
Over a narrow overlap that is far softer than steel. A blow of the same energy on the line contact,
in series with the whole dog, peaks with more load. That it takes all of the energy makes it an
upper bound: fork, shaft and ring give way too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.sim.strength.materials import POISSON, YOUNG

MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  #: Pa, of two like bodies


def edge_pressure(line_load: float, radius: float) -> float:
    """Compute the pressure of Hertz of two like edges, Pa; load in N/m, their radius in m."""
    return math.sqrt(line_load * MODULUS / (math.pi * 0.5 * radius))


@dataclass(frozen=True)
class LineContact:
    """Two like edges of steel under a load per length.

    Parameters
    ----------
    radius : of either edge, m.
    load : N/m.
    """

    radius: float
    load: float

    @property
    def half_width(self) -> float:
        """Half of the strip that touches (Hertz), m."""
        return math.sqrt(4.0 * self.load * 0.5 * self.radius / (math.pi * MODULUS))

    @property
    def pressure(self) -> float:
        """Largest pressure, Pa."""
        return edge_pressure(self.load, self.radius)

    @property
    def approach(self) -> float:
        """Approach of both cylinders' axes, m."""
        return (
            self.load
            / (math.pi * MODULUS)
            * (2.0 * math.log(4.0 * self.radius / self.half_width) - 1.0)
        )

    @property
    def stiffness(self) -> float:
        """Load per length over approach, for a small change of load, Pa."""
        return math.pi * MODULUS / (2.0 * math.log(4.0 * self.radius / self.half_width) - 2.0)

    @property
    def energy(self) -> float:
        """Energy per length that the contact stores, N."""
        # w dz, with the logarithm's own part of 1/(4 pi E*).
        return 0.5 * self.load * self.approach - self.load**2 / (4.0 * math.pi * MODULUS)


def bed_energy(load: float, radius: float, stiffness: float) -> float:
    """Compute the energy per length of two rounded edges on a bed of springs in Pa/m, N."""
    depth = (0.75 * load / (stiffness * math.sqrt(radius))) ** (2.0 / 3.0)
    return 0.4 * load * depth


def flat_energy(load: float, overlap: float, stiffness: float) -> float:
    """Compute the energy per length of flat faces that overlap on a bed of springs in Pa/m, N."""
    return 0.5 * load**2 / (stiffness * overlap)


def blow_load(energy: float, radius: float, dog: float) -> float:
    """Compute the load per length of a blow, N/m, on a line contact in series with a dog.

    ``energy`` per length in N; ``dog`` the stiffness of a dog for each length, Pa.
    """
    # Takes a quarter of a second to load, which checks of studies without it do not need.
    from scipy.optimize import brentq  # noqa: PLC0415

    if energy <= 0.0:
        return 0.0
    alone = math.sqrt(2.0 * energy * dog)  # were all of the energy in the dog

    def left(w: float) -> float:
        return LineContact(radius, w).energy + 0.5 * w * w / dog - energy

    return float(brentq(left, 1e-6 * alone, alone))


def line_load(load: float, radius: float, bed: float, dog: float) -> float:
    """Compute the load per length, N/m, of a line contact on a dog at the energy of a bed's load.

    ``bed`` in Pa/m; ``dog`` the stiffness of a dog for each length, Pa.
    """
    return blow_load(bed_energy(load, radius, bed), radius, dog)
