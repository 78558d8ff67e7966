r"""Rounded crests that cross, by sections of their exact profile.

``docs/simulation.md`` has height and setback *s* of the ridge of a crest rounded with
:math:`\varrho`. Across the crests two ridges *e* beside each other are two circles. Where they
overlap by *d*, their normal leans by :math:`\sin\theta = e/(2\varrho - d)`, and they press with
:math:`\tfrac{4}{3} k \sqrt{2 R}\, d^{3/2}`, :math:`R = \varrho/2`. Along a dog *e* runs over
:math:`W = (h \tan\beta + 2 s) b/r`. Beyond, the ends touch with a slope that friction of the angle
:math:`\rho` holds while :math:`e \le 2 \varrho \sin\rho`: stiff dogs hang over :math:`W + 4 \varrho
\sin\rho`. Softer ones touch with faces too: ``Ridges`` sums the pressure over sections of the exact
profile, with nothing of the engines' planes and polygons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome, engage
from dogshape.sim.shift.geometry import crest_setback
from dogshape.sim.shift.planar import PlanarClutch
from tests.verification.crests import time_on_crests

Array = NDArray[np.float64]
POINTS = 120  #: of a profile's arc, and of a radius along its faces
HUNG = 40  #: shifts over a window
WIDER = 1.6  #: of a window, over which shifts land
LONG = 0.02  #: s on crests from which a shift counts as late


@dataclass(frozen=True)
class Ridges:
    """Two rounded crests that cross, by sections of their exact profile.

    Parameters
    ----------
    chamfer, traction : rad.
    radius : of the crests, m.
    width : lateral way of one ridge against the other along a dog, m, where they meet half way.
    length, middle : of a dog along the radius, and its mean radius, m.
    stiffness : of the contact, Pa/m.
    """

    chamfer: float
    traction: float
    radius: float
    width: float
    length: float
    middle: float
    stiffness: float

    @cached_property
    def profile(self) -> tuple[Array, Array, Array]:
        """Points (n, 2) of flank, arc and face about the ridge, m; their normals and lengths.

        The first axis points to the traction side, the second up; the ridge is the origin.
        """
        radius = self.radius
        step, (low, high) = radius / POINTS, self.leans
        tilt = -low + (high + low) * (np.arange(POINTS) + 0.5) / POINTS
        face, flank = ((math.sin(lean), math.cos(lean)) for lean in (-low, high))
        lengths = np.full(POINTS, radius * (high + low) / POINTS)
        ways = {count: step * (np.arange(count * POINTS) + 0.5) for count in (1, 4)}
        normals = np.column_stack([np.sin(tilt), np.cos(tilt)])
        places = [
            radius * normals,
            radius * np.array(face) - ways[4][:, None] * [face[1], -face[0]],
            radius * np.array(flank) + ways[1][:, None] * [flank[1], -flank[0]],
        ]
        sides = [normals, np.tile(face, (4 * POINTS, 1)), np.tile(flank, (POINTS, 1))]
        sizes = [lengths, np.full(5 * POINTS, step)]
        return np.concatenate(places) - [0.0, radius], np.concatenate(sides), np.concatenate(sizes)

    @property
    def leans(self) -> tuple[float, float]:
        """Angles of the normals of face and flank to the axis, either way, rad."""
        return self.chamfer, 0.5 * math.pi - self.traction

    def depth(self, places: Array) -> Array:
        """Compute the depth below the profile of places (..., 2), m; negative above it.

        Within the arc the normal is the place's own, beyond it that of the nearer face.
        """
        low, high = self.leans
        x, z = places[..., 0], places[..., 1] + self.radius
        tilt = np.clip(np.arctan2(x, z), -low, high)
        depth: Array = self.radius - x * np.sin(tilt) - z * np.cos(tilt)
        return depth

    def sections(self, aside: Array, depth: float) -> tuple[Array, Array]:
        """Return loads along and across the axis of sections, N/m, each (m,).

        ``aside`` is how far the ridges overlap, (m,), ``depth`` how deep one stands below the
        other, m. The other ring is turned over: half a turn about the normal of the section.
        """
        places, normals, lengths = self.profile
        theirs = -np.column_stack([aside, np.full(len(aside), depth)])[:, None] - places
        loads = np.maximum(self.depth(theirs), 0.0) * lengths * self.stiffness
        return loads @ normals[:, 1], loads @ normals[:, 0]

    def pressed(self, overlap: float, depth: float, sections: int = 41) -> tuple[float, float]:
        """Return loads along and across the axis on a dog, N, at an overlap of the ridges, m."""
        width = self.width + overlap * self.length / self.middle
        aside = overlap + width * ((np.arange(sections) + 0.5) / sections - 0.5)
        along, across = self.sections(aside, depth)
        return float(along.mean()) * self.length, float(across.mean()) * self.length

    def ratio(self, overlap: float, force: float) -> float:
        """Return load across over load along the axis under a force on one dog, N."""
        low, high = 1e-8, 1e-3
        for _ in range(15):
            depth = math.sqrt(low * high)
            along, across = self.pressed(overlap, depth)
            low, high = (depth, high) if along < force else (low, depth)
        return across / along

    def window(self, force: float, friction: float) -> float:
        """Return the width of overlap, m, over which friction holds one dog under a force, N."""
        return self._end(force, friction, +1) + self._end(force, friction, -1)

    def _end(self, force: float, friction: float, side: int) -> float:
        low, high = 0.0, 0.5 * self.width + 4.0 * self.radius * friction
        for _ in range(10):
            middle = 0.5 * (low + high)
            held = abs(self.ratio(side * middle, force)) <= friction
            low, high = (middle, high) if held else (low, middle)
        return low

    def hung_window(
        self, force: float, friction: float, stiction: float, left: float, places: int = 12
    ) -> float:
        """Return the width of overlap, m, from which creep does not lead out of the window in time.

        Regularised friction (``sim.kernel.friction_at``) holds the load across at the slip
        ``stiction tan(pi ratio / (2 friction))``, m/s; ``left`` in s.
        """
        width = 0.0
        for side in (+1, -1):
            end = self._end(force, friction, side)
            aside = end * (np.arange(places) + 0.5) / places
            ratios = np.array([abs(self.ratio(side * float(a), force)) for a in aside])
            slip = stiction * np.tan(0.5 * math.pi * np.minimum(ratios / friction, 0.999))
            # Time to the end of the window, from the start of each place.
            rest = np.cumsum((end / places / slip)[::-1])[::-1]
            starts = end * np.arange(places) / places
            width += float(np.interp(-left, -rest, starts)) if rest[0] > left else 0.0
        return width

    def stiff_window(self, friction: float) -> float:
        """Return the width of overlap over which friction holds stiff dogs, m."""
        return self.width + 4.0 * self.radius * math.sin(math.atan(friction))


def ridges_of(clutch: Clutch) -> Ridges:
    """Return the rounded crests of a clutch."""
    dog = clutch.dog
    off = dog.height * math.tan(dog.traction) + 2.0 * crest_setback(dog, dog.edge_radius)
    width = off / dog.mean_radius * dog.radial_width
    return Ridges(
        dog.chamfer, dog.traction, dog.edge_radius, width, dog.radial_width, dog.mean_radius,
        clutch.contact.stiffness,
    )  # fmt: skip


def rounded(clutch: Clutch, radius: float) -> Clutch:
    """Return a clutch with edges of another radius, m."""
    return replace(clutch, dog=replace(clutch.dog, edge_radius=radius))


def share_held(
    clutch: Clutch, point: OperatingPoint, over: float, shifts: int = HUNG
) -> tuple[float, float]:
    """Return the widths of overlap, m, over which shifts hang and over which they engage late.

    They land without mismatch at even overlaps over the width ``over`` about ridge on ridge.
    """
    dog, plant = clutch.dog, PlanarClutch(clutch.with_engine("planar"))
    middle, hung, late = 2.0 * crest_setback(dog, dog.edge_radius), 0, 0
    for share in (np.arange(shifts) + 0.5) / shifts - 0.5:
        angle = (middle + over * float(share) - dog.crest_overlap) / dog.mean_radius
        found = engage(plant, point, angle)
        hung += found.outcome is Outcome.BLOCKED
        late += found.outcome is Outcome.ENGAGED and time_on_crests(found) > LONG
    return over * hung / shifts, over * late / shifts
