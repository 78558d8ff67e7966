r"""Share of the axial power that dissipation takes from faces that slide on each other.

The ridge of one ring leads the contact down the face of the other. It lies :math:`\delta` deep in
that face, so a strip of the surface behind the ridge, turned by :math:`\varepsilon` from the face,
ploughs through the compliant layer. Hunt and Crossley multiply the pressure on the strip by
:math:`1 + D v \sin\varepsilon` at the sliding speed *v*. The power that this takes, over the axial
power of a load on the contact length *L* of faces of slope :math:`\alpha`, is

.. math:: \lambda = D v \sin\varepsilon \frac{\hat\delta}{L \sin 2\alpha}, \qquad
   \hat\delta = \frac{\int \delta^2 d\varrho}{\int \delta\,d\varrho}.

Turned by :math:`\psi` from where they are parallel, faces are a wedge of :math:`\tau = \psi
\sin\alpha` along the radius and touch at their inner ends. With the load *W* of a dog, stiffness
*k* and radial width *b*

.. math:: \hat\delta = \tfrac{2}{3} \sqrt{2 W \tau/(k L)} \quad\text{up to}\quad \tau b, \qquad
   \hat\delta = \delta_0 + \frac{(\tau b)^2}{12\,\delta_0}, \quad \delta_0 = \frac{W}{k L b}
   \quad\text{beyond.}

The reference slide starts from rest at a quarter of the face, without friction; the moving mass is
:math:`m + J/(r \tan\alpha)^2`. The speed is that without loss, so the estimate is an upper one. A
second loss, of elastic energy that trailing edges do not give back, does not depend on *D*: it is
left out.

A ring of inertia :math:`J_1` on a shaft of stiffness *c* to the rest :math:`J_2` of its side takes
that along where the slide of the rings alone lasts longer than :math:`2 \pi \sqrt{J_1 J_2/((J_1 +
J_2)\,c)}`, and slides alone otherwise; play in the shaft is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array, bisect
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.clutch import Clutch, ContactSet
from dogshape.sim.shift.mechanism import Shaft

LOSS_LIMIT = 0.02  #: share of the axial power from which a study is told (judged)
START_SHARE = 0.25  #: of a face, where the reference slide starts from rest
AVERAGED_SHARES = (0.35, 0.9)  #: of a face, over which the loss is averaged
SAMPLES = 64  #: intervals of the slide in the mean over its way


class SlidingFace(NamedTuple):
    """Face of a tip that slides down a face of the opposite ring, ridge ahead."""

    slope: float  #: rad
    width: float  #: from the ridge along the circumference, m
    ridge_turn: float  #: from the normal of the face to that of the surface behind the ridge, rad
    parallel_overlap: float  #: overlap along the circumference at which both faces are parallel, m


def sliding_faces(clutch: Clutch) -> list[SlidingFace]:
    """List the sloped faces of a pair that are parallel; empty for flat ones.

    Of unlike slopes the ridge of the steeper dog, which is compliant, slides on a rigid face and
    loses nothing.
    """
    pair = clutch.pair
    dog = pair.rigid
    right_angle = 0.5 * math.pi
    front_turn = right_angle - dog.traction + dog.chamfer
    back_turn = right_angle - dog.braking + dog.chamfer_back
    if dog.has_back:
        front_turn = dog.chamfer + dog.chamfer_back
        back_turn = front_turn
    front = SlidingFace(dog.chamfer, dog.face_width, front_turn, pair.crest_overlap)
    back = SlidingFace(dog.chamfer_back, dog.back_width, back_turn, -pair.crest_overlap)
    faces = [front] if pair.faces.slope_rise == 0.0 else []
    faces += [back] if pair.backs.slope_rise == 0.0 else []
    return [face for face in faces if face.slope > 0.0]


def wedge_depth(load: float, layer: Array, wedge: Array, width: float) -> Array:
    """Compute the mean depth, weighted by depth, of a layer under a wedge-shaped gap, m, (n,).

    Parameters
    ----------
    load : on the width, N.
    layer : stiffness times contact length, Pa, (n,).
    wedge : slope of the gap along the width, (n,).
    width : m.
    """
    mean = load / (layer * width)
    partial = np.sqrt(2.0 * load * wedge / layer)
    opening = wedge * width
    return np.where(partial < opening, 2.0 / 3.0 * partial, mean + opening**2 / (12.0 * mean))


def inertia_moved(shaft: Shaft, duration: float) -> float:
    """Compute the inertia that turns with a ring over a ``duration`` in s, kg m2.

    That of the whole side where the duration exceeds a swing of its shaft, else that of the ring.
    """
    ring = shaft.ring_inertia
    side = shaft.side_inertia
    if side == 0.0:
        return ring
    period = 2.0 * math.pi * math.sqrt(ring * side / ((ring + side) * shaft.stiffness))
    return ring + side if duration > period else ring


def _turning_mass(inertias: Iterable[float], arm: float) -> float:
    """Compute the mass along the axis of two inertias on each other, kg; ``arm`` in m."""
    return 1.0 / sum(1.0 / inertia for inertia in inertias) / arm**2


def slide_loss(clutch: Clutch, force: float, face: SlidingFace) -> float:
    """Estimate the share of the axial power that dissipation takes from the reference slide.

    Parameters
    ----------
    clutch : with the mean dissipation of its shifts, in which the loss is linear.
    force : shift force, N.
    face : of ``sliding_faces``.
    """
    dog = clutch.dog
    contact = clutch.contact
    slope = face.slope
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    arm = dog.mean_radius * math.tan(slope)
    overlap = np.linspace(*AVERAGED_SHARES, SAMPLES + 1) * face.width
    way = (overlap - START_SHARE * face.width) * math.tan(slope)
    ring_mass = _turning_mass((shaft.ring_inertia for shaft in clutch.shafts), arm)
    duration = math.sqrt(2.0 * float(way[-1]) * (mass + ring_mass) / force)
    turning = _turning_mass((inertia_moved(shaft, duration) for shaft in clutch.shafts), arm)
    speed = np.sqrt(2.0 * force * way / (mass + turning)) / math.sin(slope)
    length = overlap / math.cos(slope)
    wedge = np.abs(overlap - face.parallel_overlap) / dog.mean_radius * math.sin(slope)
    count = clutch.pair.touching_count
    load = force * turning / (mass + turning) / (count * math.cos(slope))
    depth = wedge_depth(load, contact.stiffness * length, wedge, dog.radial_width)
    plough = contact.dissipation * speed * math.sin(face.ridge_turn)
    share = plough * depth / (length * math.sin(2.0 * slope))
    return float(np.trapezoid(share, way) / (way[-1] - way[0]))


def stiffness_for_loss(clutch: Clutch, force: float, face: SlidingFace, loss: float) -> float:
    """Find the least stiffness at which the reference slide loses at most a share, Pa/m.

    NaN where the stiffest contact loses more. Arguments as for ``slide_loss``.
    """

    def loses_more(exponent: float) -> bool:
        contact = replace(clutch.contact, stiffness=10.0**exponent)
        return slide_loss(replace(clutch, contact=contact), force, face) > loss

    stiffness_range = quantities_of(ContactSet)["stiffness"]
    softest = math.log10(stiffness_range.low)
    stiffest = math.log10(stiffness_range.high)
    if loses_more(stiffest):
        return math.nan
    return 10.0 ** bisect(loses_more, softest, stiffest, width=1e-3)[1]
