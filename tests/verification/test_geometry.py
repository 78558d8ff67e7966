"""Derived dimensions against hand calculation, and meshes against the closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.shift.geometry import Dog, section
from dogshape.sim.shift.mesh import dog_planes, dog_solid
from dogshape.sim.units import DEG


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
