"""One shift by either engine, and its result: outcome, time, phases, events, loads, trace.

*Dead time.* Nothing moves along the shaft until the force starts; both rings turn on meanwhile. The
relative angle of a shift is that at the start of the force, so every time is later by it exactly.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from dogshape.sim.elementwise import Array, bisect
from dogshape.sim.errors import InputError, Refusal
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_LEVEL,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
    SPINDLE_TRAVEL,
    STATE_SIZE,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.drive import impulses
from dogshape.sim.shift.geometry import Dog, section
from dogshape.sim.shift.mesh import pressure_apex
from dogshape.sim.shift.pair import Pair
from dogshape.sim.shift.trace import OVERLAPS, PHASES, Events, Loads, Phase, Trace, trace_of
from dogshape.sim.units import MM

if TYPE_CHECKING:
    from dogshape.sim.kernel import ShiftSummary


class Outcome(Enum):
    """End of a shift."""

    ENGAGED = "engaged"
    BLOCKED = "blocked"
    TIMED_OUT = "timed_out"
    DIVERGED = "diverged"


#: Meaning of an outcome.
MESSAGES = {
    Outcome.ENGAGED: "the sliding ring reached full depth",
    Outcome.BLOCKED: "the rings stand still on each other, dog on dog, held by friction",
    Outcome.TIMED_OUT: "full depth was not reached before the time-out",
    Outcome.DIVERGED: "the integration failed",
}

#: Beginning of the reason of a failure that depends on the speed of the machine.
TIME_LIMIT = "no end after solver.time_limit_s"
#: Share of the apex's depth to which the field covers all faces (``sim.shift.mesh``).
COVERED_DEPTH = 1.0 / 3.0
#: Overlap within a step without contact that a shift may have, beyond that of rounded edges.
MAX_MISSED_OVERLAP_M = 1e-5
STEP_REFINEMENT = 10.0  #: by which steps shrink once dogs passed through each other within one
DEAD_TIME = "dead time"  #: name of the phase before the force starts
_CLASSES = np.array(OVERLAPS)
#: Share of the time-out from which on a ring that friction never let go is simulated.
LATEST_RELEASE_SHARE = 0.99


class SectionPlane(NamedTuple):
    """Plane of a dog's section at the mean radius."""

    across: float  #: component of its normal across the shaft
    along: float  #: component of its normal along the shaft
    offset: float  #: along the normal, m

    def extent(self, dog: Dog) -> float:
        """Compute the farthest extent of a dog's section along the normal, m."""
        return max(self.across * y + self.along * z for y, z in section(dog))


def section_lines(dog: Dog) -> tuple[SectionPlane, ...]:
    """List the planes of a dog's section at the mean radius: flanks, face and back."""
    quarter = 0.25 * (dog.pitch - dog.backlash)
    rise = dog.addendum
    right_angle = 0.5 * math.pi
    ridge = 0.5 * dog.crest_overlap
    # Lean and sense of each plane's normal, and a point of the plane.
    lines = (
        (dog.traction, 1.0, quarter, 0.0),
        (dog.braking, -1.0, -quarter, 0.0),
        (right_angle - dog.chamfer, -1.0, ridge, rise),
        (right_angle - dog.chamfer_back, 1.0, ridge, rise),
    )
    planes = []
    for lean, sense, y, z in lines:
        n_y = sense * math.cos(lean)
        n_z = math.sin(lean)
        planes.append(SectionPlane(n_y, n_z, n_y * y + n_z * z))
    return tuple(planes)


@lru_cache(maxsize=4)  # shifts of a design have one pair
def section_planes(pair: Pair) -> Array:
    r"""Compute normals of a pair's planes across and along the shaft, and p_n in m, (p, 3).

    At the mean radius, for ``sim.kernel.penetration``; p_n is the sum of the extents of both dogs.
    """
    sliding_planes = section_lines(pair.sliding)
    if pair.alike:
        return np.array([(p.across, p.along, 2.0 * p.offset) for p in sliding_planes])
    rows = []
    for planes, mate in (
        (sliding_planes, pair.output),
        (section_lines(pair.output), pair.sliding),
    ):
        rows += [(p.across, p.along, p.offset + p.extent(mate)) for p in planes]
    return np.array(rows)


def passing_through(clutch: Clutch, deepest: float, farthest: float) -> str:
    """Describe dogs that passed through each other or a ring beyond its slot; empty for neither.

    Down to a third of the apex's depth the pyramids of the three faces cover all that is touched
    (``sim.shift.mesh``); deeper, the pressure may push the wrong way. Flanks touch at full travel,
    or with a backlash that over their lean beyond, so a ring farther than its tolerance from there
    is not in its slot. ``deepest`` is the penetration, ``farthest`` the way over the shift, m.
    """
    remedy = "lower shift force or mismatch, or take fewer and higher dogs"
    limit = COVERED_DEPTH * pressure_apex(clutch.pair.compliant)[1]
    if deepest > limit:
        rule = f"the contact pushes back down to {limit / MM:.4g} mm: dogs passed through"
        return str(Refusal("penetration of the dogs", deepest / MM, "mm", rule, remedy))
    pair = clutch.pair
    lean = clutch.dog.lean
    excess = farthest - pair.travel
    if pair.backlash > 0.0:
        excess -= pair.backlash / lean if lean > 0.0 else math.inf
    if excess > clutch.seated_tolerance:
        rule = (
            f"full travel and its tolerance of {clutch.seated_tolerance / MM:.4g} mm end it: the "
            "ring is not in its slot"
        )
        return str(Refusal("way beyond full travel", excess / MM, "mm", rule, remedy))
    return ""


def require_stiff_enough(clutch: Clutch, force: float) -> None:
    """Raise InputError where the force presses flat faces deeper than the tolerance of the travel.

    Faces of all dogs on each other give way by :math:`F/(k A)`; beyond the tolerance of the end
    a shift would seem done, or not, by that depth alone. ``force`` is the largest one, N. The
    published IMPACT is as soft as that and is not refused.
    """
    if clutch.contact.impact is not None:
        return
    dog = clutch.dog
    stiffness = clutch.contact.stiffness
    tip_width = min(dog.tip_width, clutch.pair.output.tip_width)
    area = clutch.pair.touching_count * tip_width * dog.radial_width
    depth = force / (stiffness * area)
    if depth <= clutch.seated_tolerance:
        return
    min_stiffness = force / (clutch.seated_tolerance * area)
    rule = (
        f"{force:.6g} N press the faces {depth / MM:.3g} mm into each other, more than the "
        f"{clutch.seated_tolerance / MM:.4g} mm to which a shift's end is told"
    )
    remedy = f"take at least {min_stiffness:.2g} Pa/m"
    raise InputError(Refusal("contact.stiffness_Pa_m", stiffness, "Pa/m", rule, remedy))


@dataclass(frozen=True)
class Engagement:
    """Result of one shift, with its problem; a run goes on until ring and actuator arrive."""

    clutch: Clutch
    point: OperatingPoint
    relative_angle: float
    outcome: Outcome
    shift_time: float | None  #: s; None unless engaged
    #: when the actuator first made the shift's travel, s: the shift time unless there is a linkage;
    #: None if it never did
    actuator_time: float | None
    phases: tuple[Phase, ...]
    events: Events
    loads: Loads
    evaluations: int  #: derivatives that the integrator asked for, what a shift costs
    detail: str
    missed: float  #: largest penetration within steps that show no contact, m
    run: Run

    @cached_property
    def trace(self) -> Trace:
        """Time series, computed at the first use."""
        run = self.run
        profile = self.point.profile
        trace = trace_of(self.clutch, profile, run.times, states=run.states, driven=run.driven)
        return replace(trace, time=trace.time + profile.delay)


@dataclass(frozen=True)
class Run:
    """Record of one shift by an engine.

    ``sim.kernel_layout`` has the columns of a state; columns that do not move have no meaning.
    """

    times: Array  #: s, (n,), each later than the one before
    states: Array  #: (n, 14)
    blocked: bool  #: whether the rings stood still on each other
    failure: str  #: why the integration was lost; empty where it was not
    evaluations: int  #: derivatives that the integrator asked for
    torques: Array | None = None  #: knots of ``sim.shift.drive.TorqueCourse``; None without a drive

    @property
    def driven(self) -> Array:
        """Integrals of the drive's torques at the times, N m s, (2, n), or (2, 0) without any."""
        if self.torques is None:
            return np.empty((2, 0))
        return impulses(self.times, self.torques)


def failure_of(clutch: Clutch, shift_time: float, state: Array, steps: int, deadline: float) -> str:
    """Describe a motion that is not finite or a limit that a run has passed; empty for neither.

    ``shift_time`` is the present time of the shift, s, ``deadline`` by ``time.monotonic``, s.
    """
    solver = clutch.solver
    place = f"at {shift_time:.6g} s"
    if not np.isfinite(state).all():
        return f"the motion is not finite {place}"
    if steps > solver.max_steps:
        return f"no end after solver.max_steps = {solver.max_steps}, {place} of the shift"
    if time.monotonic() > deadline:
        return f"{TIME_LIMIT} = {solver.time_limit:.6g}, {place} of the shift"
    return ""


def conclude(clutch: Clutch, point: OperatingPoint, angle: float, run: Run) -> Engagement:
    """Compute the result of a run; its times count from the command, a dead time earlier.

    A shift whose dogs passed through each other is ``Outcome.DIVERGED``.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    summary = kernel.summarize(
        run.times,
        run.states,
        np.array([clutch.shift_numbers(point.profile)]),
        knots=point.profile.knots,
        driven=run.driven,
        planes=section_planes(clutch.pair),
        classes=_CLASSES,
    )
    delay = point.profile.delay
    failure = run.failure or passing_through(clutch, summary.deepest, summary.farthest)
    outcome = Outcome.ENGAGED
    if failure:
        outcome = Outcome.DIVERGED
    elif math.isnan(summary.shift_time):
        outcome = Outcome.BLOCKED if run.blocked else Outcome.TIMED_OUT
    shift_time = None
    if outcome is Outcome.ENGAGED:
        shift_time = _number_or_none(summary.shift_time + delay)
    actuator_time = None
    if outcome is not Outcome.DIVERGED:
        actuator_time = _number_or_none(summary.actuator_time + delay)
    return Engagement(
        clutch=clutch,
        point=point,
        relative_angle=angle,
        outcome=outcome,
        shift_time=shift_time,
        actuator_time=actuator_time,
        phases=_phases(run, summary, delay),
        events=Events(**summary.events._asdict()),
        loads=_loads(summary),
        evaluations=run.evaluations,
        detail=failure or MESSAGES[outcome],
        missed=summary.missed_overlap,
        run=run,
    )


def _phases(run: Run, summary: ShiftSummary, delay: float) -> tuple[Phase, ...]:
    """List the phases of a shift from the command on, after a dead time of ``delay`` in s."""
    end = summary.shift_time
    if math.isnan(end):
        end = float(run.times[-1])
    times = [delay, *(mark + delay for mark in summary.marks), end + delay]
    phases = [
        Phase(name, phase_start, phase_end)
        for name, (phase_start, phase_end) in zip(PHASES, pairwise(times), strict=True)
    ]
    if delay:
        phases.insert(0, Phase(DEAD_TIME, 0.0, delay))
    return tuple(phases)


def _loads(summary: ShiftSummary) -> Loads:
    """Build the loads of a shift, None for a value that there is not."""
    values = summary.loads
    return Loads(
        peak_axial_force=values.peak_axial_force,
        peak_tangential_force=values.peak_tangential_force,
        impact_impulse=values.impact_impulse,
        energy_dissipated=values.energy_dissipated,
        strike_mismatch=values.strike_mismatch,
        residual_mismatch=_number_or_none(values.residual_mismatch),
        input_torque_peak=_number_or_none(values.input_torque_peak),
        output_torque_peak=_number_or_none(values.output_torque_peak),
        landing_loads=tuple(summary.line_loads.tolist()),
    )


def _number_or_none(value: float) -> float | None:
    """Replace NaN by None."""
    return None if math.isnan(value) else value


class Engine(Protocol):
    """A clutch prepared for one of the engines, built of it alone and used again and again."""

    @property
    def clutch(self) -> Clutch:
        """Clutch that is simulated."""

    def __init__(self, clutch: Clutch) -> None: ...

    def run(self, point: OperatingPoint, angle: float) -> Run:
        """Integrate one shift."""


def engage(plant: Engine, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift; ``relative_angle`` is the output ring's lead over dogs facing dogs, rad.

    Times count from the command, the time-out and the angle from the start of the force. Physical
    failure and a failed integration are outcomes. Dogs that are fast enough pass through each other
    within one step, or meet and part; such a shift is simulated again with steps of at most a
    tenth, and has diverged only if dogs pass through each other again.
    """
    clutch = plant.clutch
    run = plant.run(point, relative_angle)
    result = conclude(clutch, point, relative_angle, run)
    max_missed = MAX_MISSED_OVERLAP_M + 0.5 * clutch.pair.edge_radius
    valid = result.outcome is not Outcome.DIVERGED and result.missed <= max_missed
    if run.failure or valid:
        return result
    solver = replace(clutch.solver, max_step=clutch.solver.max_step / STEP_REFINEMENT)
    fine_run = type(plant)(replace(clutch, solver=solver)).run(point, relative_angle)
    fine_result = conclude(clutch, point, relative_angle, fine_run)
    return replace(fine_result, evaluations=run.evaluations + fine_run.evaluations)


def states_held(clutch: Clutch, point: OperatingPoint, angle: float) -> tuple[Array, Array]:
    """Compute times in s, (n,), and states, (n, 14), while friction holds the ring.

    The last state is the first of the motion of both rings; ``angle`` is the relative angle, rad.
    """
    held = release(clutch, point.profile)
    times = held.times
    sliding_speed = clutch.drive.sliding_speed(point.mismatch)
    output_speed = sliding_speed + point.mismatch
    output_angle = angle + output_speed * times
    sliding_angle = sliding_speed * times
    states = np.empty((times.size, STATE_SIZE))
    states[:, OUTPUT_ANGLE] = output_angle
    states[:, DISPLACEMENT] = 0.0
    states[:, SLIDING_ANGLE] = sliding_angle
    states[:, OUTPUT_SPEED] = output_speed
    states[:, AXIAL_SPEED] = 0.0
    states[:, SLIDING_SPEED] = sliding_speed
    states[:, ACTUATOR_DISPLACEMENT] = held.actuator_displacement
    states[:, ACTUATOR_SPEED] = held.actuator_speed
    states[:, INPUT_SIDE_ANGLE] = sliding_angle
    states[:, INPUT_SIDE_SPEED] = sliding_speed
    states[:, OUTPUT_SIDE_ANGLE] = output_angle
    states[:, OUTPUT_SIDE_SPEED] = output_speed
    states[:, SPINDLE_TRAVEL] = held.spindle_travel
    states[:, ACTUATOR_LEVEL] = held.level
    return times, states


@dataclass(frozen=True)
class HeldActuator:
    """Motion of an actuator while friction holds the ring, each (n,)."""

    times: Array  #: s
    actuator_displacement: Array  #: m
    actuator_speed: Array  #: m/s
    spindle_travel: Array  #: own states, as ``sim.kernel_layout`` has them
    level: Array


@lru_cache(maxsize=64)  # shifts differ by their angle alone
def release(clutch: Clutch, profile: ForceProfile) -> HeldActuator:
    r"""Compute the motion of the actuator while friction holds the ring, up to the release.

    Without a linkage that is when the shift force reaches :math:`R_0`. With one the actuator moves
    against a ring at rest, :math:`m_a \ddot y = F(t) - L(y, \dot y)`, until :math:`L = R_0`. A
    friction law that is nearly a jump would cost the solver of the whole motion thousands of steps.
    """
    mechanism = clutch.mechanism
    mass = clutch.rings.mass
    holds = mechanism.friction > 0.0 and mechanism.resistance(0.0, 0.0, 0.0) == 0.0
    slows = clutch.drive.has_torques or (clutch.drive.turns and mechanism.drag_torque > 0.0)
    low = 0.0
    high = LATEST_RELEASE_SHARE * clutch.timeout
    actuator = clutch.actuator
    level = 0.0 if actuator is None else actuator.initial_level(profile.force)
    if not holds or slows:
        return _free_actuator(level)
    if actuator is not None:
        return _release_of_actuator(clutch, profile, level, high)
    if not mechanism.has_linkage:
        if profile.at(high) < mechanism.friction:
            low = high
        low, _ = bisect(lambda time: profile.at(time) < mechanism.friction, low, high, width=1e-6)
        return HeldActuator(np.array([0.0, low]), *np.zeros((4, 2)))
    from scipy.integrate import solve_ivp  # noqa: PLC0415  slow to load, and few shifts need it

    stiffness, damping = mechanism.linkage(mass)
    actuator_mass = mechanism.actuator_mass(mass)

    def pull(motion: Array) -> float:
        displacement, speed = motion
        return float(mechanism.pull(float(displacement), float(speed), stiffness, damping))

    def rates(time: float, motion: Array) -> list[float]:
        _, speed = motion
        return [float(speed), (float(profile.at(time)) - pull(motion)) / actuator_mass]

    def excess_pull(_: float, motion: Array) -> float:
        return pull(motion) - mechanism.friction

    excess_pull.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        rates,
        (low, high),
        np.zeros(2),
        events=excess_pull,
        rtol=1e-5,
        atol=1e-9,
        max_step=0.01 * high,
    )
    own_states = np.zeros((2, solution.t.size))
    return HeldActuator(solution.t, *solution.y, *own_states)


def _free_actuator(level: float) -> HeldActuator:
    """Return the state at time 0, at which nothing holds the ring; ``level`` is the initial one."""
    zero = np.zeros(1)
    return HeldActuator(zero, zero, zero, spindle_travel=zero, level=np.array([level]))


def _release_of_actuator(
    clutch: Clutch, profile: ForceProfile, level: float, end: float
) -> HeldActuator:
    """Compute the motion of an actuator with own states until the ring is released or ``end``, s.

    ``level`` is the initial one.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415  slow to load, and few shifts need it

    from dogshape.sim import kernel  # noqa: PLC0415

    mechanism = clutch.mechanism
    numbers = clutch.shift_numbers(profile).actuator
    mass = mechanism.actuator_mass(clutch.rings.mass)
    law = mechanism.linkage(clutch.rings.mass) if mechanism.has_linkage else None

    def load(time: float, motion: Array) -> float:
        displacement, speed, *_ = motion.tolist()
        if law is None:
            return float(kernel.actuator_force(time, *motion.tolist(), numbers))
        return float(mechanism.pull(displacement, speed, *law))

    def rates(time: float, motion: Array) -> list[float]:
        speed = float(motion[1])
        own_rates = kernel.actuator_rates(time, *motion.tolist(), numbers)
        if law is None:
            return [0.0, 0.0, *own_rates]
        push = kernel.actuator_force(time, *motion.tolist(), numbers)
        return [speed, (push - load(time, motion)) / mass, *own_rates]

    def excess_load(time: float, motion: Array) -> float:
        return load(time, motion) - mechanism.friction

    excess_load.terminal = True  # type: ignore[attr-defined]
    start = np.array([0.0, 0.0, 0.0, level])
    if excess_load(0.0, start) >= 0.0:
        return _free_actuator(level)
    solution = solve_ivp(
        rates, (0.0, end), start, events=excess_load, rtol=1e-5, atol=1e-9, max_step=0.01 * end
    )
    return HeldActuator(solution.t, *solution.y)
