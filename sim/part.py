r"""The ring as a part: a closed surface for printing and drawing, and its exact volume.

A ring is a body of constant thickness below the floors of the slots and, above
it, the toothed side. Seen along the axis no line of that side
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

*Toothed side*: planes, fillets and rounded tips. All corners of the dogs are straight lines, so a
fillet or rounding of radius :math:`\rho` is a circular cylinder about a straight line, and the
whole toothed side is ruled by straight lines. Each line ends on the cylinders of the inner and
outer radius. (``sim.shift.mesh.rigid_dog`` measures the ends of its edges along the radial line of
a flank instead, so that flanks are parallelograms: its ends stand off by some hundredths of a
millimetre, which contact does not notice.)

*Why two like rings never overlap.* At full depth the sharp dog of one ring lies in
the sharp slot of the other. Tips rounded with :math:`\rho` are all that a ball of
radius :math:`\rho` can reach from inside the dog, and a slot filled with
:math:`\rho` is all that it can reach inside the slot: the smaller body stays
inside the larger. This holds while the roundings leave some face and flank and
the fillets some floor, which :func:`largest_root_radius` sees to. Tips with an edge radius of their
own, larger than the fillets', are smaller still.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from dogshape.sim.errors import GeometryError, refusal
from dogshape.sim.shift.geometry import LAND, Dog, tip_radius
from dogshape.sim.shift.mesh import (
    Cells,
    Mesh,
    Plane,
    Vertices,
    dog_planes,
    edge_axis,
    flank_line,
    rotation,
)

#: Radii below this, m, are lost in the precision of a CAD kernel or an STL file.
SMALLEST_RADIUS = 1e-6
#: Faces of the toothed side in the order of the corners that they follow.
STRIPS = ("braking flank", "face", "traction flank", "slot floor")


@dataclass(frozen=True)
class Lines:
    """Straight lines that run outwards: points (n, 3) in m, directions (n, 3)."""

    points: Vertices
    directions: Vertices

    def at(self, radius: float) -> Vertices:
        """Intersect the lines with the cylinder of ``radius`` (m), (n, 3)."""
        p, d = self.points[:, :2], self.directions[:, :2]
        a, b = (d * d).sum(1), (p * d).sum(1)
        root = b * b - a * ((p * p).sum(1) - radius * radius)
        way = (np.sqrt(np.maximum(root, 0.0)) - b) / a
        return np.asarray(self.points + way[:, None] * self.directions)

    def turned(self, angle: float) -> Lines:
        """Return the lines turned by ``angle`` (rad) about the axis."""
        turn = rotation(angle).T
        return Lines(self.points @ turn, self.directions @ turn)

    def __getitem__(self, which: slice) -> Lines:
        return Lines(self.points[which], self.directions[which])


@dataclass(frozen=True)
class Corner:
    """A corner of the profile and the cylinder that rounds or fills it.

    ``axis`` (3,) is a point of the cylinder's axis, m, and ``direction`` (3,) runs along
    it outwards; ``first`` and ``last`` are the outward normals of the faces before and
    after; ``radius`` is positive for a rounding and negative for a fillet, m.
    """

    axis: Vertices
    direction: Vertices
    first: Vertices
    last: Vertices
    radius: float

    @cached_property
    def arc(self) -> float:
        """Angle between the normals of both faces, rad."""
        return math.acos(float(self.first @ self.last))

    @property
    def edge(self) -> Vertices:
        """Point (3,) of the sharp edge, m."""
        middle = (self.first + self.last) / (1.0 + math.cos(self.arc))
        return np.asarray(self.axis + self.radius * middle)

    def normals(self, shares: NDArray[np.float64]) -> Vertices:
        """Return the outward normals (n, 3) at ``shares`` (0 to 1) of the arc."""
        before, after = np.sin((1.0 - shares) * self.arc), np.sin(shares * self.arc)
        both = before[:, None] * self.first + after[:, None] * self.last
        return np.asarray(both / math.sin(self.arc))

    def lines(self, segments: int) -> Lines:
        """Return the lines of the arc in ``segments`` steps, or the sharp edge alone."""
        steps = np.linspace(0.0, 1.0, segments + 1 if self.radius else 1)
        points = self.axis + self.radius * self.normals(steps)
        return Lines(points, np.broadcast_to(self.direction, points.shape))


def dog_corners(dog: Dog, root_radius: float) -> tuple[Corner, ...]:
    """Return braking root, braking edge, crest and traction root of the dog at angle 0."""
    planes = dog_planes(dog)
    floor = Plane(np.array([0.0, 0.0, 1.0]), -0.5 * dog.height)
    faces = [floor, planes["braking"], planes["face"], planes["traction"], floor]
    tip = tip_radius(dog, root_radius)
    radii = (-root_radius, tip, tip, -root_radius)
    return tuple(
        Corner(*edge_axis(first, last, radius), first.normal, last.normal, radius)
        for (first, last), radius in zip(pairwise(faces), radii, strict=True)
    )


def profile(dog: Dog, root_radius: float, segments: int, step: float) -> list[Lines]:
    """Return the lines of one pitch: four corners, each with the face that follows it.

    Corner *i* and then face *i* of :data:`STRIPS` are items 2 i and 2 i + 1; a face has
    only the lines between its two corners, as many as keep neighbours within
    ``step`` (rad) of each other, and may have none. The floor leads to the next dog.
    """
    require_room(dog, root_radius)
    corners = [corner.lines(segments) for corner in dog_corners(dog, root_radius)]
    following = [*corners[1:], corners[0].turned(dog.pitch_angle)]
    ends = (dog.inner_radius, dog.outer_radius)
    result = []
    for here, there in zip(corners, following, strict=True):
        result += [here, between(here[-1:], there[:1], ends, step)]
    return result


def between(here: Lines, there: Lines, radii: tuple[float, float], step: float) -> Lines:
    """Return lines between two lines of a plane: in it, and none crosses another.

    ``radii`` are those between which the lines are wanted, m; neighbours are at most
    ``step`` (rad) apart there.
    """
    ends = [(here.at(radius)[0], there.at(radius)[0]) for radius in radii]
    spans = [math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) for a, b in ends]
    count = max(1, *(math.ceil(span / step) for span in spans))
    shares = np.linspace(0.0, 1.0, count + 1)[1:-1, None]
    inner, outer = (a + shares * (b - a) for a, b in ends)
    return Lines(inner, outer - inner)


def lands(dog: Dog, root_radius: float) -> NDArray[np.float64]:
    """Compute the remaining widths of the four :data:`STRIPS` at inner and outer radius, (2, 4), m.

    Negative where the roundings or fillets on either side overlap.
    """
    corners = dog_corners(dog, root_radius)
    begin = Lines(*_stacked(corners, "last"))
    end = Lines(*_stacked(corners, "first"))
    _, across = flank_line(dog, -1)
    to_braking, to_traction = across, flank_line(dog, +1)[1]
    ways = np.array([[0.0, 0.0, 1.0], -to_braking, [0.0, 0.0, -1.0], to_traction])
    turn = rotation(dog.pitch_angle)
    result = []
    for radius in (dog.inner_radius, dog.outer_radius):
        stop = np.roll(end.at(radius), -1, axis=0)
        stop[-1] = turn @ stop[-1]
        gap = stop - begin.at(radius)
        result.append(np.copysign(np.linalg.norm(gap, axis=1), (gap * ways).sum(1)))
    return np.array(result)


def _stacked(corners: tuple[Corner, ...], face: str) -> tuple[Vertices, Vertices]:
    points = [corner.axis + corner.radius * getattr(corner, face) for corner in corners]
    return np.array(points), np.array([corner.direction for corner in corners])


def largest_root_radius(dog: Dog) -> float:
    """Return the largest radius of fillets and roundings that fit side by side, m.

    Everywhere between the inner and the outer radius at least :data:`LAND` of floor,
    face and both flanks is left. Floor and face are narrowest at the inner radius,
    the braking flank is lowest at the outer one, where the face has fallen farthest.

    Raises
    ------
    GeometryError
        There is no room even for sharp corners.
    """
    require_sharp(dog)
    if float(lands(dog, 0.0).min()) <= LAND:
        return 0.0
    # Two fillets of the whole height leave nothing of the traction flank.
    return float(brentq(lambda r: lands(dog, r).min() - LAND, 0.0, 2.0 * dog.height, xtol=1e-9))


def require_sharp(dog: Dog) -> None:
    """Raise GeometryError where a face of the sharp dog ends between inner and outer radius.

    ``Dog`` subtracts straight widths from arcs. Exactly, tip and floor close at
    ``asin(h tan(traction) / 2 r) + asin(h tan(braking) / 2 r) = pitch / 2`` (r the inner
    radius): a dog whose tip is some hundredths of a millimetre wide may be none. The
    braking flank never ends: the tip grows linearly with the radius, so that at the outer
    one the face has fallen less than twice as far as at the mean radius, where
    ``Dog`` allows half of the height.
    """
    left = lands(replace(dog, edge_radius=0.0), 0.0)
    if left.min() > 0.0:
        return
    end, face = np.unravel_index(int(left.argmin()), left.shape)
    name = f"{STRIPS[int(face)]} at the {('inner', 'outer')[int(end)]} radius"
    rule = "some of it must be left (more than 0 mm)"
    remedy = "use fewer or lower dogs, smaller side angles or a larger inner diameter"
    message = refusal(f"length of the {name}", float(left.min()) * 1e3, "mm", rule, remedy)
    raise GeometryError(message)


def require_room(dog: Dog, root_radius: float) -> None:
    """Raise GeometryError unless fillets and roundings of ``root_radius`` (m) fit."""
    require_sharp(dog)
    if root_radius == 0.0:
        return
    if root_radius >= SMALLEST_RADIUS and lands(dog, root_radius).min() >= LAND:
        return
    span = f"{SMALLEST_RADIUS * 1e3:.4g} and {largest_root_radius(dog) * 1e3:.4g} mm"
    rule = f"it must be 0 or lie between {span} to leave floor, face and flanks"
    remedy = "use a smaller root radius, or fewer or higher dogs"
    raise GeometryError(refusal("root_radius_mm", root_radius * 1e3, "mm", rule, remedy))


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
    points = np.concatenate([inner, outer, *feet])
    # Cells may point into the pitch that follows.
    turns = [rotation(index * dog.pitch_angle).T for index in range(dog.count)]
    vertices = np.concatenate([points @ turn for turn in turns])
    cells = pitch.cells() + len(points) * np.arange(dog.count)[:, None, None]
    return Mesh(vertices, (cells % len(vertices)).reshape(-1, 3))


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
