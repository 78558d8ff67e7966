"""Check that the dogs of a shift did not pass through each other.

The pressure field of the contact grows down to the apex of its pyramids and pushes
the wrong way beyond it. A dog that was pressed past the apex went through another.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim.errors import refusal
from sim.geometry import Dog
from sim.mesh import pressure_apex

Series = NDArray[np.float64]


def penetration(dog: Dog, displacement: Series, relative_angle: Series) -> Series:
    r"""Compute how deep a sliding dog lies in an output dog, m, (n,); 0 where they are apart.

    Sections at the mean radius are convex and one is the other turned by half a turn, so
    along each shared normal they overlap by :math:`2 p_n - n \cdot c`, with the plane's
    distance and the way between both centres; the least over traction flank, face and
    braking flank is the depth.

    Parameters
    ----------
    displacement : axial way of the sliding ring from the start, m, (n,).
    relative_angle : output ring's lead over dogs facing dogs, rad, (n,).
    """
    across = -relative_angle * dog.mean_radius
    across = across - dog.pitch * np.round(across / dog.pitch)
    along = dog.travel - displacement
    traction, braking, chamfer = dog.traction, dog.braking, dog.chamfer
    quarter, half = 0.25 * dog.pitch, 0.5 * dog.height
    crest = quarter - half * math.tan(traction)
    planes = [
        (math.cos(traction), math.sin(traction), math.cos(traction) * quarter),
        (-math.cos(braking), math.sin(braking), math.cos(braking) * quarter),
        (
            -math.sin(chamfer),
            math.cos(chamfer),
            half * math.cos(chamfer) - crest * math.sin(chamfer),
        ),
    ]
    deepest = np.zeros_like(along)
    for turn in (-1, 0, 1):
        y = across + turn * dog.pitch
        overlaps = [2.0 * offset - (n_y * y + n_z * along) for n_y, n_z, offset in planes]
        deepest = np.maximum(deepest, np.min(overlaps, axis=0))
    return deepest


def passing_through(dog: Dog, displacement: Series, relative_angle: Series) -> str:
    """Describe why a shift is not valid: dogs pressed past the apex; empty where it is."""
    deepest = float(penetration(dog, displacement, relative_angle).max())
    apex = pressure_apex(dog)[1]
    if deepest <= apex:
        return ""
    rule = f"the contact pushes back only down to {apex * 1e3:.4g} mm: dogs passed through"
    remedy = "lower the force or the speed, or raise contact.stiffness_Pa_m"
    return refusal("penetration of the dogs", deepest * 1e3, "mm", rule, remedy)
