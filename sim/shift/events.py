"""Where faces can meet, phases and events of a shift.

Phases, contiguous from the start of the force: *free fly* until the first touch, or until the
crests meet when no face is ever touched; *face contact* from the first touch of any kind to the
last one of a face, with every bounce, rebound and skipped slot in between; *entry* while the dogs
are in the slots and no flank has touched yet; *seating* from the first flank contact to the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.geometry import Dog, crest_loss, crest_setback
from dogshape.sim.shift.trace import Series, Trace

Flags = NDArray[np.bool_]

CREST_DEPTH = 1e-4  #: m about the crests' height within which crests can stand on each other
PHASES = ("free fly", "face contact", "entry", "seating")
LIFT = 1e-4  #: m by which faces must part before a touch counts as a new one
STILL = 1e-3  #: m/s of slip below which faces count as held
STILL_WINDOW = 0.02  #: s over which rings must stand still to count as blocked


@dataclass(frozen=True)
class Phase:
    """A named part of the shift, start and end in s."""

    name: str
    start: float
    end: float


@dataclass(frozen=True)
class Events:
    """Events of a shift."""

    face_contacts: int  #: how often a dog came down on the face of another
    slots_skipped: int  #: that the dogs could have reached and were carried past
    rebound: float  #: farthest way back from a depth once reached, m
    time_blocked: float  #: with face on face at a slip below ``STILL``, s
    face_slide: float  #: way that faces slid on each other, m


def ridge_overlap(dog: Dog, relative_angle: Series) -> Series:
    """Compute the overlap of two ridges at the mean radius, m, (n,): ``L = c + a r``.

    *c* is that at dogs facing dogs, *a* the angle from there. Faces overlap by L, and backs by -L.
    """
    radius, pitch = dog.mean_radius, dog.pitch_angle
    offset = (relative_angle + 0.5 * pitch) % pitch - 0.5 * pitch
    return dog.crest_overlap + offset * radius


def face_overlap(clutch: Clutch, relative_angle: Series) -> tuple[Series, Series]:
    """Compute the overlap of two faces, or backs, along the circumference, and its maximum, m.

    Each (n,). They part at 0, ridge on ridge, and at twice the width of a face or back.
    """
    dog, overlap = clutch.dog, ridge_overlap(clutch.dog, relative_angle)
    most = np.where(overlap > 0.0, 2.0 * dog.face_width, 2.0 * dog.back_width)
    return np.abs(overlap), most


def touch_depth(dog: Dog, relative_angle: Series) -> Series:
    """Compute the depth beyond ridge on ridge at which overlapping faces or backs touch, m, (n,).

    Those that overlap by L touch at a depth of ``L tan(chamfer)``.
    """
    overlap = ridge_overlap(dog, relative_angle)
    face, back = math.tan(dog.chamfer), -math.tan(dog.chamfer_back)
    return np.where(overlap > 0.0, overlap * face, overlap * back)


def faces_meet(clutch: Clutch, relative_angle: Series, displacement: Series) -> Flags:
    """Mark positions that allow a face to touch a face, (n,).

    A twentieth of the height is allowed for the turn of one face against the other.
    """
    overlap, most = face_overlap(clutch, relative_angle)
    touch = touch_depth(clutch.dog, relative_angle) + 0.05 * clutch.dog.height
    near = displacement - clutch.dog.axial_gap <= touch
    return (overlap > 0.0) & (overlap < most) & near


def crests_cross(clutch: Clutch, relative_angle: Series, displacement: Series) -> Flags:
    """Mark positions in which two crests cross within both dogs, at their depth, (n,).

    Straight crests stand twice their ``ridge_offset`` over the radius out of parallel where their
    overlap is zero at the mean radius, rounded ones more by their setback. The common normal is
    then the axis: friction holds whatever the chamfer, for rounded crests up to its angle beyond.
    """
    dog, radius = clutch.dog, clutch.dog.edge_radius
    back = 2.0 * crest_setback(dog, radius)
    crossing = abs(2.0 * dog.ridge_offset - back) / dog.mean_radius
    slope = math.sin(math.atan(clutch.contact.static_friction))
    beyond = 0.5 * crossing * dog.radial_width + 2.0 * radius * slope
    overlap = ridge_overlap(dog, relative_angle)
    depth = displacement - dog.axial_gap - 2.0 * crest_loss(dog, radius)
    flags: Flags = (np.abs(depth) < CREST_DEPTH) & (np.abs(overlap - back) <= beyond)
    return flags


def touching(trace: Trace) -> Flags:
    """Mark steps with a contact, (n,)."""
    pressed = trace.contact_force > 0.5 + 0.01 * trace.shift_force
    pressed[1:] |= np.abs(np.diff(trace.sliding_speed)) > 1e-6
    return pressed


def phases_of(
    clutch: Clutch, trace: Trace, touches: Flags, faces: Flags, end: float
) -> tuple[Phase, ...]:
    """Return the phases of a shift that ends at ``end``, s.

    ``touches`` marks steps with a contact, ``faces`` those with a face on a face, each (n,).
    """
    time = trace.time
    if faces.any():
        first, last = time[np.argmax(touches)], time[np.flatnonzero(faces)[-1]]
    else:
        met = trace.displacement >= clutch.dog.axial_gap
        first = last = time[np.argmax(met)] if met.any() else end
    flank = touches & (time > last)
    seat = time[np.argmax(flank)] if flank.any() else end
    marks = np.minimum([0.0, first, last, seat, end], end).tolist()
    return tuple(Phase(name, *ends) for name, ends in zip(PHASES, pairwise(marks), strict=True))


def events_of(clutch: Clutch, trace: Trace, faces: Flags) -> Events:
    """Return the events of a shift; ``faces`` (n,) as for ``phases_of``."""
    slip = np.abs(trace.relative_speed) * clutch.dog.mean_radius
    held = slip < STILL
    deepest = np.maximum.accumulate(trace.displacement)
    return Events(
        face_contacts=_landings(clutch, trace, faces),
        slots_skipped=_skipped(clutch, trace),
        rebound=float((deepest - trace.displacement).max()),
        time_blocked=float(trace.steps[faces & held].sum()),
        face_slide=float((slip * trace.steps)[faces & ~held].sum()),
    )


def _landings(clutch: Clutch, trace: Trace, faces: Flags) -> int:
    """Count touches of a face after a flight that parted it by ``LIFT``."""
    overlap, most = face_overlap(clutch, trace.relative_angle)
    level = clutch.dog.axial_gap + touch_depth(clutch.dog, trace.relative_angle)
    on_face = (overlap > 0.0) & (overlap < most)
    apart = np.where(on_face, level - trace.displacement, clutch.dog.travel)
    here = np.flatnonzero(faces)
    flights = [(a, b) for a, b in pairwise(here.tolist()) if b > a + 1]
    flown = [float(apart[a : b + 1].max() - apart[a]) for a, b in flights]
    return int(here.size > 0) + sum(one > LIFT for one in flown)


def _skipped(clutch: Clutch, trace: Trace) -> int:
    """Count slots between the first one within reach and the one that was entered.

    Slot *k* lies between the angles k and k + 1 pitches. Dogs that stand on a face
    when the crests meet reach the next slot in the direction of the mismatch.
    """
    met = trace.displacement >= clutch.dog.axial_gap
    if not met.any():
        return 0
    forward = trace.relative_speed[0] >= 0.0

    def slot(step: int) -> int:
        angle = trace.relative_angle[step : step + 1]
        overlap, most = face_overlap(clutch, angle)
        place = float(angle[0]) / clutch.dog.pitch_angle
        if trace.displacement[step] < clutch.shift_travel and 0.0 < overlap[0] < most[0]:
            return round(place) - (0 if forward else 1)
        return math.floor(place)

    first, last = slot(int(np.argmax(met))), slot(len(met) - 1)
    return max(0, last - first if forward else first - last)


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

    angle, way = last[:1] - last[2:3], last[1:2]
    overlap, most = face_overlap(clutch, angle)
    # Slip that would free a face from a face.
    free = min(overlap[0], most[0] - overlap[0]) if faces_meet(clutch, angle, way)[0] else math.inf
    room = clutch.shift_travel - float(way[0])
    return bool(radius * reach(turning) < 0.5 * free) and reach(sliding) < 0.5 * room
