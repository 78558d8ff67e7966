"""Where faces can meet, phases and events of a shift.

Phases, contiguous from the start of the force: *free fly* until the first touch, or until the
crests meet when no face is ever touched; *face contact* from the first touch of any kind to the
last one of a face, with every bounce, rebound and skipped slot in between; *entry* while the dogs
are in the slots and no flank has touched yet; *seating* from the first flank contact to the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.geometry import crest_loss, crest_setback
from dogshape.sim.shift.trace import Series

Flags = NDArray[np.bool_]

CREST_DEPTH = 1e-4  #: m about the crests' height within which crests can stand on each other
PHASES = ("free fly", "face contact", "entry", "seating")


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
    time_blocked: float  #: with face on face at a slip below ``sim.kernel.STILL``, s
    face_slide: float  #: way that faces slid on each other, m


def crests_cross(clutch: Clutch, relative_angle: Series, displacement: Series) -> Flags:
    """Mark positions in which two crests cross within both dogs, at their depth, (n,).

    Straight crests stand twice their ``ridge_offset`` over the radius out of parallel where their
    overlap is zero at the mean radius, rounded ones more by their setback. The common normal is
    then the axis: friction holds whatever the chamfer, for rounded crests up to its angle beyond.
    """
    from dogshape.sim import kernel  # noqa: PLC0415  slow to load, and results have no need of it

    dog, radius = clutch.dog, clutch.dog.edge_radius
    back = 2.0 * crest_setback(dog, radius)
    crossing = abs(2.0 * dog.ridge_offset - back) / dog.mean_radius
    slope = math.sin(math.atan(clutch.contact.static_friction))
    beyond = 0.5 * crossing * dog.radial_width + 2.0 * radius * slope
    overlap = kernel.face_overlap(relative_angle, clutch.numbers)
    depth = displacement - dog.axial_gap - 2.0 * crest_loss(dog, radius)
    flags: Flags = (np.abs(depth) < CREST_DEPTH) & (np.abs(overlap - back) <= beyond)
    return flags
