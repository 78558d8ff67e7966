"""Check that the dogs of a shift did not pass through each other.

The pressure field of the contact grows down to the apex of its pyramids and pushes
the wrong way beyond it. A dog that was pressed past the apex went through another.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError, refusal
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import pressure_apex
from dogshape.sim.shift.trace import Trace
from dogshape.sim.units import MM

Series = NDArray[np.float64]
LONG = 0.05  #: pitches, by which a step may turn without a look at what is between
COVERED = (
    1.0 / 3.0
)  #: of the apex's depth, to which the field covers all faces (``sim.shift.mesh``)


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
    y = across + dog.pitch * np.array([[-1.0], [0.0], [1.0]])  # the dogs on either side too
    first, second, third = (2.0 * offset - (n_y * y + n_z * along) for n_y, n_z, offset in planes)
    least = np.minimum(np.minimum(first, second), third)
    deepest: Series = np.maximum(least.max(axis=0), 0.0)
    return deepest


def path_of(clutch: Clutch, trace: Trace) -> tuple[Series, Series]:
    """Follow a shift between its steps too: way in m and relative angle in rad, each (m,).

    A step turns fast rings by more than a pitch, and dogs may meet and part within it. Steps that
    turn by more than ``LONG`` are divided into parts that do not, with the cubic through both ends.
    """
    way, angle, speed, turn = (
        trace.displacement, trace.relative_angle, trace.axial_speed, trace.relative_speed,
    )  # fmt: skip
    turned = np.abs(angle[1:] - angle[:-1]) / clutch.dog.pitch_angle
    long = np.flatnonzero(turned > LONG)
    if not long.size:
        return way, angle
    parts = int(np.ceil(turned.max() / LONG))
    s = np.arange(1, parts)[:, None] / parts
    step = trace.time[long + 1] - trace.time[long]

    def between(place: Series, rate: Series) -> Series:
        start, end = place[long], place[long + 1]
        cubic: Series = (
            (1 + 2 * s) * (1 - s) ** 2 * start + s * (1 - s) ** 2 * step * rate[long]
            + s * s * (3 - 2 * s) * end + s * s * (s - 1) * step * rate[long + 1]
        )  # fmt: skip
        return cubic.ravel()

    return np.append(way, between(way, speed)), np.append(angle, between(angle, turn))


def passing_through(clutch: Clutch, displacement: Series, relative_angle: Series) -> str:
    """Describe why a shift is not valid; empty where it is.

    Two limits hold it. Down to a third of the apex's depth the pyramids of the three faces cover
    all that is touched (``sim.shift.mesh``); deeper, the pressure may push the wrong way. At full
    travel both flanks touch, so a ring farther than its tolerance beyond is not in its slot.
    Ordinary shifts stay far within both: 60 of the prototype and 60 of a fine design at up to 641.5
    N reach 0.10 mm and stop short of full travel.

    Parameters
    ----------
    displacement, relative_angle : as for ``penetration``, over the whole shift, (n,).
    """
    remedy = "lower shift force or mismatch, or take fewer and higher dogs"
    deepest = float(penetration(clutch.dog, displacement, relative_angle).max())
    limit = COVERED * pressure_apex(clutch.dog)[1]
    if deepest > limit:
        rule = f"the contact pushes back down to {limit / MM:.4g} mm: dogs passed through"
        return refusal("penetration of the dogs", deepest / MM, "mm", rule, remedy)
    beyond = float(displacement.max()) - clutch.dog.travel
    if beyond > clutch.seated_tolerance:
        rule = (
            f"full travel and its tolerance of {clutch.seated_tolerance / MM:.4g} mm end it: the "
            "ring is not in its slot"
        )
        return refusal("way beyond full travel", beyond / MM, "mm", rule, remedy)
    return ""


def require_stiff_enough(clutch: Clutch, force: float) -> None:
    """Raise InputError where the force alone presses flat faces deeper than a shift's end is told.

    Faces of all dogs on each other give way by :math:`F/(k A)`; beyond the tolerance of the end
    a shift would seem done, or not, by that depth alone.

    Parameters
    ----------
    force : largest shift force, N.
    """
    dog, stiffness = clutch.dog, clutch.contact.stiffness
    area = dog.count * dog.tip_width * dog.radial_width
    depth = force / (stiffness * area)
    if depth <= clutch.seated_tolerance:
        return
    least = force / (clutch.seated_tolerance * area)
    rule = (
        f"{force:.6g} N press the faces {depth / MM:.3g} mm into each other, more than the "
        f"{clutch.seated_tolerance / MM:.4g} mm to which a shift's end is told"
    )
    remedy = f"take at least {least:.2g} Pa/m"
    raise InputError(refusal("contact.stiffness_Pa_m", stiffness, "Pa/m", rule, remedy))
