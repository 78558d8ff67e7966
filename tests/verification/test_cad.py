"""STEP of the pair: two valid solids of the exact volume, in mm, that mesh by an axial move."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from dogshape.pipeline.export.cad import ring_solid, write_step
from dogshape.sim.errors import GeometryError
from dogshape.sim.part import part_volume
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import OutputDog, dog_pair
from dogshape.sim.units import DEG, MM
from tests.conftest import require_program

BODY = 5.0 * MM
#: Chamfer, traction, braking in deg, height in mm, dogs, root radius in mm: the prototype,
#: the best design found, upright flanks with sharp corners; then a roof's back chamfer in deg,
#: place of its ridge and backlash in mm, and an undercut dog.
SHAPES = [
    (8.0, 12.0, 22.0, 3.7, 15, 0.3),
    (16.05, 7.35, 22.94, 2.094, 33, 0.3),
    (5.0, 0.0, 0.0, 4.0, 6, 0.0),
    (14.0, 14.0, 14.0, 3.7, 15, 0.3, 20.0, 0.55, 0.6),
    (0.0, -4.0, -6.0, 3.7, 8, 0.3, 0.0, 1.0, 3.0),
]


@pytest.fixture
def _kernel() -> None:
    require_program(find_spec("build123d") is not None, "build123d")


def _dog(prototype: Dog, shape: tuple[float, ...]) -> tuple[Dog, float]:
    chamfer, traction, braking, height, count, radius, *more = shape
    back, crest, backlash = more or (0.0, 1.0, 0.0)
    angles = {"chamfer": chamfer * DEG, "traction": traction * DEG, "braking": braking * DEG}
    tip = {"chamfer_back": back * DEG, "crest": crest, "backlash": backlash * MM}
    size = {"height": height * MM, "count": int(count)}
    return replace(prototype, **size, **angles, **tip), radius * MM


@pytest.mark.usefixtures("_kernel")
@pytest.mark.parametrize("shape", SHAPES)
def test_step_reads_as_two_rings(prototype: Dog, tmp_path: Path, shape: tuple[float, ...]) -> None:
    import build123d

    dog, radius = _dog(prototype, shape)
    write_step(dog_pair(dog), radius, BODY, tmp_path / "pair.step")
    sliding, output = build123d.import_step(tmp_path / "pair.step").solids()
    text = (tmp_path / "pair.step").read_text(encoding="ascii")
    for words in ("PRODUCT('sliding ring'", "PRODUCT('output ring'", "SI_UNIT(.MILLI.,.METRE.)"):
        assert words in text
    exact = part_volume(dog, radius, BODY) / MM**3
    for ring in (sliding, output):
        assert ring.is_valid
        assert ring.volume == pytest.approx(exact, rel=1e-5)
    # Crests an axial gap apart, rounded ones a little more; undersides and radii in their places.
    low, high = sliding.bounding_box(), output.bounding_box()
    crest, gap, outer = 0.5 * dog.height / MM, dog.axial_gap / MM, dog.outer_radius / MM
    ends = [low.min.Z, high.max.Z, low.max.X, high.max.X]
    body = BODY / MM
    assert ends == pytest.approx([-crest - body, 3.0 * crest + gap + body, outer, outer])
    assert gap - 1e-5 < high.min.Z - low.max.Z < gap + 0.2
    if dog.count > 15:  # an intersection in the kernel takes its time
        return

    def shared(move: float) -> float:
        common = sliding.intersect(output.translate((0, 0, move - dog.travel / MM)))
        return sum(float(part.volume) for part in common or [])

    # Rings touch at full depth without sharing volume, and share some beyond.
    tooth = 0.25 * dog.pitch * dog.height * dog.radial_width / MM**3
    assert shared(0.02) < 1e-6 * tooth
    assert shared(-0.05) > 1e-3 * tooth


@pytest.mark.usefixtures("_kernel")
def test_step_of_unlike_rings_has_either_dog(prototype: Dog, tmp_path: Path) -> None:
    """Volumes of both parts; at the travel of the lower dog the rings touch and share nothing."""
    import build123d

    pair = dog_pair(prototype, OutputDog(height=3.0 * MM, chamfer=5.0 * DEG))
    write_step(pair, 0.3 * MM, BODY, tmp_path / "pair.step")
    sliding, output = build123d.import_step(tmp_path / "pair.step").solids()
    for ring, dog in ((sliding, pair.sliding), (output, pair.output)):
        assert ring.volume == pytest.approx(part_volume(dog, 0.3 * MM, BODY) / MM**3, rel=1e-5)

    def shared(move: float) -> float:
        common = sliding.intersect(output.translate((0, 0, move - pair.travel / MM)))
        return sum(float(part.volume) for part in common or [])

    tooth = 0.25 * prototype.pitch * pair.depth * prototype.radial_width / MM**3
    assert shared(0.02) < 1e-6 * tooth
    assert shared(-0.05) > 1e-3 * tooth


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


def test_what_cannot_be_made_is_refused(prototype: Dog) -> None:
    with pytest.raises(GeometryError, match="root_radius_mm is 3 mm"):
        ring_solid(prototype, 3.0 * MM, BODY)


@pytest.mark.usefixtures("_kernel")
def test_tolerances_are_read_back_on_their_faces(prototype: Dog, tmp_path: Path) -> None:
    """Diameters and root radius of either ring; unlike tip edges are no part of the radius."""
    from OCP.OCP.collections import Sequence_TDF_Label
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFApp import XCAFApp_Application
    from OCP.XCAFDoc import XCAFDoc_Dimension, XCAFDoc_DocumentTool

    pair = dog_pair(replace(prototype, count=6, edge_radius=0.4 * MM))
    path = tmp_path / "pair.step"

    def dimensions(tolerances: dict[str, float]) -> list[tuple[float, float, float, int]]:
        write_step(pair, 0.3 * MM, BODY, path, tolerances)
        document = TDocStd_Document(TCollection_ExtendedString("XmlOcaf"))
        XCAFApp_Application.GetApplication_s().InitDocument(document)
        reader = STEPCAFControl_Reader()
        reader.SetGDTMode(True)
        reader.ReadFile(str(path))
        assert reader.Transfer(document)
        table = XCAFDoc_DocumentTool.DimTolTool_s(document.Main())
        labels = Sequence_TDF_Label()
        table.GetDimensionLabels(labels)
        values = []
        for index in range(1, labels.Length() + 1):
            size = XCAFDoc_Dimension.Set_s(labels.Value(index)).GetObject()
            faces, others = Sequence_TDF_Label(), Sequence_TDF_Label()
            table.GetRefShapeLabel_s(labels.Value(index), faces, others)
            bounds = (size.GetLowerTolValue(), size.GetUpperTolValue())
            values.append((size.GetValue(), *bounds, faces.Length()))
        return values

    given = {"outer_diameter": 1.5e-4, "inner_diameter": 1e-4, "root_radius": 5e-5, "height": 5e-5}
    sizes = [(52.0, 0.15, 0.15, 1), (44.0, 0.1, 0.1, 1), (0.3, 0.05, 0.05, 12)]
    for values, expected in zip(dimensions(given), 2 * sizes, strict=True):
        assert values == pytest.approx(expected)
    content = path.read_bytes()
    assert b"AP242_MANAGED_MODEL_BASED_3D_ENGINEERING" in content
    dimensions(given)
    assert path.read_bytes() == content
    assert not dimensions({"height": 5e-5})
