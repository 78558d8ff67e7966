"""One shift whose force and torques come from outside, step by step, by the compiled engine.

A driveline model holds the force and the torques on both sides over a communication step, and
reads motion and contact at its end. Equations, contact and integration are those of
``sim.shift.planar``; the torques of a step are one piece of ``sim.shift.drive``. Synchroniser and
pack of the clutch's drive act, torques over time and speed control come from outside.

Speeds, angles and torques count positive in the sense in which the engine turns
(``sim.shift.drive``), the relative angle as that of a shift.

A clutch with an actuator has its command in place of the force
(``sim.shift.commanded_actuator``).

At full travel a latch takes the sliding ring: a mass of ``LATCH_MASS_KG`` along the shaft in place
of mechanism and shift force, which an actuator no longer moves, while the flanks go on to carry the
torque.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.errors import EngineError, InputError, Refusal
from dogshape.sim.kernel_layout import (
    AXIAL_SPEED,
    DISPLACEMENT,
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    KNOT_FORCE,
    KNOT_SLOPE,
    KNOT_TIME,
    OUTPUT_ANGLE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    RIGID_STATE_SIZE,
    SHAFTED_STATE_SIZE,
    SLIDING_ANGLE,
    SLIDING_SPEED,
    STATE_SIZE,
    STEP_MODE,
    ShiftModel,
    StepLimits,
    shift_model,
)
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.commanded_actuator import (
    DIRECT,
    NO_COMMAND,
    ActuatorReading,
    CommandCourse,
    CommandedActuator,
    SavedCommand,
)
from dogshape.sim.shift.conclusion import (
    STEP_REFINEMENT,
    failure_of,
    passing_through,
    require_stiff_enough,
    section_planes,
)
from dogshape.sim.shift.planar import FIRST_STEP, POSITION_ERROR_S, RECORD_SIZE, PlanarClutch

LATCH_MASS_KG = 1e9  #: that holds an engaged ring: 1 kN moves it by 5e-7 m in one second


class TurningColumns(NamedTuple):
    """Columns of a state that turn."""

    sliding_angle: int
    output_angle: int
    sliding_speed: int
    output_speed: int


#: Columns of the rings, and of the sides behind their shafts.
RING_COLUMNS = TurningColumns(SLIDING_ANGLE, OUTPUT_ANGLE, SLIDING_SPEED, OUTPUT_SPEED)
SIDE_COLUMNS = TurningColumns(
    INPUT_SIDE_ANGLE, OUTPUT_SIDE_ANGLE, INPUT_SIDE_SPEED, OUTPUT_SIDE_SPEED
)


class StepPhase(IntEnum):
    """Phase of a shift (``sim.shift.trace``) as far as it is known at a time."""

    FREE_FLY = 0
    FACE_CONTACT = 1
    ENTRY = 2
    SEATING = 3
    ENGAGED = 4


class ShiftStart(NamedTuple):
    """Motion at the start of a shift."""

    sliding_speed: float  #: rad/s, in the engine's sense
    output_speed: float  #: rad/s, in the engine's sense
    relative_angle: float  #: lead of the output ring over dogs facing dogs, rad


class StepLoads(NamedTuple):
    """Loads from outside over a communication step."""

    force: float  #: shift force, N
    sliding_torque: float  #: on the sliding side, N m, in the engine's sense
    output_torque: float  #: on the output side, N m, in the engine's sense
    command_force: float = 0.0  #: static force of the actuator's command, N; 0 is off


class StepMotion(NamedTuple):
    """Motion and contact at the end of a communication step, in the engine's sense.

    A side is the inertia behind the shaft of its ring, or the ring on a rigid shaft.
    """

    travel: float  #: of the sliding ring, m
    axial_speed: float  #: of the sliding ring, m/s
    sliding_angle: float  #: of the sliding ring, rad
    output_angle: float  #: of the output ring, rad
    sliding_speed: float  #: of the sliding ring, rad/s
    output_speed: float  #: of the output ring, rad/s
    sliding_side_angle: float  #: rad
    output_side_angle: float  #: rad
    sliding_side_speed: float  #: rad/s
    output_side_speed: float  #: rad/s
    relative_angle: float  #: lead of the output ring over dogs facing dogs, rad
    contact_force: float  #: mean over the step, against the shift, N
    contact_torque: float  #: mean over the step, on the sliding ring, N m


def start_of(clutch: Clutch, mismatch: float, relative_angle: float) -> ShiftStart:
    """Compute the start of a shift as ``conclusion.engage`` has it; mismatch in rad/s."""
    drive = clutch.drive
    sliding_speed = drive.sliding_speed(mismatch)
    output_speed = sliding_speed + mismatch
    return ShiftStart(drive.sense * sliding_speed, drive.sense * output_speed, relative_angle)


@dataclass(frozen=True)
class SavedShift:
    """State of a stepped shift at a time, of plain numbers."""

    time: float  #: s
    step: float  #: of the integration, to try next, s
    state: tuple[float, ...]  #: (14,)
    mode: tuple[float, ...]  #: fields of ``STEP_MODE``
    phase: int  #: of ``StepPhase``
    engagement_time: float  #: s; NaN before it
    arrival_time: float  #: of the ring at its travel, s; NaN before it
    contact_force: float  #: N
    contact_torque: float  #: about the axis, N m
    command: SavedCommand = NO_COMMAND


class SteppedShift:
    """A shift that goes on by ``advance``; its time counts from the start, s.

    ``course`` is that of the commands of the clutch's actuator.
    """

    def __init__(self, clutch: Clutch, start: ShiftStart, course: CommandCourse = DIRECT) -> None:
        drive = replace(
            clutch.drive, sliding_torque=(0.0,), output_torque=(0.0,), times=(), control=None
        )
        self.clutch = replace(clutch, drive=drive)
        self._actuator: CommandedActuator | None = None
        if clutch.actuator is not None:
            self._actuator = CommandedActuator(self.clutch, clutch.actuator, course)
        self.time = 0.0
        self.phase = StepPhase.FREE_FLY
        self.engagement_time = math.nan
        self._arrival_time = math.nan  # of the ring at its travel, s
        self._latched = False
        self._sense = drive.sense
        self._planes = section_planes(clutch.pair)
        self._state = self._start_state(start)
        self._step = FIRST_STEP
        self._mode = np.zeros(1, STEP_MODE)
        self._contact_force = 0.0
        self._contact_torque = 0.0
        self._record = np.empty(RECORD_SIZE), np.empty((RECORD_SIZE, STATE_SIZE))
        self._model = self._free_model()
        self._workspace = kernel.clip_workspace(len(self._model.surfaces.normals))

    def _start_state(self, start: ShiftStart) -> Array:
        """Build the state of rings that turn apart, (14,)."""
        state = np.zeros(STATE_SIZE)
        state[[OUTPUT_ANGLE, OUTPUT_SIDE_ANGLE]] = start.relative_angle
        state[[SLIDING_SPEED, INPUT_SIDE_SPEED]] = self._sense * start.sliding_speed
        state[[OUTPUT_SPEED, OUTPUT_SIDE_SPEED]] = self._sense * start.output_speed
        return state

    def _free_model(self) -> ShiftModel:
        """Build the model of a ring that moves along the shaft."""
        planar = PlanarClutch(self.clutch)
        numbers = self.clutch.numbers.copy()
        numbers.has_drive = True
        return shift_model(numbers, np.zeros((3, 2)), planar.surfaces, planar.law)

    def _latch(self) -> None:
        """Hold the ring along the shaft; the motion about the shaft goes on."""
        numbers = self._model.numbers[0]
        numbers.sleeve_mass = LATCH_MASS_KG
        numbers.has_linkage = False
        for name in ("damping", "friction", "spline_force_per_torque", "detent"):
            setattr(numbers, name, 0.0)
        numbers.shift_travel = math.inf
        if numbers.state_size < SHAFTED_STATE_SIZE:
            numbers.state_size = RIGID_STATE_SIZE
        self._latched = True

    @property
    def engaged(self) -> bool:
        """Whether ring and actuator have made the travel of the shift."""
        return self.phase is StepPhase.ENGAGED

    def advance(self, end: float, loads: StepLoads) -> None:
        """Advance to the time ``end`` in s under constant loads.

        Raises
        ------
        InputError
            For a force that presses flat faces deeper than the tolerance of the travel, and a
            shift force beside a command.
        EngineError
            For dogs that pass through each other, and a motion that is lost.
        """
        if not self.engaged:
            require_stiff_enough(self.clutch, max(loads.force, loads.command_force))
        self._ask_command(loads)
        begin = self.time
        impulses = np.zeros(2)  # of the contact over the communication step
        while self.time < end:
            times, states = self._integrate(self._next_pause(end), loads)
            impulses += self._evaluate(times, states)
        if end > begin:
            self._contact_force, self._contact_torque = (impulses / (end - begin)).tolist()

    def _ask_command(self, loads: StepLoads) -> None:
        """Pass a command on; InputError for one without an actuator or beside a shift force."""
        force = loads.command_force
        actuator = self._actuator
        if actuator is None:
            if force != 0.0:
                rule = "the clutch has no actuator"
                remedy = "give the shift force"
                raise InputError(Refusal("force of a command", force, "N", rule, remedy))
            return
        if loads.force != 0.0 and (force != 0.0 or actuator.is_used):
            rule = "the command of the actuator takes its place from the first one on"
            remedy = "give one of them alone"
            raise InputError(Refusal("shift force", loads.force, "N", rule, remedy))
        actuator.ask(self.time, force)

    def _next_pause(self, end: float) -> float:
        """Apply the commands that are due; return the time of the next one up to ``end``, s."""
        if self._actuator is None:
            return end
        self._actuator.apply_changes(self.time, self._model.numbers[0], self._state)
        return min(end, self._actuator.next_change())

    def _integrate(self, end: float, loads: StepLoads) -> tuple[Array, Array]:
        """Integrate to ``end`` in s, or the engagement, or a full record.

        Steps are those with which a doubtful shift is repeated (``sim.shift.conclusion``). Returns
        times in s, (n,), and states, (n, 14), from the present ones on.
        """
        clutch = self.clutch
        solver = clutch.solver
        limits = StepLimits(
            speed_error=float(solver.accuracy),
            place_error=float(POSITION_ERROR_S * solver.accuracy),
            max_step=float(solver.max_step / STEP_REFINEMENT),
        )
        self._set_loads(end, loads)
        times, states = self._record
        start_time = self.time
        start_state = self._state.copy()
        deadline = time.monotonic() + solver.time_limit
        progress = kernel.advance(
            start_time,
            self._step,
            self._state,
            look_state=np.zeros(0),
            pause=end,
            timeout=end,
            model=self._model,
            limits=limits,
            mode=self._mode,
            times=times,
            states=states,
        )
        self.time = progress.time
        self._step = progress.step
        if progress.reason == kernel.UNDERFLOW:
            self._state[:] = math.nan
        failure = failure_of(clutch, self.time, self._state, progress.recorded, deadline)
        if failure:
            raise EngineError(f"the shift cannot go on: {failure}; take shorter steps")
        record_times = np.concatenate([[start_time], times[: progress.recorded]])
        record_states = np.concatenate([start_state[None], states[: progress.recorded]])
        self._note_arrival(record_times, record_states)
        if progress.reason == kernel.ENGAGED:
            self.engagement_time = self._arrival_time
            self.phase = StepPhase.ENGAGED
        return record_times, record_states

    def _set_loads(self, end: float, loads: StepLoads) -> None:
        """Write the loads up to ``end`` in s into the model."""
        knots = self._model.knots
        knots[KNOT_TIME] = self.time, end
        knots[KNOT_FORCE] = 0.0 if self._latched else loads.force
        knots[KNOT_SLOPE] = 0.0
        numbers = self._model.numbers[0]
        numbers.torque_start = self.time
        numbers.sliding_torque = self._sense * loads.sliding_torque
        numbers.output_torque = self._sense * loads.output_torque
        if self._latched:
            self._state[AXIAL_SPEED] = 0.0

    def _note_arrival(self, times: Array, states: Array) -> None:
        """Note when the ring first made the travel, s; with a linkage its actuator may be later."""
        if math.isnan(self._arrival_time):
            travel = float(self.clutch.shift_travel)
            crossing = kernel.crossing(
                times, states[:, DISPLACEMENT], states[:, AXIAL_SPEED], travel
            )
            self._arrival_time = float(crossing)

    def _evaluate(self, times: Array, states: Array) -> Array:
        """Follow the phase; return the impulses of force, N s, and torque, N m s, of the contact.

        ``times``, s, (n,), and ``states``, (n, 14), are those of ``_integrate``. Raises EngineError
        where dogs pass through each other.
        """
        loads = np.array([self._contact_loads(state) for state in states])
        impulses: Array = 0.5 * np.diff(times) @ (loads[1:] + loads[:-1])
        if self._latched:
            return impulses
        numbers = self._model.numbers[0]
        deepest, farthest = kernel.extremes(times, states, self._planes, numbers)
        failure = passing_through(self.clutch, deepest, farthest)
        if failure:
            raise EngineError(failure)
        if self.engaged:
            self._latch()
        else:
            self._follow_phase(states[1:], touches=np.any(loads[1:] != 0.0, axis=1))
        return impulses

    def _contact_loads(self, state: Array) -> tuple[float, float]:
        """Compute the contact's force along the shaft, N, and torque about it, N m, of all dogs."""
        force, torque = kernel.contact_loads(state, self._model, self._workspace)
        return force, torque

    def _follow_phase(self, states: Array, touches: Mask) -> None:
        """Update the phase by the states, (n, 14), and contacts, (n,), at the ends of steps."""
        numbers = self._model.numbers[0]
        gap = self.clutch.dog.axial_gap
        for state, touching in zip(states, touches, strict=True):
            displacement = state[DISPLACEMENT]
            angle = state[OUTPUT_ANGLE] - state[SLIDING_ANGLE]
            if touching and kernel.faces_meet(angle, displacement, numbers):
                self.phase = StepPhase.FACE_CONTACT
            elif touching:
                self.phase = StepPhase.SEATING
            elif self.phase < StepPhase.ENTRY and displacement >= gap:
                self.phase = StepPhase.ENTRY

    @property
    def motion(self) -> StepMotion:
        """Motion and contact at the present time."""
        state = self._state
        turning = self._sense * state
        input_shaft, output_shaft = self.clutch.shafts
        input_side = RING_COLUMNS
        if input_shaft.side_inertia > 0.0:
            input_side = SIDE_COLUMNS
        output_side = RING_COLUMNS
        if output_shaft.side_inertia > 0.0:
            output_side = SIDE_COLUMNS
        return StepMotion(
            travel=float(state[DISPLACEMENT]),
            axial_speed=float(state[AXIAL_SPEED]),
            sliding_angle=float(turning[SLIDING_ANGLE]),
            output_angle=float(turning[OUTPUT_ANGLE]),
            sliding_speed=float(turning[SLIDING_SPEED]),
            output_speed=float(turning[OUTPUT_SPEED]),
            sliding_side_angle=float(turning[input_side.sliding_angle]),
            output_side_angle=float(turning[output_side.output_angle]),
            sliding_side_speed=float(turning[input_side.sliding_speed]),
            output_side_speed=float(turning[output_side.output_speed]),
            relative_angle=float(state[OUTPUT_ANGLE] - state[SLIDING_ANGLE]),
            contact_force=self._contact_force,
            contact_torque=self._sense * self._contact_torque,
        )

    @property
    def actuator_reading(self) -> ActuatorReading:
        """Force, travel and channel of the actuator at the present time; zeros without one."""
        if self._actuator is None:
            return ActuatorReading(force=0.0, travel=0.0, channel=0.0)
        return self._actuator.reading(self.time, self._state, self._model.numbers[0])

    def save(self) -> SavedShift:
        """Copy the state."""
        return SavedShift(
            time=self.time,
            step=self._step,
            state=tuple(self._state.tolist()),
            mode=self._mode[0].item(),
            phase=int(self.phase),
            engagement_time=self.engagement_time,
            arrival_time=self._arrival_time,
            contact_force=self._contact_force,
            contact_torque=self._contact_torque,
            command=NO_COMMAND if self._actuator is None else self._actuator.save(),
        )

    def restore(self, saved: SavedShift) -> None:
        """Go back, or ahead, to a state of this clutch."""
        self.time = saved.time
        self._step = saved.step
        self._state = np.array(saved.state)
        self._mode = np.array([tuple(saved.mode)], STEP_MODE)
        self.phase = StepPhase(saved.phase)
        self.engagement_time = saved.engagement_time
        self._arrival_time = saved.arrival_time
        self._contact_force = saved.contact_force
        self._contact_torque = saved.contact_torque
        self._model = self._free_model()
        if self._actuator is not None:
            self._actuator.restore(SavedCommand(*saved.command))
            self._actuator.write(self._model.numbers[0])
        self._latched = False
        if self.engaged:
            self._latch()
