r"""The ring as a part: a closed surface for printing and drawing, and its volume.

All corners of the dogs are straight lines, so a fillet or rounding is a cylinder about one, and the
toothed side is ruled by lines that end on the cylinders of inner and outer radius. There a strip
joins their ends to a row of points a little below the floors, in the same order and, but below an
undercut or upright flank (``waist``), at the same angles: the surface cannot cut itself while the
lines keep their order. Like rings never overlap: rounded tips are all that a ball can reach from
inside the dog, filled slots all that it can reach inside the slot (``require_room``).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import GeometryError, refusal
from dogshape.sim.shift.geometry import LAND, Dog, root_radius_room, tip_radius
from dogshape.sim.shift.mesh import (
    Corner,
    Lines,
    Mesh,
    Plane,
    corner_of,
    dog_planes,
    flank_line,
    rotation,
)

#: Radii below this, m, are lost in the precision of a CAD kernel or an STL file.
SMALLEST_RADIUS = 1e-6
SEGMENTS = 8  #: of the arc of a fillet or rounding
STEP = math.radians(2.0)  #: largest angle between neighbouring lines, rad
WAIST = 0.1  #: depth of the row below the floors over the body or, if less, the dog's height
APART = 0.01  #: share of a tip's width by which the row keeps off the line of a flank


def dog_corners(dog: Dog, root_radius: float) -> tuple[Corner, ...]:
    """Return braking root, braking edge, traction edge and traction root of the dog at angle 0.

    A ridge between two faces stands between the edges.
    """
    planes = dog_planes(dog)
    floor = Plane(np.array([0.0, 0.0, 1.0]), -0.5 * dog.height)
    sides = [planes[name] for name in ("braking", "face", "back", "traction") if name in planes]
    radii = (-root_radius, *(len(sides) - 1) * [tip_radius(dog, root_radius)], -root_radius)
    return tuple(
        corner_of(first, last, radius)
        for (first, last), radius in zip(pairwise([floor, *sides, floor]), radii, strict=True)
    )


def profile(dog: Dog, root_radius: float, segments: int, step: float) -> list[Lines]:
    """Return the lines of one pitch: four corners, each with the face that follows it.

    A face has only the lines between its corners that keep neighbours within ``step`` (rad), and
    may have none. The floor leads to the next dog.
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
    """Return lines between two lines of a plane, ``step`` (rad) apart at most at ``radii`` (m).

    They lie in the plane, and none crosses another.
    """
    ends = [(here.at(radius)[0], there.at(radius)[0]) for radius in radii]
    spans = [math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) for a, b in ends]
    count = max(1, *(math.ceil(span / step) for span in spans))
    shares = np.linspace(0.0, 1.0, count + 1)[1:-1, None]
    inner, outer = (a + shares * (b - a) for a, b in ends)
    return Lines(inner, outer - inner)


def lands(dog: Dog, root_radius: float) -> Array:
    """Compute what is left of braking flank, face, traction flank and floor, m, (2, 4).

    A back stands between face and traction flank, (2, 5). At inner and outer radius; negative where
    the roundings or fillets on either side overlap.
    """
    corners = dog_corners(dog, root_radius)
    directions = np.array([corner.direction for corner in corners])
    first, last = (
        np.array([corner.axis + corner.radius * getattr(corner, face) for corner in corners])
        for face in ("first", "last")
    )
    begin, end = Lines(last, directions), Lines(first, directions)
    axis, across = np.array([0.0, 0.0, 1.0]), -flank_line(dog, -1)[1]
    ways = np.array([axis, *(len(corners) - 3) * [across], -axis, flank_line(dog, +1)[1]])
    result = []
    for radius in (dog.inner_radius, dog.outer_radius):
        stop = np.roll(end.at(radius), -1, axis=0)
        stop[-1] = rotation(dog.pitch_angle) @ stop[-1]
        gap = stop - begin.at(radius)
        result.append(np.copysign(np.linalg.norm(gap, axis=1), (gap * ways).sum(1)))
    return np.array(result)


def require_room(dog: Dog, root_radius: float) -> None:
    """Raise GeometryError unless fillets and roundings of ``root_radius`` (m) fit.

    ``Dog`` subtracts straight widths from arcs: a sharp tip some micrometres wide may be none.
    """
    left = float(lands(dog, root_radius).min())
    if root_radius == 0.0 and left <= 0.0:
        rule = "some of it must be left (more than 0 mm)"
        remedy = "use fewer or lower dogs, smaller side angles or a larger inner diameter"
        name = "length of tip or floor at the inner radius"
        raise GeometryError(refusal(name, left * 1e3, "mm", rule, remedy))
    if root_radius == 0.0 or (root_radius >= SMALLEST_RADIUS and left >= LAND):
        return
    span = f"{SMALLEST_RADIUS * 1e3:.4g} and {root_radius_room(dog) * 1e3:.4g} mm"
    rule = f"it must be 0 or lie between {span} to leave floor, face and flanks"
    remedy = "use a smaller root radius, or fewer or higher dogs"
    raise GeometryError(refusal("root_radius_mm", root_radius * 1e3, "mm", rule, remedy))


def waist(ends: list[Array], level: float) -> Array:
    """Compute growing angles, rad, at which the row at height ``level`` (m) joins a pitch.

    ``ends`` are those of ``profile``'s pieces at one radius, m. Below a root the angle is its own
    or, if farther inwards, that of the ray from the flank's upper end through the root; below the
    dog its own, limited to between both roots. No two are alike.
    """
    angles = [np.arctan2(y, x) for x, y, _ in (end.T for end in ends)]
    apart = APART * (angles[-4][-1] - angles[2][0])
    roots = []
    for sign, root, top, end in ((1.0, 0, 2, 0), (-1.0, -2, -4, -1)):
        eye, height = angles[top][end], ends[top][end, 2]
        seen = eye + (angles[root] - eye) * (height - level) / (height - ends[root][:, 2])
        roots.append(sign * np.maximum(sign * angles[root], sign * seen + apart))
    first, last = roots
    dog = np.concatenate(angles[1:-2])
    even = np.linspace(first[-1], last[0], len(dog) + 2)[1:-1]
    dog = (1.0 - APART) * np.clip(dog, first[-1], last[0]) + APART * even
    return np.concatenate([first, dog, last, angles[-1]])


def ring_part(
    dog: Dog, root_radius: float, body: float, segments: int = SEGMENTS, step: float = STEP
) -> Mesh:
    """Return one ring as a closed triangle surface with normals outwards; lengths in m.

    ``root_radius`` is that of fillets, and of tips without a radius of their own; 0 gives sharp
    corners. ``body`` is the thickness below the slots. ``segments`` are flat strips of a rounding;
    with ``step``, the largest angle between lines in rad, the volume errs by step²/6.

    Raises GeometryError where roundings do not fit.
    """
    pieces = profile(dog, root_radius, segments, step)
    floor, depth = -0.5 * dog.height, WAIST * min(body, dog.height)
    turns = dog.pitch_angle * np.arange(dog.count)
    rows = []
    for radius in (dog.inner_radius, dog.outer_radius):
        ends = [lines.at(radius) for lines in pieces]
        feet = np.add.outer(turns, waist(ends, floor - depth)).ravel()
        edge = np.concatenate([np.vstack(ends) @ rotation(float(turn)).T for turn in turns])
        x, y, one = radius * np.cos(feet), radius * np.sin(feet), np.ones_like(feet)
        rows += [edge, *(np.array([x, y, (floor - down) * one]).T for down in (depth, body))]
    # Around the section: inner edge, waist and foot, then outer foot, waist and edge.
    points = np.array([*rows[:3], *rows[:2:-1]])
    here = np.arange(points[..., 0].size).reshape(points.shape[:2])
    after = np.roll(here, -1, axis=1)
    quads = np.array([here, after, np.roll(after, -1, axis=0), np.roll(here, -1, axis=0)]).T
    return Mesh(points.reshape(-1, 3), quads[..., [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def part_volume(dog: Dog, root_radius: float, body: float) -> float:
    """Return the volume of one ring, m3, by a surface so fine that it errs by some 1e-6."""
    return ring_part(dog, root_radius, body, 8 * SEGMENTS, 0.1 * STEP).volume
