"""Study drafts from a switchable coupling of a REXS model."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

import dogshape as ds
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.drafts.rexs_coupling import RexsReading, coupling_of, read_coupling
from dogshape.pipeline.drafts.rexs_model import read_rexs
from dogshape.sim.units import RPM
from tests.conftest import Call

EXAMPLE = Path(__file__).parents[2] / "examples" / "gearbox.rexsj"
SLIDES = ("--sliding-side", "inner", "--set", "drive.shaft_speed_rpm=900")
Tables = dict[str, Any]


def _tables() -> Tables:
    model: Tables = json.loads(EXAMPLE.read_text("utf-8"))["model"]
    return model


def _written(model: Tables, folder: Path) -> Path:
    path = folder / "own.rexsj"
    path.write_text(json.dumps({"model": model}), encoding="utf-8")
    return path


def _reading(path: Path, sliding_side: str | None = "inner") -> RexsReading:
    model = read_rexs(path)
    return read_coupling(model, coupling_of(model, None), sliding_side)


def _component(model: Tables, number: int) -> Tables:
    (component,) = (part for part in model["components"] if part["id"] == number)
    return component


def _case(model: Tables, number: int, part: int) -> Tables:
    (case,) = (case for case in model["load_spectrum"]["load_cases"] if case["id"] == number)
    (component,) = (component for component in case["components"] if component["id"] == part)
    return component


def _as_xml(model: Tables, path: Path) -> Path:
    """Write the XML of a model, arrays as columns."""
    root = ElementTree.Element("model", {"version": model["version"]})

    def add_components(parent: ElementTree.Element, parts: list[Tables]) -> None:
        for part in parts:
            texts = {key: str(part[key]) for key in ("id", "type", "name") if key in part}
            element = ElementTree.SubElement(parent, "component", texts)
            for row in part["attributes"]:
                (value,) = (row[key] for key in row.keys() - {"id", "unit"})
                place = {key: row[key] for key in ("id", "unit") if key in row}
                attribute = ElementTree.SubElement(element, "attribute", place)
                if isinstance(value, list):
                    array = ElementTree.SubElement(attribute, "array")
                    for column in value:
                        ElementTree.SubElement(array, "c").text = str(column).lower()
                else:
                    attribute.text = str(value).lower() if isinstance(value, bool) else str(value)

    relations = ElementTree.SubElement(root, "relations")
    for relation in model["relations"]:
        place = {"id": str(relation["id"]), "type": relation["type"]}
        element = ElementTree.SubElement(relations, "relation", place)
        for member in relation["refs"]:
            ElementTree.SubElement(element, "ref", {key: str(member[key]) for key in member})
    add_components(ElementTree.SubElement(root, "components"), model["components"])
    spectrum = ElementTree.SubElement(root, "load_spectrum", {"id": "1"})
    for case in model["load_spectrum"]["load_cases"]:
        element = ElementTree.SubElement(spectrum, "load_case", {"id": str(case["id"])})
        add_components(element, case["components"])
    path.write_bytes(ElementTree.tostring(root))
    return path


def test_a_coupling_gives_torque_speed_and_inertias(dogshape: Call) -> None:
    said = dogshape("init", "study", "--like", "ev_disconnect", "--out", "own", "--yes", "--json",
                    "--rexs", str(EXAMPLE), *SLIDES)  # fmt: skip
    assert said.status == 0, said.err
    study = load_study("own")
    load = study.limits.load
    assert (load.torque, load.coast_share) == (1600.0, 0.5)
    assert study.clutch.drive.shaft_speed == pytest.approx(900 * RPM)
    # A hollow cylinder and a cone, whose inertia is (3/10) m (R1^5 - R2^5)/(R1^3 - R2^3).
    cylinder = 0.5 * math.pi * 7850 * 0.1 * (0.02**4 - 0.005**4)
    cone_mass = math.pi * 7850 * 0.03 / 3 * (0.02**2 + 0.02 * 0.03 + 0.03**2)
    cone = 0.3 * cone_mass * (0.03**5 - 0.02**5) / (0.03**3 - 0.02**3)
    rings = study.clutch.rings
    assert rings.sliding_inertia == pytest.approx(0.4 + cylinder + cone, rel=1e-8)
    assert rings.output_inertia == pytest.approx(90.0 + math.pi / 2 * 7850 * 0.08 * 0.045**4)
    assumed = " ".join(said.json["assumed"])
    for words in (
        "switchable_coupling 50 (Disconnect) of gearbox.rexsj, REXS 1.7",
        "1 over 2 % of 8000 h, 0.25 over 68 % of 8000 h, -0.5 over 5 % of 8000 h; REXS counts",
        "past each other by 1200 1/min in load case 4; operating.mismatch_rpm is the rest",
        "not taken: outer_diameter 118 mm, length 32 mm of the coupling as a whole",
        "as in 'ev_disconnect', decides the shift time",
    ):
        assert words in assumed
    # The file says where its values are from, and values of the user replace those of the model.
    assert "# gearbox: load.torque_Nm = 1600 is the largest" in Path("own/study.toml").read_text()
    said = dogshape("init", "study", "--like", "ev_disconnect", "--out", "other", "--yes", "--json",
                    "--rexs", str(EXAMPLE), *SLIDES, "--set", "load.torque_Nm=500")  # fmt: skip
    assert load_study("other").limits.load.torque == 500.0
    assert "load.torque_Nm = 1600" not in " ".join(said.json["assumed"])


def test_both_spellings_are_read_alike(tmp_path: Path) -> None:
    packed = tmp_path / "own.rexsz"
    packed.write_bytes(b"PK\x03\x04")
    xml = _as_xml(_tables(), tmp_path / "gearbox.rexsj")
    namespaced = tmp_path / "namespaced" / "gearbox.rexsj"
    namespaced.parent.mkdir()
    namespaced.write_text(xml.read_text().replace("<model", '<model xmlns="http://rexs.info/"', 1))
    readings = []
    for path in (EXAMPLE, xml, namespaced):
        model = read_rexs(path)
        readings.append(read_coupling(model, coupling_of(model, 50), "outer"))
    assert readings[0] == readings[1] == readings[2]
    assert readings[0].values["sliding.inertia_kgm2"] > 90.0
    with pytest.raises(ds.InputError, match="is packed; unpack it"):
        read_rexs(packed)


def test_open_readings_are_refused_without_a_terminal(dogshape: Call) -> None:
    given = ("init", "study", "--like", "ev_disconnect", "--yes", "--rexs", str(EXAMPLE))
    said = dogshape(*given)
    assert said.status == 2
    for words in (
        "the engaged coupling turns at 400 to 900 1/min, but a study has one speed",
        "--set drive.shaft_speed_rpm=900",
        "which side of the coupling slides: inner, shaft 10 (Layshaft) or outer, shaft 20",
    ):
        assert words in said.err
    said = dogshape(*given, "--sliding-side", "inner")
    assert said.status == 2
    assert "slides" not in said.err
    said = dogshape("init", "study", "--yes", "--coupling", "50")
    assert "--coupling and --sliding-side are for a gearbox; give --rexs" in said.sentence


def test_open_readings_are_asked_in_a_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    model = _tables()
    other = {**_component(model, 50), "id": 51, "name": "Park lock"}
    model["components"].append(other)
    path = _written(model, tmp_path)
    typed = "50\nouter\nev_disconnect\n" + 60 * "\n"
    given = ["init", "study", "--out", "own", "--rexs", str(path)]
    done = CliRunner().invoke(app, given, input=typed)
    assert done.exit_code == 0, done.stderr
    for words in (
        "couplings of ",
        "switchable_coupling 51 (Park lock)",
        "side that slides, inner or outer",
        "the engaged coupling turns at 400 to 900 1/min",
        "rated torque at the dogs, N m [1600]:",
    ):
        assert words in done.stderr
    assert load_study("own").clutch.rings.sliding_inertia > 90.0


def _set_gear(model: Tables) -> None:
    _case(model, 4, 1)["attributes"][0]["integer"] = 3


def _set_unit(model: Tables) -> None:
    _component(model, 13)["attributes"][0]["unit"] = "kg mm^2"


def _set_speed(model: Tables) -> None:
    _case(model, 1, 20)["attributes"][0]["floating_point"] = 430.0


def _set_torque(model: Tables) -> None:
    _case(model, 1, 50)["attributes"][1]["floating_point"] = -1600.0


def _set_text(model: Tables) -> None:
    _component(model, 40)["attributes"][0]["floating_point"] = "heavy"


def _remove_side(model: Tables) -> None:
    model["relations"] = model["relations"][:-1]


def _rename_coupling(model: Tables) -> None:
    _component(model, 50)["type"] = "coupling"


def _add_coupling(model: Tables) -> None:
    model["components"].append({**_component(model, 50), "id": 51})


def _set_version(model: Tables) -> None:
    model["version"] = "3.0"


def _remove_components(model: Tables) -> None:
    del model["components"]


def _add_spectrum(model: Tables) -> None:
    model["load_spectrum"] = [model["load_spectrum"], model["load_spectrum"]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_set_gear, "gear_shift_index is 3, but is_engaged of switchable_coupling 50 .* 2 gears"),
        (_set_unit, r"is in 'kg mm\^2', but REXS has it in 'kg m\^2'; correct the file"),
        (_set_speed, "speeds of both engaged sides are 400 and 430 1/min, but they must be equal"),
        (_set_torque, "torques on the inner and, negative, on the outer side are -1600 and 1600"),
        (_set_text, "density of material 40 .* is 'heavy', but it must be a number"),
        (_remove_side, "has no relation 'side' with inner_part and outer_part"),
        (_rename_coupling, "has no switchable_coupling; export"),
        (_add_coupling, "switchable_coupling 51 .*; choose one, as coupling=50"),
        (_set_version, "has REXS version 3.0, but versions 1 and 2 are read"),
        (_remove_components, "is no REXS model .*components"),
        (_add_spectrum, "has 2 load spectra; export the model with one"),
    ],
)
def test_a_faulty_model_is_refused(
    tmp_path: Path, change: Callable[[Tables], None], words: str
) -> None:
    model = _tables()
    change(model)
    path = _written(model, tmp_path)
    with pytest.raises(ds.InputError, match=words):
        _reading(path)


@pytest.mark.parametrize("content", ["{", "<model", "", "[1]", '{"model": 3}', "<other/>"])
def test_other_files_are_refused(tmp_path: Path, content: str) -> None:
    path = tmp_path / "own.rexs"
    path.write_text(content)
    with pytest.raises(ds.InputError, match=r"is no (JSON|XML|REXS model)"):
        read_rexs(path)
    with pytest.raises(ds.InputError, match="cannot be read"):
        read_rexs(tmp_path / "none.rexs")


def test_an_incomplete_inertia_is_not_taken(tmp_path: Path) -> None:
    """A gear on the shaft, another coupling behind it, or a section without a material."""
    model = _tables()
    model["components"].append({"id": 60, "type": "cylindrical_gear", "attributes": []})
    refs = [{"id": 10, "role": "assembly"}, {"id": 60, "role": "part"}]
    model["relations"].append({"id": 20, "type": "assembly", "refs": refs})
    _component(model, 40)["attributes"] = []
    reading = _reading(_written(model, tmp_path), sliding_side=None)
    assert not reading.values.keys() & {"sliding.inertia_kgm2", "output.inertia_kgm2"}
    assert "sliding_side" not in reading.questions
    text = " ".join(reading.sentences(reading.values))
    assert (
        "inner side is incomplete, the given parts alone 0.4 kg m2: the file has none of " in text
    )
    assert "shaft_section 11, shaft_section 12, cylindrical_gear 60" in text
    joined = _tables()
    joined["components"].append({"id": 61, "type": "coupling", "attributes": []})
    refs = [{"id": 61, "role": "assembly"}, {"id": 20, "role": "inner_part"}]
    joined["relations"].append({"id": 21, "type": "side", "refs": refs})
    reading = _reading(_written(joined, tmp_path))
    assert "output.inertia_kgm2" not in reading.values
    assert reading.values["sliding.inertia_kgm2"] > 0.4
    assert "none of the parts behind coupling 61" in " ".join(reading.sentences(reading.values))


def test_a_single_load_needs_no_spectrum(tmp_path: Path) -> None:
    """Attributes of components; without ``is_engaged`` a torque tells the closed coupling."""
    model = _tables()
    del model["load_spectrum"]
    speed = {"id": "rotational_speed", "unit": "1/min", "floating_point": -750.0}
    for shaft in (10, 20):
        _component(model, shaft)["attributes"].append(speed)
    torque = {"id": "torque_acting_on_outer_component_u", "floating_point": 300}
    _component(model, 50)["attributes"] = [torque]
    reading = _reading(_written(model, tmp_path))
    assert reading.values["load.torque_Nm"] == 300.0
    assert reading.values["drive.shaft_speed_rpm"] == 750.0
    assert "load.coast_share" not in reading.values
    assert not reading.questions
    # An open coupling has neither torque nor speed.
    _component(model, 50)["attributes"] = []
    reading = _reading(_written(model, tmp_path))
    assert reading.values.keys() == {"sliding.inertia_kgm2", "output.inertia_kgm2"}
