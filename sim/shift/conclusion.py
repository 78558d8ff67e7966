"""How a run of either engine becomes a result: outcome, time, phases, events, loads, trace."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.dead_time import later, later_phases, later_trace
from dogshape.sim.shift.events import Events, events_of
from dogshape.sim.shift.loads import Loads, loads_of
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.shift.passing import passing_through, path_of
from dogshape.sim.shift.phases import Phase, phases_of, touches_of
from dogshape.sim.shift.trace import Series, Trace, crossing, growing, trace_of

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


@dataclass(frozen=True)
class End:
    """End of a run: its outcome, why it failed, and when ring and actuator made the travel, s.

    Times count from the start of the force; None where the travel was never made.
    """

    outcome: Outcome
    failure: str
    ring: float | None
    actuator: float | None

    @property
    def shift_time(self) -> float | None:
        """Time of a shift that engaged, s."""
        return self.ring if self.outcome is Outcome.ENGAGED else None

    @property
    def actuator_time(self) -> float | None:
        """Time of the actuator's travel in a valid shift, s."""
        return None if self.outcome is Outcome.DIVERGED else self.actuator


def end_of(clutch: Clutch, run: Run) -> End:
    """Find how a run ended; one whose dogs passed through each other is ``Outcome.DIVERGED``."""
    time, state = growing(run.times, run.states)
    way, speed, travel = state[:, 1], state[:, 4], clutch.shift_travel
    ring = crossing(time, way, speed, travel)
    linked = clutch.mechanism.has_linkage
    actuator = crossing(time, state[:, 6], state[:, 7], travel) if linked else ring
    failure = run.failure
    if not failure:
        angle, turn = state[:, 0] - state[:, 2], state[:, 3] - state[:, 5]
        failure = passing_through(clutch, *path_of(clutch, time, (way, angle), (speed, turn)))
    held = Outcome.BLOCKED if run.blocked else Outcome.TIMED_OUT
    valid = held if ring is None else Outcome.ENGAGED
    return End(Outcome.DIVERGED if failure else valid, failure, ring, actuator)


def times_of(ends: Sequence[End | Engagement]) -> Series:
    """List the times of ring and actuator, s, (n, 2): inf without travel, NaN if diverged."""
    every = [
        (math.nan, math.nan)
        if end.outcome is Outcome.DIVERGED
        else [math.inf if t is None else t for t in (end.shift_time, end.actuator_time)]
        for end in ends
    ]
    return np.array(every, dtype=float).reshape(-1, 2)


def conclude(clutch: Clutch, point: OperatingPoint, angle: float, run: Run, end: End) -> Engagement:
    """Work a result out of a run and its end.

    Times of a run count from the start of the force, those of the result from the command: a dead
    time later.
    """
    trace = trace_of(clutch, point, run.times, run.states)
    last = float(trace.time[-1]) if end.ring is None else end.ring
    touched = touches_of(clutch, trace)
    phases = phases_of(clutch, trace, touched, last)
    found = Engagement(
        clutch=clutch,
        point=point,
        relative_angle=angle,
        outcome=end.outcome,
        shift_time=end.shift_time,
        actuator_time=end.actuator_time,
        phases=phases,
        events=events_of(clutch, trace, touched),
        loads=loads_of(clutch, trace, touched, phases),
        steps=len(trace.time),
        evaluations=run.evaluations,
        detail=end.failure or end.outcome.message,
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


def passed_through(run: Run, end: End) -> bool:
    """Decide whether a shift diverged for its dogs alone, which finer steps may mend."""
    return end.outcome is Outcome.DIVERGED and not run.failure
