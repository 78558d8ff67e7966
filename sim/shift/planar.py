"""The compiled engine: the same faces, pressure and friction as the Drake plant, in closed form.

``Solver.accuracy`` is the error of a speed that a step may have, m/s, and ``PLACE_ERROR`` times it
that of a place. The friction law is that of Drake's scheme: with the dynamic coefficient alone, or
one that falls from the static to the dynamic one where the scheme is ``cenic``. A contact set with
IMPACT has its own laws, whatever the scheme.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import LATEST_RELEASE, Run, failure_of, states_held
from dogshape.sim.shift.drive import TorqueCourse
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import (
    rigid_dog,
    stacked,
    tip_planes,
    touching_planes,
    touching_quads,
)

Surfaces = tuple[Array, Array, Array, Array, float, float, float, Mask]
PLACE_ERROR = 1e-4  #: s, error of a place over that of a speed
FIRST_STEP = 1e-5  #: s, first step
RECORD_SIZE = 4096  #: steps that are recorded at once
#: A motion without contact: error of a speed in m/s and of a place in m, longest step, s, steps.
FREE_ERROR, FREE_STEP, FREE_SIZE = np.array([1e-5, 1e-9]), 5e-3, 4000
#: Surfaces and law of dogs that never touch.
NO_DOGS = (
    *(np.zeros((1, 4, 3)), np.zeros((1, 3)), np.zeros(1), np.zeros(2)),
    *(1.0, 1e9, 1e9, np.zeros(1, dtype=bool)),
)
NO_LAW = np.zeros(5)
NO_LOOK = np.zeros(0)  #: no state before: a ring that stands still is simulated on


@lru_cache(maxsize=4)  # draws of what is uncertain have one dog
def surfaces_of(dog: Dog) -> Surfaces:
    """Compute the surfaces of a dog and its planes, as ``sim.kernel.contact`` takes them.

    Corners of the rigid surfaces, m, (p, 4, 3); outward normals, (p, 3); offsets of the compliant
    dog's planes, m, (p,); least turn by the lean of a traction and a braking flank over the
    distance, rad/m, and by half of the backlash, rad, (3,); pitch, rad; gap and travel, m; whether
    a plane is a face of the tip, (p,).
    """
    normals, offsets = stacked(touching_planes(dog))
    corners = rigid_dog(dog).vertices[np.array(touching_quads(dog))]
    lean = np.tan([dog.traction, dog.braking])
    lean /= np.where(lean < 0.0, dog.inner_radius, dog.outer_radius)
    least = np.append(lean, 0.5 * dog.backlash_angle)
    ends = dog.pitch_angle, dog.axial_gap, dog.travel
    return corners, normals, offsets, least, *ends, tip_planes(dog)


@dataclass(frozen=True)
class PlanarClutch:
    """A clutch for the compiled engine, to be shifted again and again."""

    clutch: Clutch

    @cached_property
    def surfaces(self) -> Surfaces:
        """Surfaces of the dog, as ``surfaces_of`` has them."""
        return surfaces_of(self.clutch.dog)

    @cached_property
    def law(self) -> Array:
        """Law of the contact, (5,): stiffness, dissipation, dynamic friction, stiction, static.

        With a friction of faces, (6,), that too. Or of IMPACT, (7,): stiffness, damping, the same
        three, depth, transition velocity. As in the Drake plant static friction counts where the
        contact set needs ``cenic``.
        """
        contact = self.clutch.contact
        dynamic = contact.dynamic_friction
        static = contact.static_friction if self.clutch.solver.scheme == "cenic" else dynamic
        law = [contact.stiffness, contact.dissipation, dynamic, contact.stiction_velocity, static]
        if (own := contact.impact) is not None:
            law[0], law[1], law[4] = own.stiffness, own.damping, contact.static_friction
            law += [own.depth, own.transition_velocity]
        elif contact.face_friction is not None:
            law.append(contact.face_friction)
        return np.array(law)

    def run(self, point: OperatingPoint, angle: float) -> Run:
        """Integrate from where friction lets the ring go to the end of travel or the time-out."""
        clutch, solver = self.clutch, self.clutch.solver
        tolerance = np.array([solver.accuracy, PLACE_ERROR * solver.accuracy])
        held, begun = states_held(clutch, point, angle)
        now, state, step, spent = float(held[-1]), begun[-1].copy(), FIRST_STEP, 0
        count, why, failure = len(held), kernel.FULL, ""
        parts, mode, before = [(held, begun)], np.zeros(2), np.full(kernel.SIZE, math.nan)
        deadline = time.monotonic() + solver.time_limit
        numbers, pause, look = clutch.numbers, clutch.timeout, before
        course = TorqueCourse(clutch.drive, clutch.timeout) if clutch.drive.has_torques else None
        if course is not None:
            numbers, pause = numbers.copy(), now
        while not failure and why in (kernel.FULL, kernel.PAUSED) and now < clutch.timeout:
            if course is not None and now >= pause:
                pause = self._drive(course, now, state, numbers)
                look = before if course.settled(now) else NO_LOOK
                if look is NO_LOOK:
                    before[:] = math.nan
            size = max(0, min(RECORD_SIZE, solver.max_steps + 1 - count))
            times, states = np.empty(size), np.empty((size, kernel.SIZE))
            why, now, step, made, tried = kernel.advance(
                now, step, state, look, pause, clutch.timeout, numbers, point.profile.knots,
                self.surfaces, self.law, tolerance, solver.max_step, mode, times, states,
            )  # fmt: skip
            parts.append((times[:made], states[:made]))
            count, spent = count + made, spent + tried
            if why == kernel.LOST:
                state[:] = math.nan
            failure = failure_of(clutch, now, state, count, deadline)
        whole, there = (np.concatenate(one) for one in zip(*parts, strict=True))
        torques = None if course is None else course.knots
        return Run(whole, there, why == kernel.HELD, failure, spent, torques)

    def _drive(self, course: TorqueCourse, now: float, state: Array, numbers: Array) -> float:
        """Write the torques from ``now`` on into ``numbers``, and return the end of them, s."""
        near, far = self.clutch.shafts
        sliding = state[9] if near.side_inertia else state[5]
        output = state[11] if far.side_inertia else state[3]
        piece = course.piece(now, float(output - sliding))
        numbers[kernel.TORQUE_START] = piece.start
        numbers[kernel.SLIDING_TORQUE], numbers[kernel.OUTPUT_TORQUE] = piece.torques
        numbers[kernel.SLIDING_SLOPE], numbers[kernel.OUTPUT_SLOPE] = piece.slopes
        return piece.end


def free_flight(clutch: Clutch, profile: ForceProfile, way: float) -> tuple[Array, Array, float]:
    """Integrate the motion of the ring over a way in m without dogs, to the time-out at most.

    Times in s, (n,), states, (n, 12), and the time for which friction holds the ring, s: 0 where
    it never lets go.
    """
    held, begun = states_held(clutch, OperatingPoint(0.0, profile), 0.0)
    rest, numbers = float(held[-1]), clutch.numbers.copy()
    if rest >= LATEST_RELEASE * clutch.timeout:
        return held, begun, 0.0
    numbers[kernel.WAY], numbers[kernel.REBOUND] = 1.02 * way, 1e9
    times, states = np.empty(FREE_SIZE), np.empty((FREE_SIZE, kernel.SIZE))
    *_, made, _ = kernel.advance(
        rest, FIRST_STEP, begun[-1].copy(), NO_LOOK, clutch.timeout, clutch.timeout, numbers,
        profile.knots, NO_DOGS, NO_LAW, FREE_ERROR, FREE_STEP, np.zeros(2), times, states,
    )  # fmt: skip
    return np.append(held, times[:made]), np.concatenate([begun, states[:made]]), rest


@lru_cache(maxsize=512)  # operating points share forces
def touch_time(clutch: Clutch, profile: ForceProfile) -> float:
    """Compute the time until the axial gap is closed, s; the time-out where it stays open."""
    times, states, _ = free_flight(clutch, profile, gap := clutch.dog.axial_gap)
    found = kernel.crossing(times, states[:, 1], states[:, 4], gap)
    return clutch.timeout if math.isnan(found) else float(found)
