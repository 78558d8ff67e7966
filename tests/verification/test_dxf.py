"""The developed section of both rings in a DXF file: shape, arcs, layers and units."""

from __future__ import annotations

import cmath
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.export.dxf import write_dxf
from dogshape.sim.shift.geometry import Dog, crest_loss, section, tip_radius
from dogshape.sim.units import MM
from tests.conftest import Call

ezdxf = pytest.importorskip("ezdxf")

BODY = 3e-3
SLEEVE = str(Path(__file__).parents[2] / "examples" / "sleeve.toml")
#: Undercut, roof, sleeve, and rings that are unlike.
STUDIES = {
    "mq200": [],
    "motorcycle": [],
    "ev_disconnect": ["output_dog.height_mm=2.2", "output_dog.edge_radius_mm=0.5"],
    SLEEVE: [],
}


def _document(study: Setup, path: Path) -> Any:
    write_dxf(study.clutch.pair, study.limits, BODY, "a title", path)
    return ezdxf.readfile(path)


def _outlines(document: Any, layer: str) -> list[list[tuple[complex, float]]]:
    """Corners and bulges of the closed polylines on a layer, mm."""
    lines = document.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]')
    assert all(line.closed for line in lines)
    return [[(complex(x, y), b) for x, y, b in line.get_points("xyb")] for line in lines]


def _area(outline: list[tuple[complex, float]]) -> float:
    """Area of a closed polyline: the polygon of its corners and the segments of its arcs, mm2."""
    area = 0.0
    for index, (begin, bulge) in enumerate(outline):
        end = outline[(index + 1) % len(outline)][0]
        area += 0.5 * (begin.conjugate() * end).imag
        angle = 4.0 * math.atan(bulge)
        if bulge:
            radius = abs(end - begin) / (2.0 * math.sin(0.5 * abs(angle)))
            segment = 0.5 * radius**2 * (abs(angle) - math.sin(abs(angle)))
            area += math.copysign(segment, bulge)
    return abs(area)


def _dog_area(dog: Dog, root: float, tip: float) -> float:
    """Area of a dog above its floor: the polygon of its corners, each rounded, mm2."""
    points = [complex(x, z) / MM for x, z in section(dog)]
    pairs = zip(points, [*points[1:], points[0]], strict=True)
    area = -0.5 * sum((begin.conjugate() * end).imag for begin, end in pairs)
    path = [points[0] - 1.0, *points, points[-1] + 1.0]
    radii = [root, *(len(points) - 2) * [tip], root]
    for before, corner, after, radius in zip(path[:-2], points, path[2:], radii, strict=True):
        half_turn = 0.5 * cmath.phase((after - corner) / (corner - before))
        part = (radius / MM) ** 2 * (math.tan(abs(half_turn)) - abs(half_turn))
        area += math.copysign(part, half_turn)  # a fillet adds, a rounding takes
    return area


@pytest.mark.parametrize(("name", "settings"), STUDIES.items(), ids=str)
def test_outlines_have_the_area_and_the_arcs_of_the_dogs(
    name: str, settings: list[str], tmp_path: Path
) -> None:
    study = load_study(name, settings)
    document = _document(study, tmp_path / "a.dxf")
    is_sleeve = study.limits.sleeve is not None
    pair = study.clutch.pair
    for layer, dog in (("SLIDING_RING", pair.sliding), ("OUTPUT_RING", pair.output)):
        root = 0.0 if is_sleeve else study.limits.root_radius
        tip = tip_radius(dog, study.limits.root_radius)
        outlines = _outlines(document, layer)
        assert len(outlines) == (dog.count if is_sleeve else 1)
        width = dog.root_width if is_sleeve else dog.pitch
        area = dog.count * (_dog_area(dog, root, tip) + width * BODY / MM**2)
        assert sum(map(_area, outlines)) == pytest.approx(area, rel=1e-9)
        radii = []
        for outline in outlines:
            for index, (begin, bulge) in enumerate(outline):
                end = outline[(index + 1) % len(outline)][0]
                if bulge:
                    radii.append(abs(end - begin) / (2.0 * math.sin(2.0 * math.atan(abs(bulge)))))
        assert len(radii) == dog.count * (len(section(dog)) - (2 if is_sleeve else 0))
        assert {round(radius, 9) for radius in radii} == {
            round(radius / MM, 9) for radius in (root, tip) if radius
        }


def test_rings_stand_apart_by_the_gap_and_face_slots(tmp_path: Path) -> None:
    study = load_study("mq200")
    document = _document(study, tmp_path / "a.dxf")
    dog = study.clutch.dog
    (sliding,) = _outlines(document, "SLIDING_RING")
    (output,) = _outlines(document, "OUTPUT_RING")
    # Turned by half a turn about the middle between both, one ring is the other.
    middle = complex((0.5 * dog.count - 0.25) * dog.pitch, 0.5 * dog.axial_gap) / MM
    turned = np.array(sorted(_place(2.0 * middle - corner) for corner, _ in sliding))
    assert turned == pytest.approx(np.array(sorted(_place(corner) for corner, _ in output)))
    # The arc at the ridge ends on the face, beside the lost crest at 0.
    crest = max(corner.imag for corner, _ in output)
    assert -crest_loss(dog, study.limits.root_radius) / MM - 0.01 < crest < 0.0
    widths = [corner.real for corner, _ in output]
    circumference = 2.0 * math.pi * dog.mean_radius / MM
    assert max(widths) - min(widths) == pytest.approx(circumference)


def _place(corner: complex) -> tuple[float, float]:
    return round(corner.real, 6), round(corner.imag, 6)


def test_a_file_has_units_layers_dimensions_and_notes(dogshape: Call) -> None:
    said = dogshape("export", "ev_disconnect", "--dxf", "a.dxf", "--json")
    assert said.status == 0, said.err
    assert said.json["dxf"] == "a.dxf"
    document = ezdxf.readfile("a.dxf")
    assert not document.audit().errors
    assert document.units == ezdxf.units.MM
    space = document.modelspace()
    texts = [dimension.dxf.text for dimension in space.query("DIMENSION")]
    assert texts == ["(3.65)", "(6.676)", "2.60 ±0.05", "0.80 ±0.10", "2.60 ±0.05"]
    # A dimension without its text would measure the same.
    measured = [dimension.get_measurement() for dimension in space.query("DIMENSION")]
    assert measured == pytest.approx([3.65, 6.676, 2.6, 0.8, 2.6], abs=5e-3)
    (note,) = space.query('MTEXT[layer=="NOTES"]')
    datums = space.query('MTEXT[layer=="DIMENSIONS"]')
    assert [datum.plain_text() for datum in datums] == ["A", "A"]
    # Outside the floors of either ring, 2.6 mm deep and 0.8 mm apart.
    output_y, sliding_y = (datum.dxf.insert.y for datum in datums)
    assert -3.4 < output_y < -2.6
    assert 3.4 < sliding_y < 4.2
    for words in ("back chamfer 12.00° ±0.25°", "40 dogs on", "General tolerances ISO 2768-f."):
        assert words in note.plain_text()
    layers = {entity.dxf.layer for entity in space}
    assert layers == {"SLIDING_RING", "OUTPUT_RING", "PITCH_PLANES", "DIMENSIONS", "NOTES"}
    content = Path("a.dxf").read_bytes()
    assert dogshape("export", "ev_disconnect", "--dxf", "a.dxf").status == 0
    assert Path("a.dxf").read_bytes() == content
