"""Where faces can meet, phases and events of a shift.

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

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.geometry import crest_loss, crest_setback
from dogshape.sim.shift.trace import Series, Trace

Flags = NDArray[np.bool_]

CREST_DEPTH = 1e-4  #: m about the crests' height within which crests can stand on each other
PHASES = ("free fly", "face contact", "entry", "seating")


@dataclass(frozen=True)
class Phase:
    """A named part of the shift, start and end in s."""

    name: str
    start: float
    end: float


def face_overlap(clutch: Clutch, relative_angle: Series) -> tuple[Series, float]:
    """Compute the overlap of two faces along the circumference, (n,), and its maximum, m.

    At the mean radius ``L = c + a r``: *c* is the overlap of the crests at dogs
    facing dogs, *a* the angle from there. Faces part at L = 0, crest on crest, and
    at twice the width of a face.
    """
    dog = clutch.dog
    radius, pitch = dog.mean_radius, dog.pitch_angle
    offset = (relative_angle + 0.5 * pitch) % pitch - 0.5 * pitch
    return dog.crest_overlap + offset * radius, 2.0 * dog.face_width


def faces_meet(clutch: Clutch, relative_angle: Series, displacement: Series) -> Flags:
    """Mark positions that allow a face to touch a face, (n,).

    Faces that overlap by L touch at a depth of ``L tan(chamfer)``; a twentieth
    of the height is allowed for the turn of one face against the other.
    """
    overlap, most = face_overlap(clutch, relative_angle)
    touch = overlap * math.tan(clutch.dog.chamfer) + 0.05 * clutch.dog.height
    near = displacement - clutch.dog.axial_gap <= touch
    return (overlap > 0.0) & (overlap < most) & near


def face_left(clutch: Clutch, relative_angle: float, displacement: float) -> float:
    """Return the slip that would free a face from a face, m; infinite where none can touch."""
    angle, way = np.array([relative_angle]), np.array([displacement])
    if not faces_meet(clutch, angle, way)[0]:
        return math.inf
    overlap, most = face_overlap(clutch, angle)
    return float(min(overlap[0], most - overlap[0]))


def crests_cross(clutch: Clutch, relative_angle: Series, displacement: Series) -> Flags:
    """Mark positions in which two crests cross within both dogs, at their depth, (n,).

    Crests are straight; where their overlap is zero at the mean radius they stand
    ``height tan(traction) / radius`` out of parallel, rounded ones more by what they stand back.
    There the common normal is the axis, and
    friction holds whatever the chamfer (``tests/verification/crests.py``). Ridges of rounded crests
    stand lower and farther back, and friction holds their slopes up to its angle beyond
    (``tests/verification/ridges.py``).
    """
    dog, radius = clutch.dog, clutch.dog.edge_radius
    back = 2.0 * crest_setback(dog, radius)
    crossing = (dog.height * math.tan(dog.traction) + back) / dog.mean_radius
    slope = math.sin(math.atan(clutch.contact.static_friction))
    beyond = 0.5 * crossing * dog.radial_width + 2.0 * radius * slope
    overlap, _ = face_overlap(clutch, relative_angle)
    depth = displacement - dog.axial_gap - 2.0 * crest_loss(dog, radius)
    near = np.abs(depth) < CREST_DEPTH
    flags: Flags = near & (np.abs(overlap - back) <= beyond)
    return flags


def touching(trace: Trace) -> Flags:
    """Mark steps with a contact, (n,)."""
    pressed = trace.contact_force > 0.5 + 0.01 * trace.shift_force
    turned = np.abs(trace.sliding_speed[1:] - trace.sliding_speed[:-1]) > 1e-6
    pressed[1:] |= turned
    return pressed


@dataclass(frozen=True)
class Touches:
    """Steps of a shift with any contact, and with faces on faces, each (n,)."""

    any: Flags
    faces: Flags


def touches_of(clutch: Clutch, trace: Trace) -> Touches:
    """Mark steps with a contact."""
    touches = touching(trace)
    near = faces_meet(clutch, trace.relative_angle, trace.displacement)
    return Touches(touches, touches & near)


def phases_of(clutch: Clutch, trace: Trace, touched: Touches, end: float) -> tuple[Phase, ...]:
    """Return the phases of a shift that ends at ``end``, s."""
    touches, faces = touched.any, touched.faces
    if faces.any():
        first = float(trace.time[np.argmax(touches)])
        last = float(trace.time[len(faces) - 1 - np.argmax(faces[::-1])])
    else:
        met = trace.displacement >= clutch.dog.axial_gap
        first = last = float(trace.time[np.argmax(met)]) if met.any() else end
    flank = touches & (trace.time > last)
    seat = float(trace.time[np.argmax(flank)]) if flank.any() else end
    marks = np.minimum([0.0, first, last, seat, end], end)
    return tuple(
        Phase(name, float(a), float(b))
        for name, a, b in zip(PHASES, marks[:-1], marks[1:], strict=True)
    )


LIFT = 1e-4  #: m by which faces must part before a touch counts as a new one
STILL = 1e-3  #: m/s of slip below which faces count as held
STILL_WINDOW = 0.02  #: s over which rings must stand still to count as blocked
SLID = 5e-5  #: m of sliding from which faces count as having slid


@dataclass(frozen=True)
class Events:
    """Events of a shift.

    Parameters
    ----------
    face_contacts : how often a dog came down on the face of another.
    slots_skipped : slots that the dogs could have reached and were carried past.
    rebound : farthest way back from a depth once reached, m.
    time_blocked : time with face on face held by friction, s: slip below a
        millimetre a second.
    face_slide : way that faces slid on each other, m.
    """

    face_contacts: int
    slots_skipped: int
    rebound: float
    time_blocked: float
    face_slide: float

    @property
    def chamfer_slid(self) -> bool:
        """Whether faces slid on each other."""
        return self.face_slide > SLID


def events_of(clutch: Clutch, trace: Trace, touched: Touches) -> Events:
    """Return the events of a shift."""
    faces, steps = touched.faces, trace.steps
    slip = np.abs(trace.relative_speed) * clutch.dog.mean_radius
    held = slip < STILL
    deepest = np.maximum.accumulate(trace.displacement)
    return Events(
        face_contacts=_landings(clutch, trace, faces),
        slots_skipped=_skipped(clutch, trace),
        rebound=float((deepest - trace.displacement).max()),
        time_blocked=float(steps[faces & held].sum()),
        face_slide=float((slip * steps)[faces & ~held].sum()),
    )


def stands_still(
    clutch: Clutch, point: OperatingPoint, time: float, before: Series | None, now: Series
) -> bool:
    """Decide whether the rings are held, once the force is half up and would move free ones.

    Parameters
    ----------
    time : of ``now``, s.
    before, now : states as ``sim.shift.conclusion.Run`` has them, one ``STILL_WINDOW`` apart; None
        where there is none.
    """
    profile = point.profile
    if before is None or profile.at(time - STILL_WINDOW) < 0.5 * profile.net_force:
        return False
    states = np.array([before, now])
    if clutch.mechanism.has_shafts:
        # What hangs on a ring may still turn, in its play or on its shaft, and set the ring going.
        behind = np.abs(states[:, [9, 11]] - states[:, [5, 3]]).max()
        if clutch.dog.mean_radius * behind > STILL:
            return False
    return stays_held(clutch, states, STILL_WINDOW, clutch.timeout - time)


def stays_held(clutch: Clutch, states: Series, span: float, left: float) -> bool:
    """Decide whether rings stand still, and creep and its growth would not free them in time.

    Parameters
    ----------
    states : output angle, displacement, sliding angle and their rates first, (n, 6 or more), over
        the last ``span`` s.
    left : time to the time-out, s.
    """
    radius, last = clutch.dog.mean_radius, states[-1]
    turning, sliding = states[:, 3] - states[:, 5], states[:, 4]
    if max(radius * np.abs(turning).max(), abs(last[4])) > STILL:
        return False

    def reach(rates: Series) -> float:
        growth = abs(float(rates[-1] - rates[0])) / span
        return float(np.abs(rates).max()) * left + 0.5 * growth * left**2

    free = face_left(clutch, float(last[0] - last[2]), float(last[1]))
    room = clutch.shift_travel - float(last[1])
    return radius * reach(turning) < 0.5 * free and reach(sliding) < 0.5 * room


def _landings(clutch: Clutch, trace: Trace, faces: Flags) -> int:
    """Count touches of a face after a flight that parted it; ``faces`` (n,) as in ``Touches``."""
    overlap, most = face_overlap(clutch, trace.relative_angle)
    level = clutch.dog.axial_gap + overlap * math.tan(clutch.dog.chamfer)
    apart = np.where(
        (overlap > 0.0) & (overlap < most), level - trace.displacement, clutch.dog.travel
    )
    here = np.flatnonzero(faces)
    flights = np.flatnonzero(here[1:] > here[:-1] + 1)
    flown = (apart[here[k] : here[k + 1] + 1].max() - apart[here[k]] for k in flights.tolist())
    return int(here.size > 0) + sum(bool(one > LIFT) for one in flown)


def _skipped(clutch: Clutch, trace: Trace) -> int:
    """Count slots between the first one within reach and the one that was entered.

    Slot *k* lies between the angles k and k + 1 pitches. Dogs that stand on a face
    when the crests meet reach the next slot in the direction of the mismatch.
    """
    met = trace.displacement >= clutch.dog.axial_gap
    if not met.any():
        return 0
    start = int(np.argmax(met))
    angle = float(trace.relative_angle[start])
    forward = trace.relative_speed[0] >= 0.0
    first = _slot(clutch, angle, forward)
    last = _slot(clutch, float(trace.relative_angle[-1]), forward)
    return max(0, last - first if forward else first - last)


def _slot(clutch: Clutch, angle: float, forward: bool) -> int:
    """Return the slot at an angle, or on a face the next one in the direction of motion."""
    overlap, most = face_overlap(clutch, np.array([angle]))
    place = angle / clutch.dog.pitch_angle
    if 0.0 < overlap[0] < most:
        return round(place) - (0 if forward else 1)
    return math.floor(place)
