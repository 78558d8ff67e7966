"""Derived dimensions against hand calculation, and meshes against the closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.shift.geometry import Dog, section
from dogshape.sim.shift.mesh import (
    Mesh,
    compliant_dog,
    dog_planes,
    dog_solid,
    pressure_apex,
    rigid_dog,
)
from dogshape.sim.units import DEG
from tests.conftest import dog_of


@pytest.mark.parametrize(
    ("dimension", "millimetres"),
    [
        ("pitch", 10.053),
        ("tip_width", 3.886),
        ("root_width", 6.167),
        ("entry_play", 2.281),
        ("edge_drop", 0.579),
        ("face_width", 4.120),
        ("crest_overlap", 4.240),
        ("braking_flank_height", 3.121),
        ("travel", 4.7),
        ("axial_length", 8.4),
    ],
)
def test_prototype_dimensions(prototype: Dog, dimension: str, millimetres: float) -> None:
    assert getattr(prototype, dimension) * 1e3 == pytest.approx(millimetres, abs=6e-4)


def test_edge_drop_is_where_face_and_braking_flank_meet(prototype: Dog) -> None:
    """Two lines intersected by hand: z = -(w + z' tan g) tan a with z' = -z."""
    a, g = math.tan(prototype.chamfer), math.tan(prototype.braking)
    drop = prototype.edge_drop
    assert drop == pytest.approx((prototype.tip_width + drop * g) * a, rel=1e-12)
    assert prototype.braking_flank_height == pytest.approx(prototype.height - drop, rel=1e-12)


def test_flank_planes_hold_a_radial_line_of_the_median_plane(prototype: Dog) -> None:
    planes = dog_planes(prototype)
    for name, side in (("traction", 1), ("braking", -1)):
        quarter = side * 0.25 * prototype.pitch_angle
        for radius in (0.0, prototype.inner_radius, prototype.outer_radius):
            on_line = radius * np.array([math.cos(quarter), math.sin(quarter), 0.0])
            assert planes[name].normal @ on_line == pytest.approx(planes[name].offset, abs=1e-15)


def test_mating_flanks_coincide_at_full_depth(prototype: Dog) -> None:
    """One ring turned over about x and set half a pitch on: its flanks lie in ours."""
    planes = dog_planes(prototype)
    half_pitch = 0.5 * prototype.pitch_angle
    for name, side in (("traction", 1), ("braking", -1)):
        x, y, z = planes[name].normal
        mirrored = np.array([x, -y, -z])
        turn = side * half_pitch
        c, s = math.cos(turn), math.sin(turn)
        mate = np.array(
            [c * mirrored[0] - s * mirrored[1], s * mirrored[0] + c * mirrored[1], mirrored[2]]
        )
        assert mate == pytest.approx(-planes[name].normal, abs=1e-12)


def test_solid_is_closed_and_has_the_volume_of_its_section(prototype: Dog) -> None:
    solid = dog_solid(prototype)
    edges: dict[tuple[int, int], int] = {}
    for a, b, c in solid.cells.tolist():
        for edge in ((a, b), (b, c), (c, a)):
            edges[edge] = edges.get(edge, 0) + 1
    assert all(edges.get((b, a)) == n == 1 for (a, b), n in edges.items())
    points = np.array(section(prototype))
    x, z = points[:, 0], points[:, 1]
    area = 0.5 * abs(float(x @ np.roll(z, -1) - z @ np.roll(x, -1)))
    assert solid.volume == pytest.approx(area * prototype.radial_width, rel=0.02)


#: Chamfer, traction, braking in deg, height in mm, dogs: the prototype and corners of the range.
SHAPES = [
    (8, 12, 22, 3.7, 15),
    (2, 4, 5, 1.6, 6),
    (6, 29, 29, 5.5, 10),
    (15, 7, 25, 2.0, 34),
    (0, 4, 4, 6.0, 20),
]


@pytest.mark.parametrize("shape", SHAPES)
def test_compliant_dog_is_whole_and_its_pressure_is_depth(
    prototype: Dog, shape: tuple[float, ...]
) -> None:
    """Tetrahedra fill the skin without overlap; below each face pressure grows with depth.

    Twenty points on every face of the rigid dog, moved in by up to a third of
    the apex's depth: the pressure of the cell around each is its depth below the
    nearest of the three faces.
    """
    dog = dog_of(prototype, shape)
    mesh, (apex, full) = compliant_dog(dog), pressure_apex(dog)
    cells = mesh.vertices[mesh.cells]
    volumes = np.linalg.det(cells[:, 1:] - cells[:, :1]) / 6.0
    assert (volumes > 0.0).all()
    assert _boundary(mesh) == 12
    assert mesh.vertices[8] == pytest.approx(apex)
    touching = [dog_planes(dog)[name] for name in ("braking", "face", "traction")]
    assert [p.offset - p.normal @ apex for p in touching] == pytest.approx([full] * 3)
    rng = np.random.default_rng(3)
    skin = rigid_dog(dog)
    for triangle in skin.vertices[skin.cells]:
        for weights in rng.dirichlet(np.ones(3), 10):
            inward = np.cross(triangle[2] - triangle[0], triangle[1] - triangle[0])
            inward /= np.linalg.norm(inward)
            place = weights @ triangle + rng.uniform(0.0, full / 3.0) * inward
            depth = min(plane.offset - plane.normal @ place for plane in touching)
            if depth > 0.0:
                assert _pressure(mesh, place) * full == pytest.approx(depth, abs=1e-12)


def _boundary(mesh: Mesh) -> int:
    """Count triangles that belong to one tetrahedron; no triangle may belong to three."""
    faces: dict[tuple[int, ...], int] = {}
    for cell in mesh.cells.tolist():
        for left_out in cell:
            face = tuple(sorted(v for v in cell if v != left_out))
            faces[face] = faces.get(face, 0) + 1
    assert set(faces.values()) == {1, 2}
    return sum(n == 1 for n in faces.values())


def _pressure(mesh: Mesh, place: np.ndarray) -> float:
    """Return the field that is 1 at the apex and 0 on the skin, at a point of the mesh."""
    for cell in mesh.cells:
        matrix = np.vstack([mesh.vertices[cell].T, np.ones(4)])
        shares = np.linalg.solve(matrix, [*place, 1.0])
        if (shares > -1e-9).all():
            return float(shares[cell == 8][0])
    raise AssertionError(f"{place} lies in no cell")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 70}, ("tip width at the inner radius is -", "0 mm")),
        ({"height": 16e-3}, ("tip width at the inner radius is -", "0 mm")),
        ({"chamfer": 30 * DEG}, ("height of the braking flank is", "1.85 mm")),
    ],
)
def test_impossible_dogs_are_refused_with_both_numbers(
    prototype: Dog, change: dict[str, float], words: tuple[str, ...]
) -> None:
    with pytest.raises(GeometryError) as refused:
        replace(prototype, **change)
    assert all(word in str(refused.value) for word in words)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"count": 1}, "dog.count is 1"),
        ({"height": 3.7}, "dog.height_mm is 3700 mm"),
        ({"height": math.nan}, "dog.height_mm is nan mm"),
        ({"chamfer": -0.1}, "dog.chamfer_deg is -5.7"),
        ({"inner_diameter": 60e-3}, "dog.outer_diameter_mm = 52 mm"),
    ],
)
def test_broken_numbers_are_refused(prototype: Dog, change: dict[str, float], word: str) -> None:
    with pytest.raises(InputError, match=word.replace(".", r"\.")):
        replace(prototype, **change)
