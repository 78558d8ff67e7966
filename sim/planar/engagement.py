"""One engagement by the compiled engine: the problem and the result are those of Drake's.

``Solver.accuracy`` is the error of a speed that a step may have, m/s, and ``PLACE_ERROR`` times it
that of a place. The friction law is that of Drake's scheme: with the dynamic coefficient alone, or
one that falls from the static to the dynamic one where the scheme is ``cenic``. A contact set with
IMPACT has its own laws, whatever the scheme.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.planar import kernel
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Run, engaged, failure_of, states_held
from dogshape.sim.shift.events import STILL_WINDOW, stands_still
from dogshape.sim.shift.mechanism import DEEP, DEEP_TWIST, SLIP, TURN, Shaft
from dogshape.sim.shift.mesh import rigid_dog, touching_planes, touching_quads

Floats = NDArray[np.float64]
Surfaces = tuple[Floats, Floats, Floats, Floats, float, float, float]


@dataclass(frozen=True)
class PlanarClutch:
    """A clutch prepared for the compiled engine, to be shifted again and again.

    Parameters
    ----------
    clutch : what is simulated.
    surfaces : corners of the rigid surfaces, m, (p, 4, 3); outward normals, (p, 3); offsets of the
        compliant dog's planes, m, (p,); least turn by the lean of a traction and a braking flank
        over the distance, rad/m, and by half of the backlash, rad, (3,); pitch, rad; gap and
        travel, m.
    numbers : masses, mechanism and stop, in the places of ``sim.planar.kernel``.
    law : of the contact, (5,): stiffness, dissipation, dynamic friction, stiction velocity, static;
        or of IMPACT, (7,): stiffness, damping, the same three, depth, transition velocity.
    """

    clutch: Clutch
    surfaces: Surfaces
    numbers: Floats
    law: Floats


def planar_clutch(clutch: Clutch) -> PlanarClutch:
    """Prepare a clutch.

    As in the Drake plant static friction counts where the contact set needs ``cenic``.
    """
    dog, contact = clutch.dog, clutch.contact
    vertices, planes = rigid_dog(dog).vertices, touching_planes(dog)
    corners = np.array([vertices[list(quad)] for quad in touching_quads(dog)])
    normals = np.array([plane.normal for plane in planes])
    offsets = np.array([plane.offset for plane in planes])
    lean = np.tan([dog.traction, dog.braking])
    lean /= np.where(lean < 0.0, dog.inner_radius, dog.outer_radius)
    least = np.append(lean, 0.5 * dog.backlash_angle)
    surfaces = corners, normals, offsets, least, dog.pitch_angle, dog.axial_gap, dog.travel
    dynamic = contact.dynamic_friction
    static = contact.static_friction if clutch.solver.scheme == "cenic" else dynamic
    law = [contact.stiffness, contact.dissipation, dynamic, contact.stiction_velocity, static]
    if (own := contact.impact) is not None:
        law[0], law[1], law[4] = own.stiffness, own.damping, contact.static_friction
        law += [own.depth, own.transition_velocity]
    return PlanarClutch(clutch, surfaces, numbers_of(clutch), np.array(law))


def numbers_of(clutch: Clutch) -> Floats:
    """Fill the numbers of a clutch, in the places of ``sim.planar.kernel``, (NUMBERS,)."""
    dog, rings, own = clutch.dog, clutch.rings, clutch.mechanism
    wholes = zip(clutch.shafts, (rings.sliding_inertia, rings.output_inertia), strict=True)
    near, far = (shaft or Shaft(whole, 0.0, 0.0, 0.0) for shaft, whole in wholes)
    stiff, loss = own.linkage(rings.mass) if own.has_linkage else (0.0, 0.0)
    share = own.spline_share(rings.mass, dog.mean_radius, rings.sliding_inertia)
    used = kernel.LINKED_SIZE if own.has_linkage else kernel.PLAIN_SIZE
    stop = clutch.contact.stiffness * dog.count * dog.tip_width * dog.radial_width
    places: dict[int, float] = {
        kernel.SLEEVE: own.sleeve_mass(rings.mass), kernel.SLIDING: near.near,
        kernel.FAR: own.actuator_mass(rings.mass) or 1.0, kernel.OUTPUT: far.near,
        kernel.DAMPING: own.damping, kernel.FRICTION: own.friction, kernel.DETENT: own.detent,
        kernel.DETENT_AT: own.detent_position, kernel.DETENT_WIDTH: own.detent_width,
        kernel.SPLINE: share * own.spline_friction / own.spline_radius,
        kernel.DRAG: own.drag_torque, kernel.STIFF: stiff, kernel.LOSS: loss,
        kernel.PLAY: own.free_play, kernel.DOGS: dog.count, kernel.REBOUND: clutch.rebound,
        kernel.STOP: stop, kernel.RADIUS: dog.mean_radius,
        kernel.WAY: clutch.shift_travel, kernel.SLIP_SPEED: SLIP, kernel.TURN_SPEED: TURN,
        kernel.DEEP_STOP: DEEP, kernel.TWIST: DEEP_TWIST, kernel.LINKED: own.has_linkage,
        kernel.USED: kernel.SIZE if own.has_shafts else used,
        kernel.BEHIND: near.far, kernel.SHAFT: near.stiffness, kernel.SHAFT_LOSS: near.damping,
        kernel.BACKLASH: near.backlash, kernel.AHEAD: far.far, kernel.OUT_SHAFT: far.stiffness,
        kernel.OUT_LOSS: far.damping,
        kernel.DETENT_SEAT: own.detent_seat or math.inf,
    }  # fmt: skip
    numbers = np.zeros(kernel.NUMBERS)
    numbers[list(places)] = list(places.values())
    return numbers


PLACE_ERROR = 1e-4  #: s, error of a place over that of a speed
FIRST_STEP = 1e-5  #: s, first step
RECORD_SIZE = 4096  #: steps that are recorded at once


def engage(plant: PlanarClutch, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift; arguments and result as for ``sim.shift.engagement.engage``."""
    first = _run(plant, point, relative_angle)
    return engaged(
        plant.clutch, point, relative_angle, first,
        lambda finer: _run(planar_clutch(finer), point, relative_angle),
    )  # fmt: skip


def _run(plant: PlanarClutch, point: OperatingPoint, angle: float) -> Run:
    """Integrate from where friction lets the ring go to the end of the travel or the time-out."""
    clutch, solver = plant.clutch, plant.clutch.solver
    tolerance = np.array([solver.accuracy, PLACE_ERROR * solver.accuracy])
    knots = np.array(point.profile.knots())
    times, states = states_held(clutch, point, angle)
    now, state, step, spent = float(times[-1]), states[-1].copy(), FIRST_STEP, 0
    count, last, blocked, failure = len(times), None, False, ""
    parts, mode = [(times, states)], np.zeros(2)
    deadline = time.monotonic() + solver.time_limit
    while now < clutch.timeout and not (blocked or failure):
        until = min(STILL_WINDOW * (math.floor(now / STILL_WINDOW + 1e-9) + 1), clutch.timeout)
        room, places = np.empty(RECORD_SIZE), np.empty((RECORD_SIZE, kernel.SIZE))
        why, now, step, made, tried = kernel.advance(
            now, step, state, until, plant.numbers, knots, plant.surfaces, plant.law, tolerance,
            solver.max_step, mode, room, places,
        )  # fmt: skip
        parts.append((room[:made], places[:made]))
        count, spent = count + made, spent + tried
        if why == kernel.LOST:
            state[:] = math.nan
        failure = failure_of(clutch, now, state, count, deadline)
        if why == kernel.ENGAGED:
            break
        if why == kernel.PAUSED:
            blocked = not failure and stands_still(clutch, point, now, last, state)
            last = state.copy()
    whole, there = (np.concatenate(one) for one in zip(*parts, strict=True))
    return Run(whole, there, blocked, failure, spent)
