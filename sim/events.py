"""What happened in a shift: face contacts, slots passed, rebound, holding, sliding."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.clutch import Clutch
from sim.phases import face_overlap, on_face, touching
from sim.trace import Trace

LIFT = 1e-4  #: m by which faces must part before a touch counts as a new one
STILL = 1e-3  #: m/s of slip below which faces count as held
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
        millimetre a second or below twice the stiction velocity, where
        regularised friction creeps and real friction holds.
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


def events_of(clutch: Clutch, trace: Trace) -> Events:
    """Return the events of a shift."""
    faces = on_face(clutch, trace)
    steps = np.diff(trace.time, prepend=trace.time[0])
    slip = np.abs(trace.relative_speed) * clutch.dog.mean_radius
    held = slip < max(STILL, 2.0 * clutch.contact.stiction_velocity)
    deepest = np.maximum.accumulate(trace.displacement)
    return Events(
        face_contacts=_landings(clutch, trace),
        slots_skipped=_skipped(clutch, trace),
        rebound=float((deepest - trace.displacement).max()),
        time_blocked=float(steps[faces & held].sum()),
        face_slide=float((slip * steps)[faces & ~held].sum()),
    )


def _landings(clutch: Clutch, trace: Trace) -> int:
    """Count touches of a face after a flight that parted it from that face."""
    touches, faces = touching(trace), on_face(clutch, trace)
    overlap, most = face_overlap(clutch, trace.relative_angle)
    level = clutch.dog.axial_gap + overlap * math.tan(clutch.dog.chamfer)
    apart = np.where(
        (overlap > 0.0) & (overlap < most), level - trace.displacement, clutch.dog.travel
    )
    started = np.flatnonzero(touches & ~np.concatenate([[False], touches[:-1]]))
    ended = np.flatnonzero(touches & ~np.concatenate([touches[1:], [False]]))
    count, left = 0, 0
    for first, last in zip(started.tolist(), ended.tolist(), strict=True):
        flown = apart[left : first + 1].max() - apart[left] if count else math.inf
        count += bool(flown > LIFT and faces[first : last + 1].any())
        left = last
    return count


def _skipped(clutch: Clutch, trace: Trace) -> int:
    """Count slots between the first one within reach and the one that was entered.

    Slot *k* lies between the angles k and k + 1 pitches. Dogs that stand on a face
    when the crests meet reach the next slot in the direction of the mismatch.
    """
    met = trace.displacement >= clutch.dog.axial_gap
    if not met.any():
        return 0
    start = int(np.argmax(met))
    pitch = clutch.dog.pitch_angle
    angle = float(trace.relative_angle[start])
    forward = trace.relative_speed[0] >= 0.0
    overlap, most = face_overlap(clutch, np.array([angle]))
    if 0.0 < overlap[0] < most:
        first = round(angle / pitch) - (0 if forward else 1)
    else:
        first = math.floor(angle / pitch)
    last = math.floor(float(trace.relative_angle[-1]) / pitch)
    return max(0, last - first if forward else first - last)
