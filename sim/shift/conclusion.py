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
from typing import Any, Protocol

import numpy as np

from dogshape.sim.elementwise import Array, bisect
from dogshape.sim.errors import InputError, refusal
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.drive import impulses
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import pressure_apex
from dogshape.sim.shift.trace import OVERLAPS, PHASES, Events, Loads, Phase, Trace, trace_of
from dogshape.sim.units import MM


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
#: of the apex's depth, to which the field covers all faces (``sim.shift.mesh``)
COVERED_DEPTH = 1.0 / 3.0
PASSED_OVER = 1e-5  #: m of overlap within a step without contact, beside what roundings take
FINER = 10.0  #: by which steps shrink once dogs passed through each other within one
DEAD_TIME = "dead time"  #: name of the phase before the force starts
_CLASSES = np.array(OVERLAPS)
LATEST_RELEASE = 0.99  #: of the time-out, from which on a ring that was never let go is simulated


@lru_cache(maxsize=4)  # shifts of a design have one dog
def section_planes(dog: Dog) -> Array:
    r"""Compute normals of a dog's planes across and along the shaft, and 2 p_n in m, (p, 3).

    At the mean radius, for ``sim.kernel.penetration``: flanks, face and back.
    """
    quarter, half, right = 0.25 * (dog.pitch - dog.backlash), 0.5 * dog.height, 0.5 * math.pi
    ridge, planes = 0.5 * dog.crest_overlap, []
    # A point of each plane beside its normal's lean.
    for angle, side, at, up in (
        (dog.traction, 1.0, quarter, 0.0),
        (dog.braking, -1.0, -quarter, 0.0),
        (right - dog.chamfer, -1.0, ridge, half),
        (right - dog.chamfer_back, 1.0, ridge, half),
    ):
        n_y, n_z = side * math.cos(angle), math.sin(angle)
        planes.append((n_y, n_z, 2.0 * (n_y * at + n_z * up)))
    return np.array(planes)


def passing_through(clutch: Clutch, deepest: float, farthest: float) -> str:
    """Describe why a shift is not valid; empty where it is.

    Down to a third of the apex's depth the pyramids of the three faces cover all that is touched
    (``sim.shift.mesh``); deeper, the pressure may push the wrong way. Flanks touch at full travel,
    or with a backlash that over their lean beyond, so a ring farther than its tolerance from there
    is not in its slot. ``deepest`` is the penetration, ``farthest`` the way over the shift, m.
    """
    remedy = "lower shift force or mismatch, or take fewer and higher dogs"
    limit = COVERED_DEPTH * pressure_apex(clutch.dog)[1]
    if deepest > limit:
        rule = f"the contact pushes back down to {limit / MM:.4g} mm: dogs passed through"
        return refusal("penetration of the dogs", deepest / MM, "mm", rule, remedy)
    dog, beyond = clutch.dog, farthest - clutch.dog.travel
    if dog.backlash > 0.0:
        beyond -= dog.backlash / dog.lean if dog.lean > 0.0 else math.inf
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
    a shift would seem done, or not, by that depth alone. ``force`` is the largest one, N. The
    published IMPACT is as soft as that and stays as it is.
    """
    if clutch.contact.impact is not None:
        return
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
    missed: float  #: how deep dogs lay in each other within steps that show no contact, m
    run: Run

    @cached_property
    def trace(self) -> Trace:
        """Time series, worked out when they are first asked for."""
        run, profile = self.run, self.point.profile
        made = trace_of(self.clutch, profile, run.times, run.states, run.driven)
        return replace(made, time=made.time + self.point.profile.delay)


@dataclass(frozen=True)
class Run:
    """Record of one shift by an engine.

    A state is output angle, displacement, sliding angle and their rates, displacement and speed of
    the actuator, angle and rate of what is behind the sliding and the output ring, SI; what the
    mechanism does not move apart has no meaning.
    """

    times: Array  #: s, (n,), each later than the one before
    states: Array  #: (n, 12)
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


def failure_of(clutch: Clutch, now: float, state: Array, steps: int, deadline: float) -> str:
    """Describe why a run cannot go on; empty where it can.

    ``now`` in s of the shift, ``deadline`` by the clock of ``time.monotonic``, s.
    """
    solver, place = clutch.solver, f"at {now:.6g} s"
    if not np.isfinite(state).all():
        return f"the motion is not finite {place}"
    if steps > solver.max_steps:
        return f"no end after solver.max_steps = {solver.max_steps}, {place} of the shift"
    if time.monotonic() > deadline:
        return f"{TIME_LIMIT} = {solver.time_limit:.6g}, {place} of the shift"
    return ""


def conclude(clutch: Clutch, point: OperatingPoint, angle: float, run: Run) -> Engagement:
    """Work a result out of a run; times of it count from the command, a dead time later.

    A shift whose dogs passed through each other is ``Outcome.DIVERGED``.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    ends, limits, missed, marks, events, loads, line_loads = kernel.summarize(
        run.times, run.states, clutch.numbers, point.profile.knots, run.driven,
        section_planes(clutch.dog), _CLASSES,
    )  # fmt: skip
    done, far = map(_given, ends)
    fields: list[Any] = [*loads[:5], *map(_given, loads[5:]), tuple(line_loads.tolist())]
    outcome, late = Outcome.ENGAGED, point.profile.delay
    failure = run.failure or passing_through(clutch, *limits)
    if failure:
        outcome = Outcome.DIVERGED
    elif done is None:
        outcome = Outcome.BLOCKED if run.blocked else Outcome.TIMED_OUT
    end = float(run.times[-1]) if done is None else done
    between = pairwise([late, *(mark + late for mark in marks), end + late])
    phases = [Phase(name, *times) for name, times in zip(PHASES, between, strict=True)]
    return Engagement(
        clutch=clutch,
        point=point,
        relative_angle=angle,
        outcome=outcome,
        shift_time=None if done is None or outcome is not Outcome.ENGAGED else done + late,
        actuator_time=None if far is None or outcome is Outcome.DIVERGED else far + late,
        phases=(*([Phase(DEAD_TIME, 0.0, late)] if late else ()), *phases),
        events=Events(*events),
        loads=Loads(*fields),
        evaluations=run.evaluations,
        detail=failure or MESSAGES[outcome],
        missed=missed,
        run=run,
    )


def _given(value: float) -> float | None:
    """Replace a number that there is not by None."""
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
    clutch, first = plant.clutch, plant.run(point, relative_angle)
    found = conclude(clutch, point, relative_angle, first)
    seen = found.missed <= PASSED_OVER + 0.5 * clutch.dog.edge_radius
    if first.failure or (found.outcome is not Outcome.DIVERGED and seen):
        return found
    solver = replace(clutch.solver, max_step=clutch.solver.max_step / FINER)
    more = type(plant)(replace(clutch, solver=solver)).run(point, relative_angle)
    again = conclude(clutch, point, relative_angle, more)
    return replace(again, evaluations=first.evaluations + more.evaluations)


def states_held(clutch: Clutch, point: OperatingPoint, angle: float) -> tuple[Array, Array]:
    """Return times in s, (n,), and states, (n, 12), up to where friction lets the ring go.

    The last state is where the motion of both rings begins; ``angle`` as for ``Engagement``.
    """
    times, *actuator = release(clutch, point.profile)
    sliding, still = clutch.drive.sliding_speed(point.mismatch), np.zeros_like(times)
    output = sliding + point.mismatch
    ahead, turned = angle + output * times, sliding * times
    given, rings = output + still, sliding + still
    columns = ahead, still, turned, given, still, rings, *actuator, turned, rings, ahead, given
    return times, np.array(columns).T.copy()


@lru_cache(maxsize=64)  # shifts differ by their angle alone
def release(clutch: Clutch, profile: ForceProfile) -> Array:
    r"""Find the time at which friction lets the ring go; at once where it need not hold.

    Returns times in s with displacement in m and speed of the actuator up to there, (3, n).
    Without a linkage that is when the shift force reaches :math:`R_0`. With one the actuator moves
    against a ring at rest, :math:`m_a \ddot y = F(t) - L(y, \dot y)`, until :math:`L = R_0`. A
    friction law that is nearly a jump would cost the solver of the whole motion thousands of steps.
    """
    mechanism, mass = clutch.mechanism, clutch.rings.mass
    held = mechanism.friction > 0.0 and mechanism.resistance(0.0, 0.0, 0.0) == 0.0
    slows = clutch.drive.has_torques or (clutch.drive.turns and mechanism.drag_torque > 0.0)
    low, high = 0.0, LATEST_RELEASE * clutch.timeout
    if not held or slows:
        return np.zeros((3, 1))
    if not mechanism.has_linkage:
        if profile.at(high) < mechanism.friction:
            low = high
        low, _ = bisect(lambda at: profile.at(at) < mechanism.friction, low, high, width=1e-6)
        return np.array([[0.0, low], [0.0, 0.0], [0.0, 0.0]])
    from scipy.integrate import solve_ivp  # noqa: PLC0415  slow to load, and few shifts need it

    linkage, far = mechanism.linkage(mass), mechanism.actuator_mass(mass)

    def pulled(state: Array) -> float:
        return float(mechanism.pull(float(state[0]), float(state[1]), *linkage))

    def motion(time: float, state: Array) -> list[float]:
        return [float(state[1]), (float(profile.at(time)) - pulled(state)) / far]

    def loose(_: float, state: Array) -> float:
        return pulled(state) - mechanism.friction

    loose.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        motion, (low, high), [0.0, 0.0], events=loose, rtol=1e-5, atol=1e-9, max_step=0.01 * high
    )
    return np.array([run.t, *run.y])
