"""Compiled engine: faces, pressure and friction of the Drake plant in closed form.

``Solver.accuracy`` is the permitted error of a speed in one step, m/s; that of a position is
``POSITION_ERROR_S`` times as large. The friction law is that of Drake's scheme: the dynamic
coefficient alone or, where the scheme is ``cenic``, a coefficient that falls from the static to the
dynamic one. A contact set with IMPACT has its own laws in every scheme.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array
from dogshape.sim.kernel_layout import (
    ACTUATOR_NUMBERS,
    AXIAL_SPEED,
    CONTACT_LAW,
    DISPLACEMENT,
    INPUT_SIDE_SPEED,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SLIDING_SPEED,
    STATE_SIZE,
    STEP_MODE,
    StepLimits,
    Surfaces,
    empty_record,
    filled_record,
    shift_model,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import COMMAND_RISE_S, Actuator
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import LATEST_RELEASE_SHARE, Run, failure_of, states_held
from dogshape.sim.shift.drive import TorqueCourse
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import (
    rigid_dog,
    stacked,
    tip_planes,
    touching_planes,
    touching_quads,
)
from dogshape.sim.shift.pair import Pair

POSITION_ERROR_S = 1e-4  #: permitted error of a position over that of a speed
FIRST_STEP = 1e-5  #: s
RECORD_SIZE = 4096  #: steps of one call of the kernel
#: Limits of a motion without contact.
FREE_LIMITS = StepLimits(speed_error=1e-5, place_error=1e-9, max_step=5e-3)
FREE_RECORD_SIZE = 4000  #: steps of a motion without contact, at most
FREE_TRAVEL_SHARE = 1.02  #: end of a motion without contact, over the wanted displacement
FREE_REBOUND_M = 1e9  #: distance of the stop in a motion without contact
#: Surfaces and law of dogs that never touch.
NO_DOGS = Surfaces(
    corners=np.zeros((1, 4, 3)),
    rigid_normals=np.zeros((1, 3)),
    normals=np.zeros((1, 3)),
    offsets=np.zeros(1),
    traction_lean=0.0,
    braking_lean=0.0,
    half_backlash=0.0,
    pitch_angle=1.0,
    axial_gap=1e9,
    travel=1e9,
    is_rigid_face=np.zeros(1, dtype=bool),
    is_face=np.zeros(1, dtype=bool),
    low_gap=math.inf,
)
#: Decimals of a surface, m. The last digits differ between processors; a shift that is balanced
#: between two slots would end in another slot.
SURFACE_DIGITS = 11
NO_LAW = empty_record(CONTACT_LAW)
#: ``look_state`` of a motion that is simulated on where the rings stand still.
NO_LOOK = np.zeros(0)


@lru_cache(maxsize=4)  # draws of the uncertain quantities share a pair
def surfaces_of(pair: Pair) -> Surfaces:
    """Compute the surfaces of the rigid dog of a pair and the planes of the compliant one."""
    dog = pair.compliant
    rigid = pair.rigid
    normals, offsets = stacked(touching_planes(dog))
    rigid_normals, _ = stacked(touching_planes(rigid))
    corners = _corners(rigid)
    if pair.low is not None:
        low_rigid = pair.low if pair.is_sparse_rigid else rigid
        low_compliant = dog if pair.is_sparse_rigid else pair.low
        _, low_offsets = stacked(touching_planes(low_compliant))
        corners = np.concatenate([corners, _corners(low_rigid)])
        offsets = np.concatenate([offsets, low_offsets])
    tangents = np.array([math.tan(dog.traction), math.tan(dog.braking)])
    # The radius at which the lean of a flank turns the ring least.
    radii = np.where(tangents < 0.0, dog.inner_radius, dog.outer_radius)
    traction_lean, braking_lean = (tangents / radii).tolist()
    return Surfaces(
        corners=corners.round(SURFACE_DIGITS),
        rigid_normals=rigid_normals.round(SURFACE_DIGITS),
        normals=normals.round(SURFACE_DIGITS),
        offsets=offsets.round(SURFACE_DIGITS),
        traction_lean=traction_lean,
        braking_lean=braking_lean,
        half_backlash=float(0.5 * pair.backlash_angle),
        pitch_angle=float(dog.pitch_angle),
        axial_gap=float(dog.axial_gap),
        travel=float(pair.travel),
        is_rigid_face=tip_planes(rigid),
        is_face=tip_planes(dog),
        low_gap=math.inf if pair.low is None else float(dog.axial_gap + pair.shortening),
    )


def _corners(rigid: Dog) -> Array:
    """Compute the corners of a rigid dog's surfaces, m, (q, 4, 3)."""
    return rigid_dog(rigid).vertices[np.array(touching_quads(rigid))]


@dataclass(frozen=True)
class PlanarClutch:
    """A clutch in the compiled engine; its surfaces and law are computed once for all shifts."""

    clutch: Clutch

    @cached_property
    def surfaces(self) -> Surfaces:
        """Surfaces of both dogs."""
        return surfaces_of(self.clutch.pair)

    @cached_property
    def law(self) -> np.record:
        """Law of the contact, a record of ``sim.kernel_layout``.

        Static friction counts with IMPACT, and in the scheme ``cenic`` as in the Drake plant.
        """
        contact = self.clutch.contact
        impact = contact.impact
        has_static = impact is not None or self.clutch.solver.scheme == "cenic"
        static_friction = contact.static_friction if has_static else contact.dynamic_friction
        law = {
            "stiffness": contact.stiffness,
            "damping": contact.dissipation,
            "dynamic_friction": contact.dynamic_friction,
            "stiction_velocity": contact.stiction_velocity,
            "static_friction": static_friction,
            "has_face_friction": contact.face_friction is not None,
            "face_friction": contact.face_dynamic_friction,
        }
        if impact is not None:
            law |= {
                "is_impact": True,
                "stiffness": impact.stiffness,
                "damping": impact.damping,
                "damping_depth": impact.depth,
                "transition_velocity": impact.transition_velocity,
            }
        return filled_record(CONTACT_LAW, law)

    def run(self, point: OperatingPoint, angle: float) -> Run:
        """Integrate from the release by friction to the end of travel or the time-out."""
        clutch = self.clutch
        solver = clutch.solver
        limits = StepLimits(
            speed_error=float(solver.accuracy),
            place_error=float(POSITION_ERROR_S * solver.accuracy),
            max_step=float(solver.max_step),
        )
        held_times, held_states = states_held(clutch, point, angle)
        records = [(held_times, held_states)]
        shift_time = float(held_times[-1])
        state = held_states[-1].copy()
        step = FIRST_STEP
        step_count = len(held_times)
        evaluations = 0
        reason = kernel.FULL
        failure = ""
        mode = np.zeros(1, STEP_MODE)
        last_look = np.full(STATE_SIZE, math.nan)  # the kernel writes into it
        look_state = last_look
        numbers = clutch.shift_numbers(point.profile)
        model = shift_model(numbers, point.profile.knots, self.surfaces, self.law)
        pause = clutch.timeout
        course = None  # torques of the drive, in pieces of constant slope
        if clutch.drive.has_torques:
            course = TorqueCourse(clutch.drive, clutch.timeout)
            pause = shift_time
        deadline = time.monotonic() + solver.time_limit
        while (
            not failure and reason in (kernel.FULL, kernel.PAUSED) and shift_time < clutch.timeout
        ):
            if course is not None and shift_time >= pause:
                pause = self._set_torques(course, shift_time, state, model.numbers[0])
                look_state = last_look
                if not course.settled(shift_time):  # torques may still move rings that stand still
                    look_state = NO_LOOK
                    last_look[:] = math.nan
            size = max(0, min(RECORD_SIZE, solver.max_steps + 1 - step_count))
            times = np.empty(size)
            states = np.empty((size, STATE_SIZE))
            progress = kernel.advance(
                shift_time,
                step,
                state,
                look_state=look_state,
                pause=pause,
                timeout=clutch.timeout,
                model=model,
                limits=limits,
                mode=mode,
                times=times,
                states=states,
            )
            reason = progress.reason
            shift_time = progress.time
            step = progress.step
            records.append((times[: progress.recorded], states[: progress.recorded]))
            step_count += progress.recorded
            evaluations += progress.evaluations
            if reason == kernel.UNDERFLOW:
                state[:] = math.nan  # ``failure_of`` reports a motion that is not finite
            failure = failure_of(clutch, shift_time, state, step_count, deadline)
        times, states = (np.concatenate(parts) for parts in zip(*records, strict=True))
        torques = None if course is None else course.knots
        return Run(
            times,
            states,
            blocked=reason == kernel.HELD,
            failure=failure,
            evaluations=evaluations,
            torques=torques,
        )

    def _set_torques(
        self, course: TorqueCourse, shift_time: float, state: Array, numbers: np.record
    ) -> float:
        """Write the torques from ``shift_time`` to the end of their piece; return the end, s."""
        input_shaft, output_shaft = self.clutch.shafts
        input_field = INPUT_SIDE_SPEED if input_shaft.side_inertia else SLIDING_SPEED
        output_field = OUTPUT_SIDE_SPEED if output_shaft.side_inertia else OUTPUT_SPEED
        piece = course.piece(shift_time, float(state[output_field] - state[input_field]))
        # By key: an attribute of a record takes microseconds, and a control has many pieces.
        numbers["torque_start"] = piece.start
        numbers["sliding_torque"], numbers["output_torque"] = piece.torques
        numbers["sliding_torque_rate"], numbers["output_torque_rate"] = piece.slopes
        return piece.end


def free_flight(
    clutch: Clutch, profile: ForceProfile, displacement: float
) -> tuple[Array, Array, float]:
    """Integrate the motion of the ring without dogs over a displacement, m, or to the time-out.

    Returns
    -------
    tuple
        Times, s, (n,), states, (n, 14), and the time at which friction releases the ring, s: 0
        where it holds the ring to the time-out.
    """
    held_times, held_states = states_held(clutch, OperatingPoint(0.0, profile), 0.0)
    release_time = float(held_times[-1])
    if release_time >= LATEST_RELEASE_SHARE * clutch.timeout:
        return held_times, held_states, 0.0
    numbers = clutch.shift_numbers(profile).copy()
    numbers.shift_travel = FREE_TRAVEL_SHARE * displacement
    numbers.rebound = FREE_REBOUND_M
    times = np.empty(FREE_RECORD_SIZE)
    states = np.empty((FREE_RECORD_SIZE, STATE_SIZE))
    progress = kernel.advance(
        release_time,
        FIRST_STEP,
        held_states[-1].copy(),
        look_state=NO_LOOK,
        pause=clutch.timeout,
        timeout=clutch.timeout,
        model=shift_model(numbers, profile.knots, NO_DOGS, NO_LAW),
        limits=FREE_LIMITS,
        mode=np.zeros(1, STEP_MODE),
        times=times,
        states=states,
    )
    times = np.append(held_times, times[: progress.recorded])
    states = np.concatenate([held_states, states[: progress.recorded]])
    return times, states, release_time


@lru_cache(maxsize=512)  # operating points share forces
def channel_course(actuator: Actuator, force: float, end: float) -> tuple[Array, Array, Array]:
    """Compute the logged channel of an actuator whose fork stands, up to ``end`` in s.

    Returns
    -------
    tuple
        Times, s, values and their rates, SI, (n,) each; empty for an actuator without a channel.
    """
    if not actuator.logged_key:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    from scipy.integrate import solve_ivp  # noqa: PLC0415  slow to load, and few shifts need it

    numbers = empty_record(ACTUATOR_NUMBERS)
    actuator.write(numbers, ForceProfile(force, COMMAND_RISE_S), driven_mass=1.0)

    def rates(time: float, level: Array) -> list[float]:
        _, level_rate = kernel.actuator_rates(time, 0.0, 0.0, 0.0, float(level[0]), numbers)
        return [float(level_rate)]

    start = [actuator.initial_level(force)]
    course = solve_ivp(rates, (0.0, end), start, method="LSODA", rtol=1e-6, atol=1e-9)
    levels = course.y[0]
    level_rates = np.array([rates(0.0, levels[k : k + 1])[0] for k in range(levels.size)])
    values = actuator.channel(levels, force)
    # The channel is linear in the level.
    rate_values = actuator.channel(level_rates, force) - actuator.channel(0.0 * level_rates, force)
    return course.t, values, rate_values


@lru_cache(maxsize=4096)  # operating points share forces; a diagnosis has hundreds of levels
def touch_time(clutch: Clutch, profile: ForceProfile) -> float:
    """Compute the time until the axial gap is closed, s; the time-out if it stays open."""
    gap = clutch.dog.axial_gap
    times, states, _ = free_flight(clutch, profile, gap)
    gap_time = kernel.crossing(times, states[:, DISPLACEMENT], states[:, AXIAL_SPEED], gap)
    return clutch.timeout if math.isnan(gap_time) else float(gap_time)
