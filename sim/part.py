r"""The ring as a part: a closed surface for printing and drawing, and its volume.

All corners of the dogs are straight lines, so a fillet or rounding is a cylinder about one, and the
toothed side is ruled by lines that end on the cylinders of inner and outer radius. There a strip
joins their ends to a row of points a little below the floors, in the same order and, except below
an undercut or upright flank (``waist``), at the same angles: the surface cannot cut itself while
the lines keep their order. Like rings never overlap: rounded tips are the reach of a ball inside
the dog, filled slots its reach inside the slot (``require_room``).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from dogshape.sim.elementwise import Array
from dogshape.sim.errors import GeometryError, Refusal
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
WAIST_DEPTH = 0.1  #: of the row below the floors, over the smaller of body and dog height
WAIST_MARGIN = 0.01  #: distance of the row from the line of a flank, over the width of the tip


def dog_corners(dog: Dog, root_radius: float) -> tuple[Corner, ...]:
    """Return braking root, braking edge, traction edge and traction root of the dog at angle 0.

    The ridge of a roof comes between the edges.
    """
    floor = Plane(np.array([0.0, 0.0, 1.0]), -dog.dedendum)
    sides = dog_planes(dog).touching
    tip_radii = (len(sides) - 1) * [tip_radius(dog, root_radius)]
    radii = (-root_radius, *tip_radii, -root_radius)
    pairs = pairwise([floor, *sides, floor])
    return tuple(
        corner_of(first, last, radius) for (first, last), radius in zip(pairs, radii, strict=True)
    )


def profile(dog: Dog, root_radius: float, segments: int, step: float) -> list[Lines]:
    """Return the lines of one pitch: each corner of the dog, then the face behind it.

    Lines of a face are those needed to keep neighbours within ``step`` (rad), possibly none. The
    last face is the floor up to the next dog.
    """
    require_room(dog, root_radius)
    corners = [corner.lines(segments) for corner in dog_corners(dog, root_radius)]
    next_corners = [*corners[1:], corners[0].turned(dog.pitch_angle)]
    radii = (dog.inner_radius, dog.outer_radius)
    pieces = []
    for corner, next_corner in zip(corners, next_corners, strict=True):
        pieces += [corner, fill_plane(corner[-1:], next_corner[:1], radii, step)]
    return pieces


def fill_plane(first: Lines, last: Lines, radii: tuple[float, float], step: float) -> Lines:
    """Return lines of a plane between two of its lines, at most ``step`` (rad) from each other.

    Angles count at both ``radii`` (m). No line crosses another.
    """
    ends = [(first.at(radius)[0], last.at(radius)[0]) for radius in radii]
    spans = [math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]) for a, b in ends]
    count = max(1, *(math.ceil(span / step) for span in spans))
    shares = np.linspace(0.0, 1.0, count + 1)[1:-1, None]
    inner, outer = (a + shares * (b - a) for a, b in ends)
    return Lines(inner, outer - inner)


def lands(dog: Dog, root_radius: float) -> Array:
    """Compute the flat lengths of braking flank, face, traction flank and floor, m, (2, 4).

    Rows are at inner and outer radius; a back comes between face and traction flank, (2, 5).
    Negative where the roundings or fillets at both ends overlap.
    """
    corners = dog_corners(dog, root_radius)
    line_directions = np.array([corner.direction for corner in corners])
    first_tangents = np.array([corner.axis + corner.radius * corner.first for corner in corners])
    last_tangents = np.array([corner.axis + corner.radius * corner.last for corner in corners])
    starts = Lines(last_tangents, line_directions)
    ends = Lines(first_tangents, line_directions)
    axial = np.array([0.0, 0.0, 1.0])
    tangential = -flank_line(dog, -1)[1]
    tips = (len(corners) - 3) * [tangential]
    face_directions = np.array([axial, *tips, -axial, flank_line(dog, +1)[1]])
    lengths = []
    for radius in (dog.inner_radius, dog.outer_radius):
        end_points = np.roll(ends.at(radius), -1, axis=0)
        end_points[-1] = rotation(dog.pitch_angle) @ end_points[-1]
        gaps = end_points - starts.at(radius)
        signs = (gaps * face_directions).sum(1)
        lengths.append(np.copysign(np.linalg.norm(gaps, axis=1), signs))
    return np.array(lengths)


def require_room(dog: Dog, root_radius: float) -> None:
    """Raise GeometryError unless fillets and roundings of ``root_radius`` (m) fit.

    ``Dog`` subtracts straight widths from arcs: a sharp tip some micrometres wide may be none.
    """
    shortest_land = float(lands(dog, root_radius).min())
    if root_radius == 0.0 and shortest_land <= 0.0:
        rule = "some of it must be left (more than 0 mm)"
        remedy = "use fewer or lower dogs, smaller side angles or a larger inner diameter"
        name = "length of tip or floor at the inner radius"
        raise GeometryError(Refusal(name, shortest_land * 1e3, "mm", rule=rule, remedy=remedy))
    if root_radius == 0.0 or (root_radius >= SMALLEST_RADIUS and shortest_land >= LAND):
        return
    span = f"{SMALLEST_RADIUS * 1e3:.4g} and {root_radius_room(dog) * 1e3:.4g} mm"
    rule = f"it must be 0 or lie between {span} to leave floor, face and flanks"
    remedy = "use a smaller root radius, or fewer or higher dogs"
    raise GeometryError(
        Refusal("root_radius_mm", root_radius * 1e3, "mm", rule=rule, remedy=remedy)
    )


def waist(ends: list[Array], level: float) -> Array:
    """Compute growing angles of the waist points of a pitch at height ``level`` (m), rad, (n,).

    ``ends`` are the line ends of each piece of ``profile`` at one radius, m, (k, 3). Below a root
    the angle is that of the root or, if farther inwards, of the ray from the flank's upper end
    through the root; below the dog that of the line, clipped to between both roots.
    """
    angles = [np.arctan2(y, x) for x, y, _ in (points.T for points in ends)]
    margin = WAIST_MARGIN * (angles[-4][-1] - angles[2][0])
    root_angles = []
    for sign, root, top, corner in ((1.0, 0, 2, 0), (-1.0, -2, -4, -1)):
        top_angle = angles[top][corner]
        top_height = ends[top][corner, 2]
        heights = top_height - ends[root][:, 2]
        ray = top_angle + (angles[root] - top_angle) * (top_height - level) / heights
        root_angles.append(sign * np.maximum(sign * angles[root], sign * ray + margin))
    first, last = root_angles
    dog_angles = np.concatenate(angles[1:-2])
    even_angles = np.linspace(first[-1], last[0], len(dog_angles) + 2)[1:-1]
    # A small even share keeps clipped angles distinct.
    clipped = np.clip(dog_angles, first[-1], last[0])
    dog_angles = (1.0 - WAIST_MARGIN) * clipped + WAIST_MARGIN * even_angles
    return np.concatenate([first, dog_angles, last, angles[-1]])


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
    floor = -dog.dedendum
    depth = WAIST_DEPTH * min(body, dog.height)
    turns = dog.pitch_angle * np.arange(dog.count)
    rows = []
    for radius in (dog.inner_radius, dog.outer_radius):
        ends = [lines.at(radius) for lines in pieces]
        edge = np.concatenate([np.vstack(ends) @ rotation(float(turn)).T for turn in turns])
        angles = np.add.outer(turns, waist(ends, floor - depth)).ravel()
        x = radius * np.cos(angles)
        y = radius * np.sin(angles)
        waist_row = np.array([x, y, np.full_like(angles, floor - depth)]).T
        foot_row = np.array([x, y, np.full_like(angles, floor - body)]).T
        rows += [edge, waist_row, foot_row]
    # Around the section: inner edge, waist and foot, then outer foot, waist and edge.
    points = np.array([*rows[:3], *rows[:2:-1]])
    indices = np.arange(points[..., 0].size).reshape(points.shape[:2])
    next_indices = np.roll(indices, -1, axis=1)
    quads = np.array(
        [indices, next_indices, np.roll(next_indices, -1, axis=0), np.roll(indices, -1, axis=0)]
    ).T
    return Mesh(points.reshape(-1, 3), quads[..., [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def part_volume(dog: Dog, root_radius: float, body: float) -> float:
    """Compute the volume of one ring, m3, to a relative error of about 1e-6."""
    return ring_part(dog, root_radius, body, 8 * SEGMENTS, 0.1 * STEP).volume
