r"""Skin and body of a dog with rounded edges, for both sides of the contact.

The planes of a rounded edge (``sim.shift.planes``) touch one cylinder, so all are equally deep
below its axis. Depth below the least of all planes is therefore linear in prisms between each of
them and the axis, and in pyramids from the apex below the three faces to whatever is left: the
body's tetrahedra are cut along both. Drake takes the pressure of a vertex from its distance to the
skin: on an axis that is the radius from one radius within the ends of the body on.

Faces are triangulated from their lowest corner, so that neighbours share their triangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.planes import (
    Edge,
    Plane,
    Vertices,
    dog_planes,
    flank_line,
    rounded_edges,
    touching_planes,
)

Face = tuple[int, ...]


def skin_lines(dog: Dog) -> Vertices:
    """Return the lines between surfaces that can touch, (m + 1, 2, 3), braking root first.

    They end as those of a sharp dog (``mesh.rigid_dog``), at inner and outer radius along the
    radial line of their flank.
    """
    root = dog_planes(dog)["root"]
    around = [root, *touching_planes(dog)[::-1], root]
    braking = 2 + len(rounded_edges(dog)[1].planes)  # lines up to the face, on that side
    found = []
    for place, (first, last) in enumerate(pairwise(around)):
        along, _ = flank_line(dog, -1 if place < braking else +1)
        ends = [Plane(along, radius) for radius in (dog.inner_radius, dog.outer_radius)]
        found.append([meeting(first, last, end) for end in ends])
    return np.array(found)


def meeting(*planes: Plane) -> Vertices:
    """Return the point (3,) in which three planes meet."""
    found: Vertices = np.linalg.solve(
        np.array([plane.normal for plane in planes]), np.array([plane.offset for plane in planes])
    )
    return found


def body(dog: Dog, skin: dict[str, Plane], apex: Vertices) -> tuple[Vertices, list[Face]]:
    """Return vertices (n, 3) and tetrahedra of the body of a dog with rounded edges.

    Parameters
    ----------
    skin : the planes of its root, inner and outer end.
    apex : point equally deep below the three faces, m, (3,); the last vertex.
    """
    ends = (skin["inner"], skin["outer"])
    around = [skin["root"], *touching_planes(dog), skin["root"]]
    lines = [[meeting(a, b, end) for end in ends] for a, b in pairwise(around)]
    edges = rounded_edges(dog)
    axes = [_axis(edge, ends, dog.edge_radius) for edge in edges]
    vertices = np.array([*(p for line in lines for p in line), *(p for a in axes for p in a), apex])
    last, top = len(lines) - 1, len(vertices) - 1
    crest, braking = 1 + len(edges[0].planes), last - 1 - len(edges[1].planes)
    turns = (_Turn(1, crest, top - 8), _Turn(braking, last - 1, top - 4))
    cells = [cell for turn in turns for cell in turn.prisms()]
    left = [_strip(a, b) for a, b in ((0, 1), (crest, braking), (last - 1, last), (last, 0))]
    left += [face for turn in turns for face in turn.sides()]
    for end in (0, 1):
        one, two = (turn.axis + 3 * end for turn in turns)
        root, foot, on_face, edge, low, floor = (
            2 * line + end for line in (0, 1, crest, braking, last - 1, last)
        )
        left += [(root, foot, one), (one, on_face, edge, two), (two, low, floor)]
        left.append((root, one, two, floor))
    cells += [(*triangle, top) for face in left for triangle in triangulated(face)]
    return vertices, cells


def _axis(edge: Edge, ends: Sequence[Plane], radius: float) -> list[Vertices]:
    """Return four points of an edge's axis: at the inner end, one radius within, so at the outer.

    Those within are as far from the skin as the axis is below it.
    """
    inner, outer = ends
    found = []
    for end in (inner, inner.moved(-radius), outer.moved(-radius), outer):
        way = (end.offset - end.normal @ edge.axis) / (end.normal @ edge.direction)
        found.append(edge.axis + way * edge.direction)
    return found


@dataclass(frozen=True)
class _Turn:
    """Numbers of a rounded edge in a body: its first and last line, first vertex of its axis."""

    first: int
    last: int
    axis: int

    def prisms(self) -> list[Face]:
        """Cut what lies between the planes of the edge and its axis into tetrahedra."""
        cells: list[Face] = []
        for line in range(self.first, self.last):
            (corner, outer), (after, last) = _line(line), _line(line + 1)
            faces = (self._side(line + 1), (outer, last, self.axis + 2))
            cells += [(*t, corner) for face in faces for t in triangulated(face)]
            cells.append((corner, after, self.axis, self.axis + 1))
            cells.append((outer, last, self.axis + 2, self.axis + 3))
        return cells

    def sides(self) -> list[Face]:
        """Return the faces between the axis and the ends of both faces that meet in the edge."""
        found: list[Face] = []
        for line in (self.first, self.last):
            inner, outer = _line(line)
            found += [self._side(line), (inner, self.axis, self.axis + 1)]
            found.append((outer, self.axis + 2, self.axis + 3))
        return found

    def _side(self, line: int) -> Face:
        return (*_line(line), self.axis + 2, self.axis + 1)


def _line(line: int) -> tuple[int, int]:
    return 2 * line, 2 * line + 1


def _strip(one: int, other: int) -> Face:
    return (*_line(one), *_line(other)[::-1])


def triangulated(face: Sequence[int]) -> list[tuple[int, int, int]]:
    """Cut a convex face into triangles from its lowest corner, the same on both sides of it."""
    start = face.index(min(face))
    first, *others = *face[start:], *face[:start]
    return [(first, a, b) for a, b in pairwise(others)]
