"""A clutch as the numbers that the compiled engine wants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.planar import kernel
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import DEEP, DEEP_TWIST, SLIP, TURN, Mechanism
from dogshape.sim.shift.mesh import rigid_dog, touching_quads
from dogshape.sim.shift.planes import touching_planes

Floats = NDArray[np.float64]
Surfaces = tuple[Floats, Floats, Floats, Floats, float, float, float]


@dataclass(frozen=True)
class PlanarClutch:
    """A clutch prepared for the compiled engine, to be shifted again and again.

    Parameters
    ----------
    clutch : what is simulated.
    surfaces : corners of the rigid surfaces, m, (p, 4, 3); outward normals, (p, 3); offsets of the
        compliant dog's planes, m, (p,); lean of a traction and a braking flank, rad/m, (2,);
        pitch, rad; gap and travel, m.
    numbers : masses, mechanism and stop, in the places of ``sim.planar.kernel``.
    law : of the contact, (5,).
    """

    clutch: Clutch
    surfaces: Surfaces
    numbers: Floats
    law: Floats


def planar_clutch(clutch: Clutch) -> PlanarClutch:
    """Prepare a clutch."""
    return PlanarClutch(clutch, surfaces_of(clutch.dog), numbers_of(clutch), law_of(clutch))


def surfaces_of(dog: Dog) -> Surfaces:
    """Describe where dogs touch (``PlanarClutch.surfaces``)."""
    vertices, planes = rigid_dog(dog).vertices, touching_planes(dog)
    corners = np.array([vertices[list(quad)] for quad in touching_quads(dog)])
    normals = np.array([plane.normal for plane in planes])
    offsets = np.array([plane.offset for plane in planes])
    lean = np.tan([dog.traction, dog.braking]) / dog.outer_radius
    return corners, normals, offsets, lean, dog.pitch_angle, dog.axial_gap, dog.travel


def law_of(clutch: Clutch) -> Floats:
    """Give the contact's law: stiffness, dissipation, dynamic friction, stiction velocity, static.

    As in the Drake plant static friction counts where the contact set needs ``cenic``.
    """
    contact = clutch.contact
    falls = clutch.solver.scheme == "cenic"
    static = contact.static_friction if falls else contact.dynamic_friction
    return np.array(
        [
            contact.stiffness,
            contact.dissipation,
            contact.dynamic_friction,
            contact.stiction_velocity,
            static,
        ]
    )


def state_size(mechanism: Mechanism) -> int:
    """Count the numbers of a state that a mechanism moves, of ``kernel.SIZE``."""
    if mechanism.has_shafts:
        return kernel.SIZE
    return kernel.LINKED_SIZE if mechanism.has_linkage else kernel.PLAIN_SIZE


def numbers_of(clutch: Clutch) -> Floats:
    """Fill the numbers of a clutch, in the places of ``sim.planar.kernel``, (NUMBERS,)."""
    dog, rings, mechanism = clutch.dog, clutch.rings, clutch.mechanism
    stiff, loss = mechanism.linkage(rings.mass) if mechanism.has_linkage else (0.0, 0.0)
    share = mechanism.spline_share(rings.mass, dog.mean_radius, rings.sliding_inertia)
    near, far = (
        mechanism.input_side(rings.sliding_inertia),
        mechanism.output_side(rings.output_inertia),
    )
    numbers = np.zeros(kernel.NUMBERS)
    for place, value in {
        kernel.SLEEVE: mechanism.sleeve_mass(rings.mass),
        kernel.FAR: mechanism.actuator_mass(rings.mass) or 1.0,
        kernel.SLIDING: rings.sliding_inertia if near is None else near.near,
        kernel.OUTPUT: rings.output_inertia if far is None else far.near,
        kernel.DAMPING: mechanism.damping,
        kernel.FRICTION: mechanism.friction,
        kernel.DETENT: mechanism.detent,
        kernel.DETENT_AT: mechanism.detent_position,
        kernel.DETENT_WIDTH: mechanism.detent_width,
        kernel.SPLINE: share * mechanism.spline_friction / mechanism.spline_radius,
        kernel.DRAG: mechanism.drag_torque,
        kernel.STIFF: stiff,
        kernel.LOSS: loss,
        kernel.PLAY: mechanism.free_play,
        kernel.DOGS: dog.count,
        kernel.REBOUND: clutch.rebound,
        kernel.STOP: clutch.contact.stiffness * dog.count * dog.tip_width * dog.radial_width,
        kernel.RADIUS: dog.mean_radius,
        kernel.WAY: clutch.shift_travel,
        kernel.SLIP_SPEED: SLIP,
        kernel.TURN_SPEED: TURN,
        kernel.DEEP_STOP: DEEP,
        kernel.LINKED: mechanism.has_linkage,
        kernel.USED: state_size(mechanism),
        kernel.TWIST: DEEP_TWIST,
        **(
            {}
            if near is None
            else {
                kernel.BEHIND: near.far,
                kernel.SHAFT: near.stiffness,
                kernel.SHAFT_LOSS: near.damping,
                kernel.BACKLASH: near.backlash,
            }
        ),
        **(
            {}
            if far is None
            else {
                kernel.AHEAD: far.far,
                kernel.OUT_SHAFT: far.stiffness,
                kernel.OUT_LOSS: far.damping,
            }
        ),
    }.items():
        numbers[place] = value
    return numbers
