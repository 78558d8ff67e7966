r"""Closed form of crossing crests, where dogs hang by friction at any chamfer.

Two straight crests cross under the angle :math:`\psi = h \tan\beta/r`, over a width :math:`W =
\psi b` of overlap at the mean radius on both dogs. The common normal there is the axis. In a
compliant layer the rigid crest stands a depth :math:`\delta` below the other one. At the place *x*
along it the overlap is :math:`\ell = L + \psi x`; rigid face and flank press with the smaller of
the depths below both faces of the other dog. Summed over *x*, these loads are
:math:`N = k \delta^3 n/\psi` along the axis and :math:`T = k \delta^3 t/\psi` across, *n* and *t*
integrals over :math:`\ell/\delta` from :math:`(L - W/2)/\delta` to :math:`(L + W/2)/\delta`. Over
the whole pattern, :math:`-\tan\beta \le \ell/\delta \le \cot\alpha`, *t* vanishes; only where it
runs off the end of a dog there is something to hold. Friction holds where :math:`|T| \le \mu N`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.trace import crests_cross

#: Chamfer, traction and braking angle in deg, height in mm, dogs. The last two lean so far that
#: their crests cross over a wide overlap; both faces slide from rest by far.
DESIGNS = {
    "prototype": (8.0, 12.0, 22.0, 3.7, 15),
    "lean": (12.5, 20.0, 16.0, 4.5, 14),
    "steep face": (19.9, 15.0, 15.0, 3.5, 18),
}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Crests:
    """Two crests that cross.

    Parameters
    ----------
    chamfer, traction : rad.
    crossing : angle between them, rad.
    width : overlap at the mean radius over which the crossing lies on both dogs, m.
    stiffness : of the contact, Pa/m.
    """

    chamfer: float
    traction: float
    crossing: float
    width: float
    stiffness: float

    def sums(self, cells: int = 1200) -> tuple[Array, Array, Array]:
        """Compute overlaps l/delta and the integrals *n* and *t* up to each, (m,) each."""
        overlaps = np.linspace(-math.tan(self.traction), 1.0 / math.tan(self.chamfer), cells)
        face, flank = np.array([self._pressed(overlap) for overlap in overlaps]).T
        axial = math.cos(self.chamfer) * face + math.sin(self.traction) * flank
        tangential = math.cos(self.traction) * flank - math.sin(self.chamfer) * face
        return overlaps, _integrate(axial, overlaps), _integrate(tangential, overlaps)

    def _pressed(self, overlap: float) -> tuple[float, float]:
        """Compute the forces of the rigid face and flank at an overlap, over depth."""
        (ca, sa) = _cos_sin(self.chamfer)
        (cb, sb) = _cos_sin(self.traction)

        def below_face(y: float, z: float) -> float:
            return sa * y - ca * z

        def below_flank(y: float, z: float) -> float:
            return -(cb * y + sb * z)

        forces = []
        for direction in ((ca, sa), (-sb, cb)):  # up the rigid face, up the rigid flank
            depths = [
                (below(-overlap, -1.0), below(*direction)) for below in (below_face, below_flank)
            ]
            ends = [start / -slope for start, slope in depths if slope < 0.0]
            starts = [-start / slope for start, slope in depths if slope > 0.0]
            low = max([0.0, *starts])
            high = min(ends)
            positions = low + (high - low) * (np.arange(200) + 0.5) / 200
            depth_sum = np.minimum(*(start + slope * positions for start, slope in depths))
            touches = high > low and min(d + s * 0.5 * (low + high) for d, s in depths) > 0.0
            forces.append(float(depth_sum.mean() * (high - low)) if touches else 0.0)
        return forces[0], forces[1]

    def balance(self, overlap: Array, force: float) -> tuple[Array, Array]:
        """Compute depths, m, and T/N at overlaps (m,) under an axial force on a dog, N."""
        overlaps, axial, tangential = self.sums()
        depths = []
        ratios = []
        for position in overlap:
            low = position - 0.5 * self.width
            high = position + 0.5 * self.width

            def total(sums: Array, depth: float, a: float = low, b: float = high) -> float:
                return float(np.diff(np.interp([a / depth, b / depth], overlaps, sums))[0])

            low_depth = 1e-9
            high_depth = 2e-3
            for _ in range(60):
                depth = math.sqrt(low_depth * high_depth)
                load = self.stiffness * depth**3 / self.crossing * total(axial, depth)
                if load < force:
                    low_depth = depth
                else:
                    high_depth = depth
            depths.append(high_depth)
            ratios.append(total(tangential, high_depth) / total(axial, high_depth))
        return np.array(depths), np.array(ratios)


def _cos_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


def _integrate(values: Array, overlaps: Array) -> Array:
    means = 0.5 * (values[1:] + values[:-1])
    sums: Array = np.concatenate([[0.0], np.cumsum(means * np.diff(overlaps))])
    return sums


def crests_of(clutch: Clutch) -> Crests:
    """Build the crests of a clutch."""
    dog = clutch.dog
    crossing = dog.height * math.tan(dog.traction) / dog.mean_radius
    width = crossing * dog.radial_width
    return Crests(dog.chamfer, dog.traction, crossing, width, clutch.contact.stiffness)


def time_on_crests(shift: Engagement) -> float:
    """Compute the time of the crossing on both dogs at the depth of the crests, s."""
    trace = shift.trace
    crossing = crests_cross(shift.clutch, trace.relative_angle, trace.displacement)
    return float(np.diff(trace.time, prepend=0.0)[crossing].sum())
