"""One engagement: from the start of the force to full depth.

Outcomes are values, not exceptions: a shift that blocks, runs out of time or
diverges is a result like any other. The simulator's monitor records every step
and stops the run; everything else is worked out afterwards from the record.

Phases, contiguous from the start of the force:

free fly
    until the first touch, or until the crests meet when no face is ever touched.
face contact
    from the first touch of any kind to the last one of a face: dog on dog with
    every bounce, rebound and skipped slot in between.
entry
    the dogs are in the slots and no flank has touched yet.
seating
    from the first flank contact to the end of the travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, EventStatus

from sim.clutch import Clutch, OperatingPoint
from sim.plant import ClutchPlant

Series = NDArray[np.float64]

STILL_WINDOW = 0.02  #: s over which rings must stand still to count as blocked
STEP_LIMIT = 400_000  #: steps after which a run counts as diverged


class Outcome(Enum):
    """How a shift ended."""

    ENGAGED = "engaged"
    BLOCKED = "blocked"
    TIMED_OUT = "timed_out"
    DIVERGED = "diverged"

    @property
    def message(self) -> str:
        """What the outcome means, in words."""
        return _MESSAGES[self]


_MESSAGES = {
    Outcome.ENGAGED: "the sliding ring reached full depth",
    Outcome.BLOCKED: "the rings stand still on each other, dog on dog, held by friction",
    Outcome.TIMED_OUT: "full depth was not reached before the time-out",
    Outcome.DIVERGED: "the integration failed",
}


@dataclass(frozen=True)
class Phase:
    """A named part of the shift, start and end in s."""

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class Trace:
    """Time series of a shift, each (n,), SI units.

    ``contact_force`` is the mean axial contact force of the step that ends at
    each time, from the momentum balance of the sliding ring.
    """

    time: Series
    displacement: Series
    axial_speed: Series
    sliding_speed: Series
    output_speed: Series
    relative_angle: Series
    shift_force: Series
    contact_force: Series


@dataclass(frozen=True)
class Engagement:
    """Result of one shift, with its problem.

    ``shift_time`` is in s, None unless engaged; ``peak_axial_force`` in N is the
    largest axial contact force of the whole ring.
    """

    clutch: Clutch
    point: OperatingPoint
    relative_angle: float
    outcome: Outcome
    shift_time: float | None
    phases: tuple[Phase, ...]
    peak_axial_force: float
    steps: int
    detail: str
    trace: Trace


class _Record:
    """Monitor of a run: keeps every step and says when to stop."""

    def __init__(self, plant: ClutchPlant, point: OperatingPoint) -> None:
        clutch = plant.clutch
        self.plant = plant
        self.point = point
        self.travel = clutch.shift_travel
        self.timeout = clutch.timeout
        self.clutch = clutch
        self.force = point.profile.force
        self.radius = clutch.dog.mean_radius
        self.times: list[float] = []
        self.states: list[Series] = []
        self.blocked = False
        self._check_at = STILL_WINDOW
        self._last: Series | None = None

    def __call__(self, context: Context) -> EventStatus | None:
        time = context.get_time()
        state = self.plant.state()
        self.times.append(time)
        self.states.append(state)
        if state[1] >= self.travel:
            return self._stop("engaged")
        if len(self.times) > STEP_LIMIT or not math.isfinite(state[1]):
            raise RuntimeError(f"no end after {len(self.times)} steps at {time:.6g} s")
        if time >= self._check_at and self._stands_still(time, state):
            self.blocked = True
            return self._stop("blocked")
        return None

    def _stands_still(self, time: float, state: Series) -> bool:
        """Tell whether the rings are held: creep and its growth would not free them in time.

        The force must be half up: then a ring that nothing holds would move.
        """
        last, self._last = self._last, state
        self._check_at = time + STILL_WINDOW
        if last is None or self.point.profile.at(time - STILL_WINDOW) < 0.5 * self.force:
            return False
        left = self.timeout - time

        def reach(rate: float, before: float) -> float:
            growth = abs(rate - before) / STILL_WINDOW
            return max(abs(rate), abs(before)) * left + 0.5 * growth * left**2

        turn = self.radius * reach(state[3] - state[5], last[3] - last[5])
        slide = reach(float(state[4]), float(last[4]))
        free = face_left(self.clutch, float(state[0] - state[2]), float(state[1]))
        return turn < 0.5 * free and slide < 0.5 * (self.travel - float(state[1]))

    def _stop(self, reason: str) -> EventStatus:
        return EventStatus.ReachedTermination(self.plant.plant, reason)


def engage(plant: ClutchPlant, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift.

    Parameters
    ----------
    plant : built once for a clutch and used again.
    point : mismatch and force.
    relative_angle : output ring's lead over dogs facing dogs, rad.

    Returns
    -------
    Engagement
        Never raises for physical failure; a failed integration is an outcome.
    """
    record = _Record(plant, point)
    simulator = plant.start(point, relative_angle)
    simulator.set_monitor(record)
    detail = ""
    try:
        record(plant.context)
        simulator.AdvanceTo(plant.clutch.timeout)
    except RuntimeError as error:
        if len(record.times) < 2:
            raise  # not a step was made: the model is wrong, not the motion
        detail = str(error).split("\n")[0]
    finally:
        simulator.clear_monitor()
    return _conclude(plant.clutch, point, relative_angle, record, detail)


def _conclude(
    clutch: Clutch, point: OperatingPoint, angle: float, record: _Record, detail: str
) -> Engagement:
    trace = _trace(clutch, point, record)
    engaged = bool(trace.displacement[-1] >= clutch.shift_travel)
    outcome = Outcome.TIMED_OUT
    if detail:
        outcome = Outcome.DIVERGED
    elif engaged:
        outcome = Outcome.ENGAGED
    elif record.blocked:
        outcome = Outcome.BLOCKED
    end = _crossing(trace, clutch.shift_travel) if engaged else float(trace.time[-1])
    return Engagement(
        clutch=clutch,
        point=point,
        relative_angle=angle,
        outcome=outcome,
        shift_time=end if outcome is Outcome.ENGAGED else None,
        phases=_phases(clutch, trace, end),
        peak_axial_force=float(trace.contact_force.max()),
        steps=len(trace.time),
        detail=detail or outcome.message,
        trace=trace,
    )


def _trace(clutch: Clutch, point: OperatingPoint, record: _Record) -> Trace:
    time = np.array(record.times)
    states = np.array(record.states)
    mass = clutch.rings.mass
    keep = np.concatenate([[True], np.diff(time) > 0.0])
    time, states = time[keep], states[keep]
    free_speed = np.array([point.profile.free_speed(t, mass) for t in time])
    lost = np.diff(free_speed) - np.diff(states[:, 4])
    force = mass * lost / np.diff(time)
    return Trace(
        time=time,
        displacement=states[:, 1],
        axial_speed=states[:, 4],
        sliding_speed=states[:, 5],
        output_speed=states[:, 3],
        relative_angle=states[:, 0] - states[:, 2],
        shift_force=np.array([point.profile.at(t) for t in time]),
        contact_force=np.concatenate([[0.0], force]),
    )


def _crossing(trace: Trace, way: float) -> float:
    """Return when the displacement reaches ``way``, s: cubic between two steps."""
    (t0, t1), (x0, x1) = trace.time[-2:], trace.displacement[-2:]
    v0, v1 = trace.axial_speed[-2:]
    step = t1 - t0
    low, high = 0.0, 1.0
    for _ in range(50):
        s = 0.5 * (low + high)
        x = (
            (1 + 2 * s) * (1 - s) ** 2 * x0
            + s * (1 - s) ** 2 * step * v0
            + s * s * (3 - 2 * s) * x1
            + s * s * (s - 1) * step * v1
        )
        low, high = (low, s) if x >= way else (s, high)
    return float(t0 + 0.5 * (low + high) * step)


def _face_overlap(clutch: Clutch, relative_angle: Series) -> tuple[Series, float]:
    """Return how far two faces overlap along the circumference, (n,), and the most, m.

    At the mean radius ``L = 2 c + a r``: *c* is the crest's distance from the
    middle of the dog, *a* the angle from dogs facing dogs. Faces part at L = 0,
    crest on crest, and at twice the width of a face.
    """
    dog = clutch.dog
    radius, pitch = dog.mean_radius, dog.pitch_angle
    offset = (relative_angle + 0.5 * pitch) % pitch - 0.5 * pitch
    crest = 0.25 * pitch * radius - 0.5 * dog.height * math.tan(dog.traction)
    face = dog.tip_width + dog.edge_drop * math.tan(dog.braking)
    return 2.0 * crest + offset * radius, 2.0 * face


def faces_meet(clutch: Clutch, relative_angle: Series, displacement: Series) -> NDArray[np.bool_]:
    """Tell where the position allows a face to touch a face, (n,).

    Faces that overlap by L touch at a depth of ``L tan(chamfer)``; a twentieth
    of the height is allowed for the turn of one face against the other.
    """
    overlap, most = _face_overlap(clutch, relative_angle)
    touch = overlap * math.tan(clutch.dog.chamfer) + 0.05 * clutch.dog.height
    near = displacement - clutch.dog.axial_gap <= touch
    return (overlap > 0.0) & (overlap < most) & near


def face_left(clutch: Clutch, relative_angle: float, displacement: float) -> float:
    """Return the slip that would free a face from a face, m; infinite where none can touch."""
    angle, way = np.array([relative_angle]), np.array([displacement])
    if not faces_meet(clutch, angle, way)[0]:
        return math.inf
    overlap, most = _face_overlap(clutch, angle)
    return float(min(overlap[0], most - overlap[0]))


def _phases(clutch: Clutch, trace: Trace, end: float) -> tuple[Phase, ...]:
    touching = trace.contact_force > 0.5 + 0.01 * trace.shift_force
    turned = np.abs(np.diff(trace.sliding_speed, prepend=trace.sliding_speed[0])) > 1e-6
    touching |= turned
    on_face = touching & faces_meet(clutch, trace.relative_angle, trace.displacement)
    if on_face.any():
        first = float(trace.time[np.argmax(touching)])
        last = float(trace.time[len(on_face) - 1 - np.argmax(on_face[::-1])])
    else:
        met = trace.displacement >= clutch.dog.axial_gap
        first = last = float(trace.time[np.argmax(met)]) if met.any() else end
    on_flank = touching & (trace.time > last)
    seat = float(trace.time[np.argmax(on_flank)]) if on_flank.any() else end
    marks = np.minimum([0.0, first, last, seat, end], end)
    names = ("free fly", "face contact", "entry", "seating")
    return tuple(
        Phase(name, float(a), float(b))
        for name, a, b in zip(names, marks[:-1], marks[1:], strict=True)
    )
