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
WINDOW_SHIFTS = 40  #: shifts over a window
WINDOW_FACTOR = 1.6  #: width over which shifts land, over that of a window
LATE_S = 0.02  #: time on crests from which a shift is late


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
        step = radius / POINTS
        (low, high) = self.leans
        tilt = -low + (high + low) * (np.arange(POINTS) + 0.5) / POINTS
        face, flank = ((math.sin(lean), math.cos(lean)) for lean in (-low, high))
        lengths = np.full(POINTS, radius * (high + low) / POINTS)
        distances = {count: step * (np.arange(count * POINTS) + 0.5) for count in (1, 4)}
        normals = np.column_stack([np.sin(tilt), np.cos(tilt)])
        points = [
            radius * normals,
            radius * np.array(face) - distances[4][:, None] * [face[1], -face[0]],
            radius * np.array(flank) + distances[1][:, None] * [flank[1], -flank[0]],
        ]
        directions = [normals, np.tile(face, (4 * POINTS, 1)), np.tile(flank, (POINTS, 1))]
        segments = [lengths, np.full(5 * POINTS, step)]
        return (
            np.concatenate(points) - [0.0, radius],
            np.concatenate(directions),
            np.concatenate(segments),
        )

    @property
    def leans(self) -> tuple[float, float]:
        """Angles of the normals of face and flank to the axis, either way, rad."""
        return self.chamfer, 0.5 * math.pi - self.traction

    def depth(self, places: Array) -> Array:
        """Compute the depth below the profile of places (..., 2), m; negative above it.

        Within the arc the normal is the place's own, beyond it that of the nearer face.
        """
        low, high = self.leans
        x = places[..., 0]
        z = places[..., 1] + self.radius
        tilt = np.clip(np.arctan2(x, z), -low, high)
        depth: Array = self.radius - x * np.sin(tilt) - z * np.cos(tilt)
        return depth

    def sections(self, offsets: Array, depth: float) -> tuple[Array, Array]:
        """Compute loads along and across the axis of sections, N/m, (m,) each.

        ``offsets`` are the overlaps of the ridges, m, (m,), and ``depth`` is that of one ridge
        below the other, m. The other ring is turned over: half a turn about the normal of the
        section.
        """
        points, normals, lengths = self.profile
        mate_points = -np.column_stack([offsets, np.full(len(offsets), depth)])[:, None] - points
        loads = np.maximum(self.depth(mate_points), 0.0) * lengths * self.stiffness
        return loads @ normals[:, 1], loads @ normals[:, 0]

    def pressed(self, overlap: float, depth: float, sections: int = 41) -> tuple[float, float]:
        """Compute loads along and across the axis on a dog, N, at an overlap of the ridges, m."""
        width = self.width + overlap * self.length / self.middle
        offsets = overlap + width * ((np.arange(sections) + 0.5) / sections - 0.5)
        axial, tangential = self.sections(offsets, depth)
        return float(axial.mean()) * self.length, float(tangential.mean()) * self.length

    def ratio(self, overlap: float, force: float) -> float:
        """Compute load across over load along the axis under a force on one dog, N."""
        low = 1e-8
        high = 1e-3
        for _ in range(15):
            depth = math.sqrt(low * high)
            axial, tangential = self.pressed(overlap, depth)
            if axial < force:
                low = depth
            else:
                high = depth
        return tangential / axial

    def window(self, force: float, friction: float) -> float:
        """Compute the width of overlap over which friction holds a dog under a force (N), m."""
        return self._end(force, friction, +1) + self._end(force, friction, -1)

    def _end(self, force: float, friction: float, side: int) -> float:
        low = 0.0
        high = 0.5 * self.width + 4.0 * self.radius * friction
        for _ in range(10):
            centre = 0.5 * (low + high)
            holds = abs(self.ratio(side * centre, force)) <= friction
            if holds:
                low = centre
            else:
                high = centre
        return low

    def hung_window(
        self, force: float, friction: float, stiction: float, time: float, count: int = 12
    ) -> float:
        """Compute the width of overlap in which creep stays for a time, m.

        Regularised friction (``sim.kernel.contact``) holds the load across at the slip
        ``stiction tan(pi ratio / (2 friction))``, m/s; ``time`` in s.
        """
        width = 0.0
        for side in (+1, -1):
            end = self._end(force, friction, side)
            overlaps = end * (np.arange(count) + 0.5) / count
            ratios = np.array([abs(self.ratio(side * float(a), force)) for a in overlaps])
            slip = stiction * np.tan(0.5 * math.pi * np.minimum(ratios / friction, 0.999))
            # Time to the end of the window, from the start of each place.
            time_to_end = np.cumsum((end / count / slip)[::-1])[::-1]
            starts = end * np.arange(count) / count
            if time_to_end[0] > time:
                width += float(np.interp(-time, -time_to_end, starts))
        return width

    def stiff_window(self, friction: float) -> float:
        """Compute the width of overlap over which friction holds stiff dogs, m."""
        return self.width + 4.0 * self.radius * math.sin(math.atan(friction))


def ridges_of(clutch: Clutch) -> Ridges:
    """Build the rounded crests of a clutch."""
    dog = clutch.dog
    lateral_travel = dog.height * math.tan(dog.traction) + 2.0 * crest_setback(dog, dog.edge_radius)
    width = lateral_travel / dog.mean_radius * dog.radial_width
    return Ridges(
        chamfer=dog.chamfer,
        traction=dog.traction,
        radius=dog.edge_radius,
        width=width,
        length=dog.radial_width,
        middle=dog.mean_radius,
        stiffness=clutch.contact.stiffness,
    )


def with_edge_radius(clutch: Clutch, radius: float) -> Clutch:
    """Set the radius of the edges of a clutch, m."""
    return replace(clutch, dog=replace(clutch.dog, edge_radius=radius))


def hang_and_late_widths(
    clutch: Clutch, point: OperatingPoint, width: float, shifts: int = WINDOW_SHIFTS
) -> tuple[float, float]:
    """Compute the widths of overlap over which shifts hang, and over which they engage late, m.

    Shifts land without mismatch at even overlaps over ``width`` (m) about ridge on ridge.
    """
    dog = clutch.dog
    plant = PlanarClutch(clutch.with_engine("planar"))
    centre = 2.0 * crest_setback(dog, dog.edge_radius)
    hung_count = 0
    late_count = 0
    for share in (np.arange(shifts) + 0.5) / shifts - 0.5:
        angle = (centre + width * float(share) - dog.crest_overlap) / dog.mean_radius
        result = engage(plant, point, angle)
        hung_count += result.outcome is Outcome.BLOCKED
        late_count += result.outcome is Outcome.ENGAGED and time_on_crests(result) > LATE_S
    return width * hung_count / shifts, width * late_count / shifts
