r"""Stress at the filleted root of a dog in closed form, fitted to finite elements.

With tangential force :math:`F` at the height :math:`l` above the floor on a flank that
leans by :math:`\delta` (the opposite one by :math:`\epsilon`), dog :math:`b` long along the
radius and :math:`s` wide at the root at the mean radius, root radius :math:`\rho`, and
:math:`e = s/2 - l \tan\delta` from the dog's middle to the load:

.. math::
    \sigma_1 = \frac{F}{b} K (1 + k_3 \tan\delta) \left[ \frac{6 l}{s^2}
        + \frac{k_5}{\sqrt{s l}}
        - k_6 \tan\delta \left(\frac{6 e}{s^2} + \frac{1}{s}\right) \right], \qquad
    K = \left(1 + k_1 (s/\rho)^{k_2}\right) (1 + k_4 b/s)

largest first principal stress in the fillet of the loaded flank. The terms are those of
Heywood (1948) for fillets of loaded projections: notch factor, bending, and the load's
nearness to a stubby root; then bending and pressure by the axial force of a leaning
flank, of which a third arrives; and the factor :math:`b/s` for the spread along the radius.

Von Mises stress: ``MISES_FACTOR`` times :math:`\sigma_1` in the loaded fillet (a state
between plane stress, 1, and plane strain, 0.89). In the opposite fillet, which is pressed:

.. math::
    \sigma_v = \frac{F}{b} k_7 K (1 + k_8 \tan\epsilon) \left[ \frac{6 l}{s^2}
        + \frac{k_9}{\sqrt{s l}} + k_{10} \frac{\tan\delta}{s} \right]

Valid for rings of 52/44 mm in which every dog carries the same force, on a hub that
holds the ring radially; chamfer 0 to 20, side angles 4 to 30 deg, height 1.6 to 6 mm, 6 to
36 dogs, root radius 0.2 to 0.6 mm; loads at half the height or at the tip, spread over the
whole radial width. ``python -m benchmarks.root_stress`` fits the coefficients again and
prints the errors on 14 designs, 56 loads, that the fit did not see: :math:`\sigma_1` 3.3 % rms
and at most 12 % too low, the larger von Mises stress 3.6 % rms and at most 15 % too low.
Both largest are one dog, 11.5 mm wide on a ring of 8 and loaded at the tip; the others stay
within 7 and 8 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from dogshape.sim.elementwise import largest, smallest, sqrt, tan
from dogshape.sim.errors import require_between
from dogshape.sim.shift.geometry import Dog, Flank, side_angle
from dogshape.sim.units import DEG, MM


@dataclass(frozen=True)
class Load:
    """Tangential force on one dog, N, on a flank, at a height above the floor, m."""

    force: float
    flank: Flank
    lever: float


#: Where the fit ends: longest dog for its root width, and steepest flank (tangent). Beyond,
#: the relief by either stays what it is there.
LONGEST, STEEPEST = 1.2, math.tan(math.radians(30.0))


class Tension(NamedTuple):
    """Coefficients of the first principal stress."""

    notch: float
    sharpness: float
    lean: float
    spread: float
    near: float
    axial: float


TENSION = Tension(0.341, 0.615, -0.557, -0.162, 1.068, 0.314)


def root_nominal(dog: Dog, load: Load, by: Tension = TENSION) -> float:
    """Return the tension at the root on the loaded side without the notch, Pa."""
    width, lean = dog.root_width, tan(side_angle(dog, load.flank))
    arm = 0.5 * width - load.lever * lean
    nominal = (
        6.0 * load.lever / width**2
        + by.near / sqrt(width * load.lever)
        - by.axial * lean * largest(0.0, 6.0 * arm / width**2 + 1.0 / width)
    )
    # However steep the flank, a third of the bending stays.
    return load.force / dog.radial_width * largest(nominal, 2.0 * load.lever / width**2)


def root_tension(dog: Dog, root_radius: float, load: Load, by: Tension = TENSION) -> float:
    """Return the largest first principal stress in the loaded flank's fillet, Pa.

    ``root_radius`` in m.
    """
    return notch_factor(dog, root_radius, load.flank, by) * root_nominal(dog, load, by)


def notch_factor(dog: Dog, root_radius: float, flank: Flank, by: Tension = TENSION) -> float:
    """Return the tension in the fillet over the nominal one, at least 1."""
    lean = smallest(tan(side_angle(dog, flank)), STEEPEST)
    return largest(1.0, _notch(dog, root_radius, by) * (1.0 + by.lean * lean))


def outside_fit(dog: Dog, root_radius: float) -> list[str]:
    """Return in words what of a design lies outside the fit of the closed form."""
    ratios = (
        ("radial width over root width", dog.radial_width / dog.root_width, 0.3, LONGEST),
        ("root width over root radius", dog.root_width / root_radius, 6.0, 50.0),
        ("height over root width", dog.height / dog.root_width, 0.35, 1.2),
        ("steepest side angle, deg", max(dog.traction, dog.braking) / DEG, 0.0, 30.0),
    )
    return [
        f"{name} is {value:.3g}, but the root formula was fitted to {low:g} to {high:g}"
        for name, value, low, high in ratios
        if not low <= value <= high
    ]


def _notch(dog: Dog, root_radius: float, by: Tension) -> float:
    require_between("root_radius_mm", root_radius / MM, 0.01, 10.0, "correct the fillet")
    sharp = 1.0 + by.notch * (dog.root_width / root_radius) ** by.sharpness
    length = smallest(dog.radial_width / dog.root_width, LONGEST)
    return sharp * (1.0 + by.spread * length)
