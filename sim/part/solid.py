r"""The ring as a part: a closed surface for printing and drawing, and its exact volume.

A ring is a body of constant thickness below the floors of the slots and, above
it, the toothed side of ``sim.part.profile``. Seen along the axis no line of that side
hides another: it is the graph of a height over the annulus, with vertical flanks
as the limit. The surface here is that graph on finitely many lines, the
underside, and two walls of vertical strips; it cannot cut itself while the lines
keep their order.

Volume by integrals that know nothing of the triangles:

.. math::
    V = \pi (r_o^2 - r_i^2)\, b + N \left[\tfrac{1}{4}\vartheta h (r_o^2 - r_i^2)
        - V_{chamfer} + V_{fillets} - V_{roundings}\right]

The first term in brackets is exact: what the leaning flanks take from the dog above
the median plane they add below it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import GeometryError, refusal
from dogshape.sim.part.profile import (
    Corner,
    Lines,
    dog_corners,
    largest_root_radius,
    profile,
    require_room,
)
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import Cells, Mesh, rotation
from dogshape.sim.shift.planes import Vertices

__all__ = ["largest_root_radius", "mated", "part_volume", "ring_part"]

SEGMENTS = 8  #: of the arc of a fillet or rounding
STEP = math.radians(2.0)  #: largest angle between neighbouring lines, rad
_SAME = 1e-9  #: lines closer than this, rad, stand one above the other
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


def ring_part(
    dog: Dog, root_radius: float, body: float, segments: int = SEGMENTS, step: float = STEP
) -> Mesh:
    """Return one ring as a closed triangle surface with normals outwards.

    Parameters
    ----------
    root_radius : of fillets, and of tips without a radius of their own, m; 0 gives sharp corners.
    body : thickness of the ring below the floors of the slots, m.
    segments : flat strips of each fillet and rounding.
    step : largest angle between neighbouring lines, rad; volume errs by step²/6.

    Raises
    ------
    GeometryError
        Fillets or roundings do not fit, or the body has no thickness.
    """
    require_body(body)
    pieces = [p for p in profile(dog, root_radius, segments, step) if len(p.points)]
    lines = Lines(
        np.concatenate([p.points for p in pieces]), np.concatenate([p.directions for p in pieces])
    )
    inner, outer = lines.at(dog.inner_radius), lines.at(dog.outer_radius)
    columns = _columns(inner, outer)
    pitch = _Pitch(len(inner), columns, inner[:, 2])
    heads = np.array([column[0] for column in columns])
    under = np.array([1.0, 1.0, 0.0])
    depth = np.array([0.0, 0.0, -0.5 * dog.height - body])
    feet = (inner[heads] * under + depth, outer[heads] * under + depth)
    return _all_round(dog, np.concatenate([inner, outer, *feet]), pitch.cells())


def require_body(body: float) -> None:
    """Raise GeometryError unless the body has a thickness, m."""
    if not 0.0 < body < 1.0:
        rule = "a ring needs a body between 0 and 1000 mm to carry its dogs"
        message = refusal("body_mm", body * 1e3, "mm", rule, "give its thickness in millimetres")
        raise GeometryError(message)


def mated(dog: Dog, mesh: Mesh, opening: float = 0.0) -> Mesh:
    """Return the other ring of a pair: turned over about x, dogs facing slots.

    ``opening`` is the axial way back from full depth, m: ``dog.travel`` at the start.
    """
    turn = rotation(0.5 * dog.pitch_angle) @ np.diag([1.0, -1.0, -1.0])
    return Mesh(mesh.vertices @ turn.T + [0.0, 0.0, opening], mesh.cells)


def _columns(inner: Vertices, outer: Vertices) -> list[list[int]]:
    """Group neighbouring lines that stand one above the other, as on a flank without lean."""
    apart = [np.diff(np.arctan2(end[:, 1], end[:, 0])) % (2 * math.pi) for end in (inner, outer)]
    apart = [np.minimum(gap, 2 * math.pi - gap) for gap in apart]
    same = (apart[0] < _SAME) & (apart[1] < _SAME)
    columns = [[0]]
    for index, joined in enumerate(same, start=1):
        if joined:
            columns[-1].append(index)
        else:
            columns.append([index])
    return columns


def _all_round(dog: Dog, points: Vertices, cells: Cells) -> Mesh:
    """Repeat one pitch about the axis; cells may point into the pitch that follows."""
    turns = [rotation(index * dog.pitch_angle).T for index in range(dog.count)]
    vertices = np.concatenate([points @ turn for turn in turns])
    shifts = len(points) * np.arange(dog.count)[:, None, None]
    return Mesh(vertices, ((cells + shifts) % len(vertices)).reshape(-1, 3))


@dataclass(frozen=True)
class _Pitch:
    """Numbering of one pitch: ends of its lines inside and outside, then their feet.

    ``lines`` is their number, ``columns`` the lines that stand one above the other,
    ``height`` the height of the lines (only its order within a column counts).
    """

    lines: int
    columns: list[list[int]]
    height: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Points of one pitch."""
        return 2 * (self.lines + len(self.columns))

    def end(self, line: int, side: int) -> int:
        """Return the point at the inner (0) or outer (1) end of a line, or of the next pitch."""
        turn, line = divmod(line, self.lines)
        return turn * self.size + side * self.lines + line

    def foot(self, column: int, side: int) -> int:
        """Return the point of the underside below a column."""
        turn, column = divmod(column, len(self.columns))
        return turn * self.size + 2 * self.lines + side * len(self.columns) + column

    def cells(self) -> Cells:
        """Return the triangles (n, 3) of one pitch."""
        top = [
            (self.end(i, 0), self.end(i, 1), self.end(i + 1, 1), self.end(i + 1, 0))
            for i in range(self.lines)
        ]
        under = [
            (self.foot(j, 0), self.foot(j + 1, 0), self.foot(j + 1, 1), self.foot(j, 1))
            for j in range(len(self.columns))
        ]
        cells = [cell for a, b, c, d in top + under for cell in ((a, b, c), (a, c, d))]
        for j in range(len(self.columns)):
            cells += [(a, c, b) for a, b, c in self.strip(j, 0)] + self.strip(j, 1)
        return np.array(cells, dtype=np.int64)

    def strip(self, column: int, side: int) -> list[tuple[int, int, int]]:
        """Return the triangles of a wall from a column to the next, seen from outside."""
        left = [self.foot(column, side)] + [self.end(i, side) for i in self.edge(column, -1)]
        right = [self.foot(column + 1, side)]
        right += [self.end(i, side) for i in self.edge(column + 1, 0)]
        fan = [(right[0], high, low) for low, high in pairwise(left)]
        return fan + [(left[-1], low, high) for low, high in pairwise(right)]

    def edge(self, column: int, meeting: int) -> list[int]:
        """Return a column's lines from below up to the one (first or last) that leads on."""
        turn, place = divmod(column, len(self.columns))
        lines = self.columns[place]
        limit = self.height[lines[meeting]]
        below = sorted((i for i in lines if self.height[i] <= limit), key=lambda i: self.height[i])
        return [turn * self.lines + i for i in below]


def part_volume(dog: Dog, root_radius: float, body: float) -> float:
    """Return the exact volume of one ring, m3 (closed form and Gauss quadrature)."""
    require_body(body)
    require_room(dog, root_radius)
    ring = dog.outer_radius**2 - dog.inner_radius**2
    tooth = 0.25 * dog.pitch_angle * dog.height * ring - chamfer_volume(dog)
    if root_radius > 0.0 or dog.edge_radius > 0.0:
        tooth -= sum(corner_volume(dog, corner) for corner in dog_corners(dog, root_radius))
    return math.pi * ring * body + dog.count * tooth


def chamfer_volume(dog: Dog) -> float:
    """Compute the volume that the chamfer takes from one sharp dog, m3.

    On a cylinder of radius r it is a curved triangle: level with the crest, along the
    face, along the braking flank. Its area is the integral of height over angle.
    """
    half = 0.5 * dog.radial_width
    radii = dog.mean_radius + half * _NODES
    corner = dog_corners(replace(dog, edge_radius=0.0), 0.0)[1]
    line = Lines(corner.axis[None, :], corner.direction[None, :])
    areas = np.array([r * _chamfer_area(dog, r, line.at(r)[0]) for r in radii.tolist()])
    return float(half * (_WEIGHTS @ areas))


def _chamfer_area(dog: Dog, radius: float, end: Vertices) -> float:
    """Return the area of the chamfer over the angle at one radius, m rad.

    ``end`` (3,) is where the braking edge leaves that radius, m.
    """
    half, quarter = 0.5 * dog.height, 0.25 * dog.pitch_angle
    edge, drop = math.atan2(end[1], end[0]), half - end[2]
    # Depth of the face below the crest, integrated over the angle from edge to crest.
    reach = half * math.tan(dog.traction)
    crest = quarter - math.asin(reach / radius)
    face = radius * (math.cos(crest - quarter) - math.cos(edge - quarter)) - reach * (crest - edge)
    # Where the flank reaches over the face it is the upper bound: its depth comes off.
    depth, lean = 0.5 * drop * (1.0 + _NODES), math.tan(dog.braking)
    rate = lean / np.sqrt(radius**2 - ((half - depth) * lean) ** 2)
    return float(math.tan(dog.chamfer) * face - 0.5 * drop * (_WEIGHTS @ (depth * rate)))


def corner_volume(dog: Dog, corner: Corner) -> float:
    """Compute the volume that a rounding takes from the sharp dog, m3; negative for a fillet.

    A fan of straight fibres parallel to the edge, each as long as the annulus leaves it.
    """
    shares, weights = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
    normals = corner.normals(shares)
    reach = corner.axis + corner.radius * normals - corner.edge
    tangents = np.cross(corner.direction, normals) * corner.radius * corner.arc
    areas = np.linalg.norm(np.cross(reach, tangents), axis=1)
    points = corner.edge + shares[:, None, None] * reach
    fibres = Lines(points.reshape(-1, 3), np.broadcast_to(corner.direction, (points.size // 3, 3)))
    ends = fibres.at(dog.outer_radius) - fibres.at(dog.inner_radius)
    lengths = np.linalg.norm(ends, axis=1).reshape(len(shares), len(shares))
    volume = (weights * shares) @ lengths @ (weights * areas)
    return math.copysign(float(volume), corner.radius)
