r"""Thin rims: a root that the ring behind it does not hold.

Below a rim of 1.2 heights of the dog the root also bends with the rim. ISO 6336-3 (rim thickness
factor, external teeth) raises its stress by

.. math:: Y_B = 1.6 \ln(2.242\,h/s_R), \qquad 0.5 < s_R/h < 1.2,

with the thickness :math:`s_R` behind the root and the height *h*; thicker rims have 1. At half a
height it ends: thinner rims break through themselves, and want finite elements. The rule is of
spur gears, whose rim closes round the teeth; behind dogs it is a plate that a hub holds at one edge
(an assumption).
"""

from __future__ import annotations

import math

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.units import MM

THICK, THINNEST = 1.2, 0.5  #: heights of a dog: no effect above, no formula below

RIM_RULE = Rule(
    "rim",
    "load",
    "thickness of the ring behind the roots; below 1.2 heights it raises the stress of the root",
    "manufacturing.rim_mm against 0.5 h; root stress times Y_B = 1.6 ln(2.242 h/rim)",
    "ISO 6336-3, rim thickness factor, whose range ends there",
    "mm",
    "dog.height_mm",
    False,
)


def rim_factor(dog: Dog, limits: ManufacturingLimits) -> float:
    """Return the factor by which a thin rim raises the stress of the root, at least 1."""
    if limits.rim is None or limits.rim >= THICK * dog.height:
        return 1.0
    return max(1.0, 1.6 * math.log(2.242 * dog.height / limits.rim))


def rim_checks(dog: Dog, limits: ManufacturingLimits) -> tuple[Check, ...]:
    """Return the check of the rim, none where its thickness is not given."""
    if limits.rim is None:
        return ()
    return (Check(RIM_RULE, limits.rim / MM, THINNEST * dog.height / MM),)
