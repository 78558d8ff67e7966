"""Where faces can meet, and the phases of a shift.

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

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.flank import crest_loss, crest_setback
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
