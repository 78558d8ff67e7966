r"""Meshes of a dog: the part itself, and the two sides of the contact.

Frame of a ring: z along the axis towards the other ring, median plane of the
dogs at z = 0, dog *k* about the angle :math:`k\vartheta`; the traction flank is on
the side of growing angle. The ring that is turned over about its x axis uses
the same meshes.

Contact needs one rigid and one compliant side:

- rigid: the three surfaces that can touch (traction flank, face, braking
  flank) of every dog, as an open surface. Nothing else can be reached: the way
  ends 0.05 mm above the root and the annuli are equal and coaxial.
- compliant: one dog as six pyramids with a common apex, the point equally deep
  below traction flank, face and braking flank. Pressure rises linearly from the
  skin to the apex, so that below each of the three faces it is stiffness times
  depth, and where two of them meet it is the smaller depth that counts. The body
  reaches beyond the dog inwards, outwards and below the root, half as far again
  from the apex as the dog itself: down to a third of the apex's depth the
  pyramids of the three faces cover all that can be touched. Rounded edges add
  prisms (``sim.shift.rounded``).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.planes import (
    Plane,
    Vertices,
    dog_planes,
    face_plane,
    flank_line,
    touching_planes,
)
from dogshape.sim.shift.rounded import body, skin_lines, triangulated

Cells = NDArray[np.int64]  #: (m, 3) triangles or (m, 4) tetrahedra
Quad = tuple[int, int, int, int]


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
            edges = corners[:, 1:] - corners[:, :1]
            return float(np.linalg.det(edges).sum() / 6.0)
        return float(np.linalg.det(corners).sum() / 6.0)


_HEXAHEDRON = list(itertools.product(("braking", "traction"), ("root", "face"), ("inner", "outer")))


def corners(planes: dict[str, Plane]) -> Vertices:
    """Return the eight corners (8, 3) of the body between six planes."""
    points = []
    for names in _HEXAHEDRON:
        normals = np.array([planes[name].normal for name in names])
        offsets = np.array([planes[name].offset for name in names])
        points.append(np.linalg.solve(normals, offsets))
    return np.array(points)


def rigid_dog(dog: Dog) -> Mesh:
    """Return traction flank, face and braking flank of one dog, normals outwards.

    The edges lie on the inner and outer radius, measured along the radial line
    of either flank, so that flanks are parallelograms. Rounded edges have surfaces between.
    """
    if dog.edge_radius > 0.0:
        return Mesh(skin_lines(dog).reshape(-1, 3), _in_triangles(touching_quads(dog)))
    face = face_plane(dog)
    points = []
    for side, angle in ((-1, dog.braking), (+1, dog.traction)):
        along, across = flank_line(dog, side)
        slope = np.array([0.0, 0.0, 1.0]) - math.tan(angle) * across
        for radius in (dog.inner_radius, dog.outer_radius):
            start = radius * along
            top = (face.offset - face.normal @ start) / (face.normal @ slope)
            points += [start - 0.5 * dog.height * slope, start + top * slope]
    return Mesh(np.array(points), _in_triangles(touching_quads(dog)))


def touching_quads(dog: Dog) -> list[Quad]:
    """Return the corners of each surface in ``rigid_dog``, in the order of ``touching_planes``."""
    if dog.edge_radius == 0.0:
        return [(5, 7, 6, 4), (1, 3, 7, 5), (3, 1, 0, 2)]
    last = 2 * len(touching_planes(dog)) - 2
    return [(i, i + 1, i + 3, i + 2) for i in range(last, -2, -2)]


def _in_triangles(quads: list[Quad]) -> Cells:
    return np.array([tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))])


def dog_solid(dog: Dog) -> Mesh:
    """Return one dog as a closed surface: the rigid side with its ends and root."""
    skin = rigid_dog(dog)
    caps = _in_triangles([(1, 5, 4, 0), (6, 7, 3, 2), (4, 6, 2, 0)])
    if dog.edge_radius > 0.0:
        last = len(skin.vertices) - 1
        ends = [(*range(2, last, 2), 0), (3, 1, *range(last, 3, -2)), (0, last - 1, last, 1)]
        caps = np.array([(e[0], a, b) for e in ends for a, b in itertools.pairwise(e[1:])])
    return Mesh(skin.vertices, np.concatenate([skin.cells, caps]))


def ring_of(dog: Dog, one: Mesh) -> Mesh:
    """Return ``one`` repeated about the axis, once a pitch, as a single mesh."""
    vertices, cells = [], []
    for index in range(dog.count):
        turn = rotation(index * dog.pitch_angle)
        vertices.append(one.vertices @ turn.T)
        cells.append(one.cells + index * len(one.vertices))
    return Mesh(np.concatenate(vertices), np.concatenate(cells))


def rotation(angle: float) -> NDArray[np.float64]:
    """Return the matrix (3, 3) of a turn by ``angle`` about the axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=64)
def pressure_apex(dog: Dog) -> tuple[Vertices, float]:
    """Return the point (3,) equally deep below the three faces that touch, and its depth, m.

    It lies at the mean radius; its depth bounds what the contact can resolve.
    """
    planes = dog_planes(dog)
    touching = [planes[name] for name in ("face", "traction", "braking")]
    normals = np.array([plane.normal for plane in touching])
    offsets = np.array([plane.offset for plane in touching])
    matrix = np.column_stack([normals[:, 1:], np.ones(3)])
    y, z, depth = np.linalg.solve(matrix, offsets - normals[:, 0] * dog.mean_radius)
    return np.array([dog.mean_radius, y, z]), float(depth)


def compliant_dog(dog: Dog) -> Mesh:
    """Return one dog as twelve tetrahedra: its skin in triangles, joined to the apex.

    Few and large cells are right here: the pressure is linear in each, so a finer
    mesh has the same field and only costs more. Rounded edges add prisms (``sim.shift.rounded``).
    """
    apex, _ = pressure_apex(dog)
    reach = max(0.5 * dog.height + apex[2], 0.5 * dog.height)
    beyond = {
        "inner": 0.25 * dog.radial_width,
        "outer": 0.25 * dog.radial_width,
        "root": 1.5 * reach - apex[2] - 0.5 * dog.height,
    }
    skin = {n: plane.moved(float(beyond.get(n, 0.0))) for n, plane in dog_planes(dog).items()}
    if dog.edge_radius > 0.0:
        vertices, cells = body(dog, skin, apex)
        return Mesh(vertices, _oriented(vertices, cells))
    vertices = np.concatenate([corners(skin), apex[None, :]])
    cells = [(*triangle, 8) for face in _FACES for triangle in triangulated(face)]
    return Mesh(vertices, _oriented(vertices, cells))


_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def _oriented(vertices: Vertices, cells: list[tuple[int, ...]]) -> Cells:
    array = np.array(cells, dtype=np.int64)
    edges = vertices[array[:, 1:]] - vertices[array[:, :1]]
    flipped = np.linalg.det(edges) < 0.0
    array[flipped, 2], array[flipped, 3] = array[flipped, 3], array[flipped, 2].copy()
    return array


def to_obj(mesh: Mesh) -> str:
    """Return a triangle mesh as Wavefront OBJ text."""
    lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.cells + 1]
    return "\n".join(lines) + "\n"


def to_vtk(mesh: Mesh) -> str:
    """Return a tetrahedral mesh as legacy VTK text."""
    n, m = len(mesh.vertices), len(mesh.cells)
    lines = ["# vtk DataFile Version 3.0", "dog", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines.append(f"POINTS {n} double")
    lines += [f"{x:.12g} {y:.12g} {z:.12g}" for x, y, z in mesh.vertices]
    lines.append(f"CELLS {m} {5 * m}")
    lines += [f"4 {a} {b} {c} {d}" for a, b, c, d in mesh.cells]
    lines.append(f"CELL_TYPES {m}")
    lines += ["10"] * m
    return "\n".join(lines) + "\n"


_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def to_stl(mesh: Mesh, name: str) -> bytes:
    """Return a triangle mesh as binary STL in mm; ``name`` goes into its header."""
    facets = np.zeros(len(mesh.cells), dtype=_FACET)
    points = mesh.vertices[mesh.cells] * 1e3
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["corners"] = points
    facets["normal"] = normals / np.where(lengths > 0.0, lengths, 1.0)
    # Readers tell text from binary by the first word: it must not be "solid".
    header = f"binary STL, mm: {name}".encode("ascii", "replace")[:80].ljust(80)
    return header + len(facets).to_bytes(4, "little") + facets.tobytes()
