"""STEP of the pair: two valid solids of the exact volume, in mm, that mesh by an axial move."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.export.cad import ring_solid, write_step
from dogshape.sim.errors import GeometryError, InputError
from dogshape.sim.part import part_volume
from dogshape.sim.shift.geometry import Dog, root_radius_room
from dogshape.sim.units import DEG, MM
from tests.conftest import needed

BODY = 5.0 * MM
#: Chamfer, traction, braking in deg, height in mm, dogs, root radius in mm: the prototype,
#: the best design found, upright flanks with sharp corners.
SHAPES = [
    (8.0, 12.0, 22.0, 3.7, 15, 0.3),
    (16.05, 7.35, 22.94, 2.094, 33, 0.3),
    (5.0, 0.0, 0.0, 4.0, 6, 0.0),
]


@pytest.fixture
def _kernel() -> None:
    needed((find_spec("build123d") is not None), "build123d")


def _dog(prototype: Dog, shape: tuple[float, ...]) -> tuple[Dog, float]:
    chamfer, traction, braking, height, count, radius = shape
    angles = {"chamfer": chamfer * DEG, "traction": traction * DEG, "braking": braking * DEG}
    return replace(prototype, height=height * MM, count=int(count), **angles), radius * MM


@pytest.mark.usefixtures("_kernel")
@pytest.mark.parametrize("shape", SHAPES)
def test_step_reads_back_as_two_rings(
    prototype: Dog, tmp_path: Path, shape: tuple[float, ...]
) -> None:
    import build123d

    dog, radius = _dog(prototype, shape)
    write_step(dog, radius, BODY, tmp_path / "pair.step")
    pair = build123d.import_step(tmp_path / "pair.step")
    text = (tmp_path / "pair.step").read_text(encoding="ascii")
    assert "PRODUCT('sliding ring'" in text
    assert "PRODUCT('output ring'" in text
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    sliding, output = pair.solids()
    exact = part_volume(dog, radius, BODY) / MM**3
    for ring in (sliding, output):
        assert ring.is_valid
        assert ring.volume == pytest.approx(exact, rel=1e-5)
    _stand_apart(dog, sliding, output)
    if dog.count <= 15:  # an intersection in the kernel takes its time
        _mesh_by_an_axial_move(dog, sliding, output)


def _stand_apart(dog: Dog, sliding: Any, output: Any) -> None:
    """Check crests an axial gap apart, undersides and radii where they belong, mm."""
    low, high = sliding.bounding_box(), output.bounding_box()
    crest, gap, body = 0.5 * dog.height / MM, dog.axial_gap / MM, BODY / MM
    ends = [low.min.Z, high.max.Z, low.max.X, high.max.X]
    radius = dog.outer_radius / MM
    assert ends == pytest.approx([-crest - body, 3.0 * crest + gap + body, radius, radius])
    # Rounded crests stand a little lower than sharp ones.
    assert gap - 1e-5 < high.min.Z - low.max.Z < gap + 0.2


def _mesh_by_an_axial_move(dog: Dog, sliding: Any, output: Any) -> None:
    """Check that rings touch at full depth without sharing volume, and share some beyond."""
    travel = dog.travel / MM
    tooth = 0.25 * dog.pitch * dog.height * dog.radial_width / MM**3
    assert _shared(sliding, output.translate((0, 0, 0.02 - travel))) < 1e-6 * tooth
    deep = _shared(sliding, output.translate((0, 0, -0.05 - travel)))
    assert deep > 1e-3 * tooth


def _shared(one: Any, other: Any) -> float:
    common = one.intersect(other)
    return sum(float(part.volume) for part in common or [])


@pytest.mark.usefixtures("_kernel")
def test_surfaces_are_true_planes_and_cylinders(prototype: Dog) -> None:
    """Eight faces a pitch: four planes, two fillets, two roundings; three more for the ring."""
    ring = ring_solid(prototype, 0.3 * MM, BODY)
    kinds = [face.geom_type.name for face in ring.faces()]
    assert len(kinds) == 8 * 15 + 3
    assert kinds.count("PLANE") == 4 * 15 + 1
    assert kinds.count("CYLINDER") == 4 * 15 + 2
    radii = [face.radius for face in ring.faces() if face.geom_type.name == "CYLINDER"]
    assert sorted({round(r, 6) for r in radii}) == [0.3, 22.0, 26.0]


@pytest.mark.usefixtures("_kernel")
def test_largest_root_radius_can_be_drawn(prototype: Dog) -> None:
    radius = 0.99 * root_radius_room(prototype)
    ring = ring_solid(prototype, radius, BODY)
    assert ring.is_valid
    exact = part_volume(prototype, radius, BODY) / MM**3
    # The kernel integrates its large cylinders to some 3e-5 only.
    assert ring.volume == pytest.approx(exact, rel=2e-4)


@pytest.mark.usefixtures("_kernel")
def test_the_same_rings_give_the_same_file(prototype: Dog, tmp_path: Path) -> None:
    files = [tmp_path / "one.step", tmp_path / "two.step"]
    for path in files:
        write_step(prototype, 0.0, BODY, path)
    assert files[0].read_bytes() == files[1].read_bytes()


def test_what_cannot_be_made_is_refused(prototype: Dog) -> None:
    with pytest.raises(GeometryError, match="root_radius_mm is 3 mm"):
        ring_solid(prototype, 3.0 * MM, BODY)
    with pytest.raises(GeometryError, match="body_mm is -1 mm"):
        ring_solid(prototype, 0.0, -1.0 * MM)


def test_without_the_extra_one_sentence_says_so(
    prototype: Dog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "build123d", None)
    assert not (find_spec("build123d") is not None)
    with pytest.raises(InputError, match=r"build123d, .*dogshape\[cad\]"):
        write_step(prototype, 0.0, BODY, tmp_path / "pair.step")
    assert not (tmp_path / "pair.step").exists()
