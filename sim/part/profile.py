r"""The toothed side of a ring as it is made: planes, fillets and rounded tips.

All corners of the dogs are straight lines, so a fillet or rounding of radius
:math:`\rho` is a circular cylinder about a straight line, and the whole toothed
side is ruled by straight lines. Each line ends on the cylinders of the inner and
outer radius. (``sim.shift.mesh.rigid_dog`` measures the ends of its edges along the
radial line of a flank instead, so that flanks are parallelograms: its ends stand
off by some hundredths of a millimetre, which contact does not notice.)

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
from dogshape.sim.shift.flank import tip_radius
from dogshape.sim.shift.geometry import LAND, Dog
from dogshape.sim.shift.mesh import rotation
from dogshape.sim.shift.planes import Plane, Vertices, dog_planes, flank_line

#: Radii below this, m, are lost in the precision of a CAD kernel or an STL file.
SMALLEST = 1e-6
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
    return tuple(_corner(a, b, r) for (a, b), r in zip(pairwise(faces), radii, strict=True))


def _corner(first: Plane, last: Plane, radius: float) -> Corner:
    """Return the corner of two planes; its axis is where both, moved in by the radius, meet."""
    along = np.cross(first.normal, last.normal)
    along *= math.copysign(1.0, along[0]) / float(np.linalg.norm(along))
    offsets = np.array([first.offset - radius, last.offset - radius, 0.0])
    axis = np.linalg.solve(np.array([first.normal, last.normal, along]), offsets)
    return Corner(axis, along, first.normal, last.normal, radius)


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
    if root_radius >= SMALLEST and lands(dog, root_radius).min() >= LAND:
        return
    span = f"{SMALLEST * 1e3:.4g} and {largest_root_radius(dog) * 1e3:.4g} mm"
    rule = f"it must be 0 or lie between {span} to leave floor, face and flanks"
    remedy = "use a smaller root radius, or fewer or higher dogs"
    raise GeometryError(refusal("root_radius_mm", root_radius * 1e3, "mm", rule, remedy))
