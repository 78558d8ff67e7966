"""How a run of either engine becomes a result: outcome, time, phases, events, loads, trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.dead_time import later, later_phases, later_trace
from dogshape.sim.shift.events import Events, events_of
from dogshape.sim.shift.loads import Loads, loads_of
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.shift.passing import passing_through, path_of
from dogshape.sim.shift.phases import Phase, phases_of, touches_of
from dogshape.sim.shift.trace import Series, Trace, crossing, trace_of

FINER = 10.0  #: by which steps shrink once dogs passed through each other within one


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
    outcome, failure = _outcome(clutch, run, trace), run.failure
    if outcome is not Outcome.DIVERGED:
        failure = passing_through(clutch, *path_of(clutch, trace))
        outcome = Outcome.DIVERGED if failure else outcome
    way = clutch.shift_travel
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
    """Return a shift whose force starts after a dead time in s, of one that starts at once."""
    if delay == 0.0:
        return found
    return replace(
        found,
        shift_time=later(found.shift_time, delay),
        actuator_time=later(found.actuator_time, delay),
        phases=later_phases(found.phases, delay),
        trace=later_trace(found.trace, delay),
    )


def passed_through(run: Run, found: Engagement) -> bool:
    """Decide whether a shift diverged for its dogs alone, which finer steps may mend."""
    return found.outcome is Outcome.DIVERGED and not run.failure


def _outcome(clutch: Clutch, run: Run, trace: Trace) -> Outcome:
    if run.failure:
        return Outcome.DIVERGED
    if (trace.displacement >= clutch.shift_travel).any():
        return Outcome.ENGAGED
    return Outcome.BLOCKED if run.blocked else Outcome.TIMED_OUT
