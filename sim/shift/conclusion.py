"""Result of a run of either engine: outcome, time, phases, events, loads, trace.

*Validity.* The pressure field of the contact grows down to the apex of its pyramids and pushes
the wrong way beyond it. A dog that was pressed past the apex went through another.

*Dead time.* Nothing moves along the shaft until the force starts; both rings turn on meanwhile. The
relative angle of a shift is that at the start of the force, so what follows is the same shift, and
every time of it is later by the dead time exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError, refusal
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.events import Events, Phase, events_of, phases_of, touches_of
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.loads import Loads, loads_of
from dogshape.sim.shift.mesh import pressure_apex
from dogshape.sim.shift.trace import Series, Trace, crossing, trace_of
from dogshape.sim.units import MM


class Outcome(Enum):
    """End of a shift."""

    ENGAGED = "engaged"
    BLOCKED = "blocked"
    TIMED_OUT = "timed_out"
    DIVERGED = "diverged"

    @property
    def message(self) -> str:
        """Meaning of the outcome, in words."""
        return _MESSAGES[self]


_MESSAGES = {
    Outcome.ENGAGED: "the sliding ring reached full depth",
    Outcome.BLOCKED: "the rings stand still on each other, dog on dog, held by friction",
    Outcome.TIMED_OUT: "full depth was not reached before the time-out",
    Outcome.DIVERGED: "the integration failed",
}

#: Beginning of the reason of a failure that depends on the speed of the machine.
TIME_LIMIT = "no end after solver.time_limit_s"


def depends_on_clock(reason: str) -> bool:
    """Decide whether a failure for this reason may not happen when the shift is simulated again."""
    return reason.startswith(TIME_LIMIT)


LONGEST_TURN = 0.05  #: pitches, by which a step may turn without a look at what is between
#: of the apex's depth, to which the field covers all faces (``sim.shift.mesh``)
COVERED_DEPTH = 1.0 / 3.0


def penetration(dog: Dog, displacement: Series, relative_angle: Series) -> Series:
    r"""Compute how deep a sliding dog lies in an output dog, m, (n,); 0 where they are apart.

    Sections at the mean radius are convex and one is the other turned by half a turn, so
    along each shared normal they overlap by :math:`2 p_n - n \cdot c`, with the plane's
    distance and the way between both centres; the least over traction flank, face and
    braking flank is the depth. Axial way of the sliding ring from the start, m, and output ring's
    lead over dogs facing dogs, rad, each (n,).
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
    turn by more than ``LONGEST_TURN`` are divided into parts that do not, with the cubic through
    both ends.
    """
    way, angle, speed, turn = (
        trace.displacement, trace.relative_angle, trace.axial_speed, trace.relative_speed,
    )  # fmt: skip
    turned = np.abs(angle[1:] - angle[:-1]) / clutch.dog.pitch_angle
    long = np.flatnonzero(turned > LONGEST_TURN)
    if not long.size:
        return way, angle
    parts = int(np.ceil(turned.max() / LONGEST_TURN))
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
    Arguments as for ``penetration``, over the whole shift.
    """
    remedy = "lower shift force or mismatch, or take fewer and higher dogs"
    deepest = float(penetration(clutch.dog, displacement, relative_angle).max())
    limit = COVERED_DEPTH * pressure_apex(clutch.dog)[1]
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
    a shift would seem done, or not, by that depth alone. ``force`` is the largest one, N.
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


FINER = 10.0  #: by which steps shrink once dogs passed through each other within one
DEAD_TIME = "dead time"  #: name of the phase before the force starts


@dataclass(frozen=True)
class Engagement:
    """Result of one shift, with its problem.

    ``shift_time`` is in s, None unless engaged; ``evaluations`` counts the
    derivatives that the integrator asked for, the measure of what a shift costs.
    ``actuator_time`` is when the actuator first made the shift's travel, s: the shift time
    unless there is a linkage; None if it never did. A run goes on until ring and actuator have.
    """

    clutch: Clutch
    point: OperatingPoint
    relative_angle: float
    outcome: Outcome
    shift_time: float | None
    actuator_time: float | None
    phases: tuple[Phase, ...]
    events: Events
    loads: Loads
    steps: int
    evaluations: int
    detail: str
    trace: Trace


@dataclass(frozen=True)
class Run:
    """Record of one shift by an engine.

    Parameters
    ----------
    times : s, (n,).
    states : output angle, displacement, sliding angle and their rates, each (6,); with a linkage
        also displacement and speed of the actuator, (8,); with shafts that give way these and angle
        and rate of what is behind the sliding and the output ring, (12,).
    blocked : whether the rings stood still on each other.
    failure : why the integration was lost; empty where it was not.
    evaluations : derivatives that the integrator asked for.
    """

    times: Sequence[float] | Series
    states: Sequence[Series] | Series
    blocked: bool
    failure: str
    evaluations: int


def conclude(clutch: Clutch, point: OperatingPoint, angle: float, run: Run) -> Engagement:
    """Work a result out of a run.

    A shift whose dogs passed through each other is ``Outcome.DIVERGED``. Times of a run
    count from the start of the force, those of the result from the command: a dead time later.
    """
    trace = trace_of(clutch, point, run.times, run.states)
    way = clutch.shift_travel
    failure = run.failure or passing_through(clutch, *path_of(clutch, trace))
    if failure:
        outcome = Outcome.DIVERGED
    elif (trace.displacement >= way).any():
        outcome = Outcome.ENGAGED
    else:
        outcome = Outcome.BLOCKED if run.blocked else Outcome.TIMED_OUT
    done = crossing(trace.time, trace.displacement, trace.axial_speed, way)
    far = done
    if clutch.mechanism.has_linkage:
        far = crossing(trace.time, trace.actuator_displacement, trace.actuator_speed, way)
    end = float(trace.time[-1]) if done is None else done
    touched = touches_of(clutch, trace)
    phases = phases_of(clutch, trace, touched, end)
    found = Engagement(
        clutch=clutch,
        point=point,
        relative_angle=angle,
        outcome=outcome,
        shift_time=done if outcome is Outcome.ENGAGED else None,
        actuator_time=None if outcome is Outcome.DIVERGED else far,
        phases=phases,
        events=events_of(clutch, trace, touched),
        loads=loads_of(clutch, trace, touched, phases),
        steps=len(trace.time),
        evaluations=run.evaluations,
        detail=failure or outcome.message,
        trace=trace,
    )
    return _delayed(found, point.profile.delay)


def _delayed(found: Engagement, delay: float) -> Engagement:
    """Return a shift whose force starts after a dead time in s, of one that starts at once.

    The dead time comes before the phases, and as one more state, that at the command, before the
    trace, (n + 1,).
    """
    if delay == 0.0:
        return found
    phases = [Phase(one.name, one.start + delay, one.end + delay) for one in found.phases]
    trace, later = found.trace, replace(found.trace, time=found.trace.time + delay)
    kept = [one.name for one in fields(trace) if getattr(trace, one.name) is not None]
    first = {name: getattr(trace, name)[0] for name in kept}
    first["time"] = 0.0
    first["relative_angle"] -= delay * float(trace.relative_speed[0])
    whole = {n: np.concatenate([[value], getattr(later, n)]) for n, value in first.items()}
    ends = (found.shift_time, found.actuator_time)
    shift_time, actuator_time = (None if end is None else end + delay for end in ends)
    return replace(
        found,
        shift_time=shift_time,
        actuator_time=actuator_time,
        phases=(Phase(DEAD_TIME, 0.0, delay), *phases),
        trace=Trace(**whole),
    )


def engaged(
    clutch: Clutch, point: OperatingPoint, angle: float, run: Callable[[Clutch], Run]
) -> Engagement:
    """Simulate one shift by ``run``.

    Dogs that are fast enough pass through each other within one step; such a shift is simulated
    again with steps of at most a tenth, and has diverged only if it does so again.
    """
    first = run(clutch)
    found = conclude(clutch, point, angle, first)
    if found.outcome is not Outcome.DIVERGED or first.failure:
        return found
    solver = replace(clutch.solver, max_step=clutch.solver.max_step / FINER)
    more = run(replace(clutch, solver=solver))
    again = conclude(clutch, point, angle, more)
    return replace(again, evaluations=first.evaluations + more.evaluations)


#: Share of the time-out from which on a ring that was never let go is simulated.
LATEST_RELEASE = 0.99


@dataclass(frozen=True)
class Release:
    """Times in s up to when the ring is let go, with displacement (m) and speed of the actuator.

    Each (n,); the last is where the motion of both rings begins.
    """

    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    speed: NDArray[np.float64]


def states_held(clutch: Clutch, point: OperatingPoint, angle: float) -> tuple[Series, Series]:
    """Return times in s, (n,), and states, (n, 12), up to where friction lets the ring go.

    The last state is where the motion of both rings begins; ``angle`` as for ``Engagement``.
    """
    held, sliding = release(clutch, point.profile), clutch.rings.initial_speed
    output = sliding + point.mismatch
    states = np.zeros((len(held.time), 12))
    states[:, 0], states[:, 2] = angle + output * held.time, sliding * held.time
    states[:, 3], states[:, 5] = output, sliding
    states[:, 6], states[:, 7] = held.displacement, held.speed
    states[:, 8], states[:, 9] = states[:, 2], sliding
    states[:, 10], states[:, 11] = states[:, 0], output
    return held.time, states


@lru_cache(maxsize=64)  # shifts differ by their angle alone
def release(clutch: Clutch, profile: ForceProfile) -> Release:
    r"""Find the time at which friction lets the ring go; at once where it need not hold.

    Without a linkage that is when the shift force reaches :math:`R_0`. With one the actuator moves
    against a ring at rest, :math:`m_a \ddot y = F(t) - L(y, \dot y)`, until :math:`L = R_0`. A
    friction law that is nearly a jump would cost the solver of the whole motion thousands of steps.
    """
    mechanism = clutch.mechanism
    held = mechanism.friction > 0.0 and mechanism.resistance(0.0, 0.0, 0.0) == 0.0
    slows = clutch.rings.initial_speed != 0.0 and mechanism.drag_torque > 0.0
    if not held or slows:
        return Release(*np.zeros((3, 1)))
    if mechanism.has_linkage:
        return _loaded(clutch, profile)
    low, high = 0.0, LATEST_RELEASE * clutch.timeout
    if profile.at(high) < mechanism.friction:
        low = high
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if profile.at(middle) < mechanism.friction else (low, middle)
    return Release(np.array([0.0, low]), np.zeros(2), np.zeros(2))


def _loaded(clutch: Clutch, profile: ForceProfile) -> Release:
    from scipy.integrate import solve_ivp  # noqa: PLC0415  slow to load, and few shifts need it

    mechanism, mass = clutch.mechanism, clutch.rings.mass
    linkage, far = mechanism.linkage(mass), mechanism.actuator_mass(mass)

    def motion(time: float, state: NDArray[np.float64]) -> list[float]:
        way, speed = map(float, state)
        return [speed, (float(profile.at(time)) - mechanism.pull(way, speed, *linkage)) / far]

    def loose(_: float, state: NDArray[np.float64]) -> float:
        way, speed = map(float, state)
        return float(mechanism.pull(way, speed, *linkage)) - mechanism.friction

    loose.terminal = True  # type: ignore[attr-defined]
    span = (0.0, LATEST_RELEASE * clutch.timeout)
    run = solve_ivp(
        motion, span, [0.0, 0.0], events=loose, rtol=1e-5, atol=1e-9, max_step=0.01 * span[1]
    )
    return Release(run.t, *run.y)
