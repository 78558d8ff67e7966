r"""Meshes of a dog: the two sides of the contact, and formats for Drake and print.

Frame of a ring: z along the axis towards the other ring, pitch plane at z = 0, dog *k*
about the angle :math:`k\vartheta`; the traction flank is on the side of growing angle. Rigid side:
the surfaces that can touch. Compliant side: one dog as pyramids whose apex is equally deep below
its three faces, so that the pressure below each is stiffness times depth; the body reaches so far
beyond the dog that this holds down to a third of the apex's depth. A rounded edge is planes that
touch its cylinder within ``DEVIATION``: depth is linear in prisms between each and the axis, and in
pyramids from the apex to what is left. Of a tip with two faces one closes above the apex, in a line
that is equally deep below it and its two neighbours, as the hip of a roof: below that face depth is
linear in a prism down to the hip, and the apex is that of the three others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.geometry import Dog

Vertices = NDArray[np.float64]  #: (n, 3), m
#: m that planes stand out beyond the edge they touch; below a ground face's roughness
DEVIATION = 1e-6
#: Share of the way to the mean radius by which a hip ends within its face's pyramid.
HIP_INSET = 0.1
MIN_HIP_SHARE = 1e-3  #: of the radial width, length below which a hip is a point


@dataclass(frozen=True)
class Plane:
    """Half-space ``normal . x <= offset`` with an outward unit normal (3,)."""

    normal: NDArray[np.float64]
    offset: float

    def moved(self, distance: float) -> Plane:
        """Move the plane outwards by a distance in m."""
        return Plane(self.normal, self.offset + distance)

    def depth(self, point: Vertices) -> float:
        """Compute the depth of a point (3,) below the plane, m."""
        return self.offset - float(self.normal @ point)


def flank_line(dog: Dog, side: int) -> tuple[Vertices, Vertices]:
    """Compute directions along and across the radial line in a flank, each (3,).

    ``side`` is +1 for the traction and -1 for the braking flank; the second
    direction points out of the dog.
    """
    quarter = 0.25 * (dog.pitch_angle - dog.backlash_angle)
    radial = np.array([math.cos(quarter), side * math.sin(quarter), 0.0])
    return radial, np.array([-math.sin(quarter), side * math.cos(quarter), 0.0])


def ridge_line(dog: Dog) -> tuple[Vertices, Vertices]:
    """Compute directions along the ridge and across it, to growing angles, each (3,)."""
    turn = rotation((2.0 * dog.crest - 1.0) * 0.25 * (dog.pitch_angle - dog.backlash_angle))
    return turn[:, 0], turn[:, 1]


class DogPlanes(NamedTuple):
    """Planes that bound a dog."""

    traction: Plane
    braking: Plane
    face: Plane  #: of the tip; of two faces that from the ridge to the braking flank
    back: Plane | None  #: face from the ridge to the traction flank; None for a tip with one face
    root: Plane
    inner: Plane
    outer: Plane

    @property
    def tip(self) -> tuple[Plane, ...]:
        """Faces of the tip, from the braking to the traction flank."""
        return (self.face,) if self.back is None else (self.face, self.back)

    @property
    def touching(self) -> tuple[Plane, ...]:
        """Faces that can touch, from the braking to the traction flank."""
        return (self.braking, *self.tip, self.traction)


def dog_planes(dog: Dog) -> DogPlanes:
    """Compute the planes that bound a dog.

    The face of a tip with one falls to either side.
    """
    axis = np.array([0.0, 0.0, 1.0])
    radial = np.array([1.0, 0.0, 0.0])
    # Faces fall from the ridge.
    _, ridge_normal = ridge_line(dog)
    ridge = dog.ridge_offset * ridge_normal + dog.addendum * axis

    def flank(side: int, angle: float) -> Plane:
        """Compute the plane of a flank."""
        _, outward = flank_line(dog, side)
        return Plane(math.cos(angle) * outward + math.sin(angle) * axis, 0.0)

    def tip_face(fall: float) -> Plane:
        normal = math.cos(fall) * axis + math.sin(fall) * ridge_normal
        return Plane(normal, float(normal @ ridge))

    return DogPlanes(
        traction=flank(1, dog.traction),
        braking=flank(-1, dog.braking),
        face=tip_face(-dog.chamfer if dog.crest > 0.0 else dog.chamfer_back),
        back=tip_face(dog.chamfer_back) if dog.has_back else None,
        root=Plane(-axis, dog.dedendum),
        inner=Plane(-radial, -dog.inner_radius * flank_line(dog, +1)[0][0]),
        outer=Plane(radial, dog.outer_radius),
    )


@dataclass(frozen=True)
class Lines:
    """Straight lines that run outwards: points (n, 3) in m, directions (n, 3)."""

    points: Vertices
    directions: Vertices

    def at(self, radius: float) -> Vertices:
        """Intersect the lines with the cylinder of ``radius`` (m), (n, 3)."""
        p = self.points[:, :2]
        d = self.directions[:, :2]
        a = (d * d).sum(1)
        b = (p * d).sum(1)
        discriminant = b * b - a * ((p * p).sum(1) - radius * radius)
        distance = (np.sqrt(np.maximum(discriminant, 0.0)) - b) / a
        return np.asarray(self.points + distance[:, None] * self.directions)

    def turned(self, angle: float) -> Lines:
        """Turn the lines by ``angle`` (rad) about the axis."""
        turn = rotation(angle).T
        return Lines(self.points @ turn, self.directions @ turn)

    def __getitem__(self, which: slice) -> Lines:
        return Lines(self.points[which], self.directions[which])


@dataclass(frozen=True)
class Corner:
    """A corner of the profile and the cylinder that rounds or fills it."""

    axis: Vertices  #: point of the cylinder's axis, (3,), m
    direction: Vertices  #: along it outwards, (3,)
    first: Vertices  #: outward normal of the face before, (3,)
    last: Vertices  #: the same of the face after
    radius: float  #: positive for a rounding, negative for a fillet, m

    @cached_property
    def arc(self) -> float:
        """Angle between the normals of both faces, rad."""
        return math.acos(float(self.first @ self.last))

    def normals(self, shares: NDArray[np.float64]) -> Vertices:
        """Interpolate the outward normals (n, 3) at ``shares`` (0 to 1) of the arc."""
        first_weight = np.sin((1.0 - shares) * self.arc)
        last_weight = np.sin(shares * self.arc)
        weighted_sum = first_weight[:, None] * self.first + last_weight[:, None] * self.last
        return np.asarray(weighted_sum / math.sin(self.arc))

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Planes that touch the cylinder between its two faces and stand out by ``DEVIATION``.

        Empty for a sharp edge, and for one so blunt that its two faces stand out by less.
        """
        if self.radius == 0.0:
            return ()
        widest = 2.0 * math.acos(self.radius / (self.radius + DEVIATION))
        steps = math.ceil(self.arc / widest)
        normals = self.normals(np.arange(1, steps) / steps)
        return tuple(Plane(n, float(n @ self.axis) + self.radius) for n in normals)

    def lines(self, segments: int) -> Lines:
        """Compute the lines of the arc in ``segments`` steps, or the line of a sharp edge."""
        steps = np.linspace(0.0, 1.0, segments + 1 if self.radius else 1)
        points = self.axis + self.radius * self.normals(steps)
        return Lines(points, np.broadcast_to(self.direction, points.shape))


def corner_of(first: Plane, last: Plane, radius: float) -> Corner:
    """Build the corner between two faces, rounded with a radius (m), or filled with its negative.

    The axis is where both faces, moved in by the radius, meet.
    """
    direction = np.cross(first.normal, last.normal)
    direction *= math.copysign(1.0, direction[0]) / float(np.linalg.norm(direction))
    offsets = np.array([first.offset - radius, last.offset - radius, 0.0])
    axis = np.linalg.solve(np.array([first.normal, last.normal, direction]), offsets)
    return Corner(axis, direction, first.normal, last.normal, radius)


def touching_faces(dog: Dog) -> tuple[Plane, ...]:
    """List the faces that can touch: traction flank, back if there is one, face, braking flank."""
    return dog_planes(dog).touching[::-1]


def tip_edges(dog: Dog) -> tuple[Corner, ...]:
    """List the edges between faces that can touch, with the edge radius, from traction on."""
    faces = touching_faces(dog)
    return tuple(corner_of(first, last, dog.edge_radius) for first, last in pairwise(faces))


def touching_planes(dog: Dog) -> tuple[Plane, ...]:
    """List the planes that can touch, from traction to braking flank.

    Those of a rounded edge stand between its two faces.
    """
    first, *faces = touching_faces(dog)
    edges = zip(tip_edges(dog), faces, strict=True)
    return first, *(plane for edge, face in edges for plane in (*edge.planes, face))


def tip_planes(dog: Dog) -> NDArray[np.bool_]:
    """Mark the planes of ``touching_planes`` that are faces of the tip, (p,)."""
    flags = [False]  # traction flank
    for edge in tip_edges(dog):
        flags += [*[False] * len(edge.planes), True]
    flags[-1] = False  # braking flank
    return np.array(flags)


Face = tuple[int, ...]  #: indices of the vertices of a face or a tetrahedron


def stacked(planes: Sequence[Plane]) -> tuple[Vertices, NDArray[np.float64]]:
    """Stack the normals (n, 3) and offsets (n,), m, of planes."""
    normals = np.array([plane.normal for plane in planes])
    return normals, np.array([plane.offset for plane in planes])


def meeting(*planes: Plane) -> Vertices:
    """Compute the point in which three planes meet, m, (3,)."""
    return np.asarray(np.linalg.solve(*stacked(planes)), dtype=np.float64)


def body(dog: Dog, skin: DogPlanes, apex: Vertices) -> tuple[Vertices, list[Face]]:
    """Mesh the body of a dog with rounded edges or a back.

    Returns the vertices, m, (n, 3), and the four vertices of each tetrahedron by their indices.

    ``skin`` has the planes of its root, inner and outer end; ``apex`` (3,) is the last vertex.
    """
    ends = (skin.inner, skin.outer)
    edges = tip_edges(dog)
    profile = [skin.root, *touching_planes(dog), skin.root]
    points = [meeting(first, second, end) for first, second in pairwise(profile) for end in ends]
    last = len(profile) - 2  # line of the braking root
    # A line has two vertices, at the inner and the outer end; an edge its first and last line, and
    # a chain of vertices from end to end along which the faces beside it meet below it.
    spans: list[tuple[int, int]] = []
    chains: list[Face] = []
    start = 1
    for edge in edges:
        end = start + len(edge.planes)
        axis = len(points)
        spans.append((start, end))
        if edge.planes:
            points += _axis(edge, ends)
            chains.append(tuple(range(axis, axis + 4)))
        else:
            chains.append((2 * end, 2 * end + 1))
        start = end + 1
    strips = [(span[1], next_span[0]) for span, next_span in pairwise(spans)]
    cells: list[Face] = []
    strip_lines = ((0, 1), *strips, (last - 1, last), (last, 0))
    faces: list[Face] = [_strip(*lines) for lines in strip_lines]
    for edge, span, chain in zip(edges, spans, chains, strict=True):
        if edge.planes:
            cells += _edge_cells(*span, chain[0])
            faces += [wall for line in span for wall in _walls(line, chain)]
    for end in (0, 1):
        faces += _end_faces(spans, strips, chains, last=last, end=end)
    hips: list[Vertices] = []
    planes = dog_planes(dog)
    if planes.back:
        closing = int(planes.back.depth(apex) < planes.face.depth(apex))
        first_chain, second_chain = chains[closing : closing + 2]
        inner_ends = (points[first_chain[0]], points[second_chain[0]])
        outer_ends = (points[first_chain[-1]], points[second_chain[-1]])
        hips = _hip(dog, closing, apex, (inner_ends, outer_ends))
        if hips:
            hip_cells, closed_faces, hip_faces = _hip_cells(
                strips[closing], (first_chain, second_chain), len(points)
            )
            cells = cells + hip_cells
            faces = [face for face in faces if face not in closed_faces] + hip_faces
    points += [*hips, apex]
    return np.array(points), cells + _join(faces, len(points) - 1)


def _end_faces(
    spans: Sequence[tuple[int, int]],
    strips: Sequence[tuple[int, int]],
    chains: Sequence[Face],
    *,
    last: int,
    end: int,
) -> list[Face]:
    """List the faces of the inner end, 0, or the outer, 1, of a body.

    ``last`` is the line of the braking root, the others as in ``body``.
    """
    root = end
    floor = 2 * last + end
    chain_ends = [chain[-end] for chain in chains]
    first_line, _ = spans[0]
    _, last_line = spans[-1]
    faces: list[Face] = [(root, 2 * first_line + end, chain_ends[0])]
    for strip, strip_chains in zip(strips, pairwise(chains), strict=True):
        faces.append(_end(strip, strip_chains, end))
    faces.append((chain_ends[-1], 2 * last_line + end, floor))
    faces.append((root, *chain_ends, floor))
    return faces


def _join(faces: Sequence[Face], top: int) -> list[Face]:
    """Join faces to a vertex as tetrahedra; a face that sharp edges make a line gives none."""
    distinct = [tuple(dict.fromkeys(face)) for face in faces]
    return [(*triangle, top) for face in distinct for triangle in triangulate(face)]


def _strip(first: int, second: int) -> Face:
    """Build the face between two lines."""
    return 2 * first, 2 * first + 1, 2 * second + 1, 2 * second


def _walls(line: int, chain: Face) -> list[Face]:
    """List the faces between a line of a rounded edge and its axis, across the face beside it."""
    inner, inner_stop, outer_stop, outer = chain
    return [
        (2 * line, 2 * line + 1, outer_stop, inner_stop),
        (2 * line, inner, inner_stop),
        (2 * line + 1, outer_stop, outer),
    ]


def _end(strip: tuple[int, int], chains: tuple[Face, Face], end: int) -> Face:
    """Build the inner or outer end of the volume between a face and the axes beside it."""
    first_line, second_line = strip
    first_chain, second_chain = chains
    return first_chain[-end], 2 * first_line + end, 2 * second_line + end, second_chain[-end]


def _hip_cells(
    strip: tuple[int, int], chains: tuple[Face, Face], hip: int
) -> tuple[list[Face], list[Face], list[Face]]:
    """Cut the volume between a face and its hip, from ``hip`` to the next vertex, into tetrahedra.

    ``chains`` are the axes beside the face, or its sharp edges.

    Returns
    -------
    tuple of list
        Tetrahedra, faces of the body that they close, new faces towards the apex.
    """
    outer_hip = hip + 1
    first_line, second_line = strip
    inner_faces = [_strip(*strip), _end(strip, chains, 0)]  # joined to the inner end of the hip
    outer_faces = [_end(strip, chains, 1)]
    dividing_faces: list[Face] = [(2 * first_line + 1, 2 * second_line + 1, outer_hip)]
    apex_faces: list[Face] = [
        (*(chain[0] for chain in chains), hip),
        (*(chain[-1] for chain in chains), outer_hip),
    ]
    for line, chain in zip(strip, chains, strict=True):
        inner_run = chain[:3]
        apex_faces += [(start, end, hip) for start, end in pairwise(inner_run)]
        apex_faces.append((inner_run[-1], outer_hip, hip))
        if len(chain) > len(inner_run):
            wall, inner_end, outer_end = _walls(line, chain)
            inner_faces += [wall, inner_end]
            outer_faces.append(outer_end)
            dividing_faces.append((2 * line + 1, chain[2], outer_hip))
            apex_faces.append((chain[2], chain[3], outer_hip))
    cells = _join([*inner_faces, *dividing_faces], hip) + _join(outer_faces, outer_hip)
    return cells, [*inner_faces, *outer_faces], apex_faces


def _hip(
    dog: Dog, closing: int, apex: Vertices, ends: Sequence[Sequence[Vertices]]
) -> list[Vertices]:
    """Compute the inner and outer end of the hip of a closing face; empty for a hip of no length.

    ``ends`` are the inner and outer ends of the volume above, two points (3,) each. An end of the
    hip lies a little inside of the plane through these and the apex, which then sees the rest.
    """
    faces = touching_faces(dog)[closing : closing + 3]
    start, _ = equally_deep(faces, dog.inner_radius)
    middle, _ = equally_deep(faces, dog.mean_radius)
    hips = []
    for first, second in ends:
        normal = np.cross(second - first, apex - first)
        share = normal @ (first - start) / (normal @ (middle - start))
        hips.append(start + (share + HIP_INSET * (1.0 - share)) * (middle - start))
    return hips if hips[1][0] - hips[0][0] > MIN_HIP_SHARE * dog.radial_width else []


def _axis(edge: Corner, ends: Sequence[Plane]) -> list[Vertices]:
    """Compute four points of an edge's axis: inner end, inset, inset of the outer end, outer end.

    An inset of one radius: as far from the end as the axis is below the skin.
    """
    inner, outer = ends
    stops = (inner, inner.moved(-edge.radius), outer.moved(-edge.radius), outer)
    ways = [(p.offset - p.normal @ edge.axis) / (p.normal @ edge.direction) for p in stops]
    return [edge.axis + way * edge.direction for way in ways]


def _edge_cells(first: int, last: int, axis: int) -> list[Face]:
    """Cut the volume between the planes of an edge and its axis into tetrahedra.

    Between lines ``first`` and ``last``; ``axis`` is the first of its four vertices.
    """
    cells: list[Face] = []
    for line in range(first, last):
        inner, outer, next_inner, next_outer = range(2 * line, 2 * line + 4)
        walls = ((next_inner, next_outer, axis + 2, axis + 1), (outer, next_outer, axis + 2))
        cells += [(*triangle, inner) for wall in walls for triangle in triangulate(wall)]
        cells.append((inner, next_inner, axis, axis + 1))
        cells.append((outer, next_outer, axis + 2, axis + 3))
    return cells


def triangulate(face: Sequence[int]) -> list[tuple[int, int, int]]:
    """Cut a convex face into triangles from its lowest corner, whichever way it is turned."""
    start = face.index(min(face))
    first, *corners = *face[start:], *face[:start]
    return [(first, second, third) for second, third in pairwise(corners)]


Cells = NDArray[np.int64]  #: (m, 3) triangles or (m, 4) tetrahedra


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3) in m and cells (m, 3) or (m, 4) that index them."""

    vertices: Vertices
    cells: Cells

    @property
    def volume(self) -> float:
        """Enclosed volume, m3: of tetrahedra, or of a closed triangle surface."""
        corners = self.vertices[self.cells]
        if self.cells.shape[1] == 4:
            corners = corners[:, 1:] - corners[:, :1]
        return float(np.linalg.det(corners).sum() / 6.0)


def rigid_dog(dog: Dog) -> Mesh:
    """Mesh traction flank, face and braking flank of one dog, normals outwards.

    The edges lie on the inner and outer radius, measured along the radial line
    of either flank, so that flanks are parallelograms. Rounded edges have surfaces between.
    """
    points = []
    if dog.edge_radius > 0.0 or dog.has_back:
        root = dog_planes(dog).root
        profile = [root, *touching_planes(dog)[::-1], root]
        directions = [flank_line(dog, -1)[0], ridge_line(dog)[0], flank_line(dog, +1)[0]]
        counts = [1 + len(edge.planes) for edge in tip_edges(dog)[::-1]]
        # Lines of both roots, and of each edge along the line of its flank or ridge.
        places = [0, *np.repeat([0, 1, 2] if dog.has_back else [0, 2], counts), 2]
        for place, (first, last) in zip(places, pairwise(profile), strict=True):
            for radius in (dog.inner_radius, dog.outer_radius):
                points.append(meeting(first, last, Plane(directions[place], radius)))
    else:
        face = dog_planes(dog).face
        for side, angle in ((-1, dog.braking), (+1, dog.traction)):
            radial, outward = flank_line(dog, side)
            slope = np.array([0.0, 0.0, 1.0]) - math.tan(angle) * outward
            for radius in (dog.inner_radius, dog.outer_radius):
                start = radius * radial
                top = (face.offset - face.normal @ start) / (face.normal @ slope)
                points += [start - dog.dedendum * slope, start + top * slope]
    return Mesh(np.array(points), _in_triangles(touching_quads(dog)))


def touching_quads(dog: Dog) -> list[Face]:
    """List the corners of each surface in ``rigid_dog``, in the order of ``touching_planes``."""
    if dog.edge_radius == 0.0 and not dog.has_back:
        return [(5, 7, 6, 4), (1, 3, 7, 5), (3, 1, 0, 2)]
    return [(i, i + 1, i + 3, i + 2) for i in range(2 * len(touching_planes(dog)) - 2, -2, -2)]


def _in_triangles(faces: Sequence[Sequence[int]]) -> Cells:
    return np.array([(face[0], a, b) for face in faces for a, b in pairwise(face[1:])])


def dog_solid(dog: Dog) -> Mesh:
    """Mesh one dog as a closed surface: the rigid side with its ends and root."""
    skin = rigid_dog(dog)
    caps: list[Face] = [(1, 5, 4, 0), (6, 7, 3, 2), (4, 6, 2, 0)]
    if dog.edge_radius > 0.0 or dog.has_back:
        last = len(skin.vertices) - 1
        caps = [(*range(2, last, 2), 0), (3, 1, *range(last, 3, -2)), (0, last - 1, last, 1)]
    return Mesh(skin.vertices, np.concatenate([skin.cells, _in_triangles(caps)]))


def ring_of(dog: Dog, mesh: Mesh, places: Sequence[int]) -> Mesh:
    """Repeat a mesh about the axis at ``places``, in pitches, as a single mesh."""
    turns = [rotation(place * dog.pitch_angle) for place in places]
    vertices = [mesh.vertices @ turn.T for turn in turns]
    cells = [mesh.cells + index * len(mesh.vertices) for index in range(len(places))]
    return Mesh(np.concatenate(vertices), np.concatenate(cells))


def rotation(angle: float) -> NDArray[np.float64]:
    """Compute the matrix (3, 3) of a turn by ``angle`` in rad about the axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def equally_deep(planes: Sequence[Plane], radius: float) -> tuple[Vertices, float]:
    """Compute the point (3,) at x = ``radius`` equally deep below three planes and its depth, m."""
    normals, offsets = stacked(planes)
    matrix = np.column_stack([normals[:, 1:], np.ones(3)])
    y, z, depth = np.linalg.solve(matrix, offsets - normals[:, 0] * radius)
    return np.array([radius, y, z]), float(depth)


@lru_cache(maxsize=64)
def pressure_apex(dog: Dog) -> tuple[Vertices, float]:
    """Compute the point (3,) equally deep below the flanks and a face of the tip, and its depth, m.

    It lies at the mean radius, no less deep below the other face if there is one; its depth bounds
    what the contact can resolve.
    """
    planes = dog_planes(dog)
    flanks = [planes.traction, planes.braking]
    faces = planes.tip
    apices = [equally_deep([face, *flanks], dog.mean_radius) for face in faces]
    margins = [faces[-1 - k].depth(apex) - depth for k, (apex, depth) in enumerate(apices)]
    return apices[int(np.argmax(margins))]


def compliant_dog(dog: Dog) -> Mesh:
    """Mesh one dog as twelve tetrahedra: its skin in triangles, joined to the apex.

    A finer mesh has the same field, linear in each. Rounded edges and a hip add prisms.
    """
    apex, _ = pressure_apex(dog)
    reach = max(dog.dedendum + apex[2], dog.dedendum)
    planes = dog_planes(dog)
    width = dog.radial_width
    root_depth = 1.5 * reach
    ends = width / 3.0 if dog.has_back else 0.25 * width
    sharp = dog.edge_radius == 0.0 and not dog.has_back
    if not sharp:
        # The apex, whose pressure gives those of edges and hip their scale, is nearest to a flank.
        deepest = max(face.depth(apex) for face in planes.tip)
        root_depth = max(root_depth, deepest)
        ends = max(ends, deepest - 0.5 * width)
    root_distance = root_depth - apex[2] - dog.dedendum
    skin = planes._replace(
        root=planes.root.moved(float(root_distance)),
        inner=planes.inner.moved(float(ends)),
        outer=planes.outer.moved(float(ends)),
    )
    if not sharp:
        vertices, cells = body(dog, skin, apex)
        return Mesh(vertices, _oriented(vertices, cells))
    corner_planes = itertools.product(
        (skin.braking, skin.traction),
        (skin.root, skin.face),
        (skin.inner, skin.outer),
    )
    corners = [meeting(*meeting_planes) for meeting_planes in corner_planes]
    vertices = np.array([*corners, apex])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    cells = [(*triangle, 8) for face in faces for triangle in triangulate(face)]
    return Mesh(vertices, _oriented(vertices, cells))


def _oriented(vertices: Vertices, cells: list[tuple[int, ...]]) -> Cells:
    array = np.array(cells, dtype=np.int64)
    flipped = np.linalg.det(vertices[array[:, 1:]] - vertices[array[:, :1]]) < 0.0
    array[flipped, 2], array[flipped, 3] = array[flipped, 3], array[flipped, 2].copy()
    return array


def to_obj(mesh: Mesh) -> str:
    """Format a triangle mesh as Wavefront OBJ text."""
    lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.cells + 1]
    return "\n".join(lines) + "\n"


def to_vtk(mesh: Mesh) -> str:
    """Format a tetrahedral mesh as legacy VTK text."""
    n = len(mesh.vertices)
    m = len(mesh.cells)
    points = [f"{x:.12g} {y:.12g} {z:.12g}" for x, y, z in mesh.vertices]
    cells = [f"4 {a} {b} {c} {d}" for a, b, c, d in mesh.cells]
    head = ["# vtk DataFile Version 3.0", "dog", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    parts = (f"POINTS {n} double", *points, f"CELLS {m} {5 * m}", *cells)
    return "\n".join([*head, *parts, f"CELL_TYPES {m}", *["10"] * m, ""])


_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def to_stl(mesh: Mesh, name: str) -> bytes:
    """Format a triangle mesh as binary STL in mm; ``name`` goes into its header."""
    facets = np.zeros(len(mesh.cells), dtype=_FACET)
    points = mesh.vertices[mesh.cells] * 1e3
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["corners"] = points
    facets["normal"] = normals / np.where(lengths > 0.0, lengths, 1.0)
    # Readers tell text from binary by the first word: it must not be "solid".
    header = f"binary STL, mm: {name}".encode("ascii", "replace")[:80].ljust(80)
    return header + len(facets).to_bytes(4, "little") + facets.tobytes()
