"""What ``strength`` and ``export`` say and write."""

from __future__ import annotations

import json
import re
import struct
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from dogshape.bench.texts import text_of
from dogshape.cli.verbs.study import _named_study
from dogshape.pipeline.config.study_file import find_study, load_study
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.named_design import named_design
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.errors import InputError
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.materials import material_of
from dogshape.sim.versions import bundled_root
from tests.conftest import Call, set_options

#: One operating point and three angles.
QUICK = set_options(
    ["operating.mismatch_rpm=[50]", "operating.force_N=[469.0]", "expectation.angles=3"]
)


def test_strength_checks_everything(dogshape: Call) -> None:
    said = dogshape("strength", "mq200_paper", *QUICK, "--set", "load.landing_share=", "--json")
    assert said.status == 0
    assert said.json["feasible"] is False  # nobody judged the flank strike
    verdict = said.json["verdict"]
    assert (verdict["state"], verdict["failed"]) == ("not_judged", [])
    assert [one["check"] for one in verdict["not_judged"]] == ["flank_strike"]
    assert "strike.ring_inertia_kgm2" in verdict["not_judged"][0]["key"]
    checks = {c["name"]: c for c in said.json["checks"]}
    assert {c["group"] for c in checks.values()} == set(GROUPS) - {"goal"}
    for check in checks.values():
        assert all(check[key] for key in ("meaning", "formula", "source", "limit_key"))
    assert checks["flank_pressure_traction"]["value"] == pytest.approx(132, abs=0.5)
    assert checks["face_pressure_impact"]["value"] == pytest.approx(48.8, rel=0.1)
    assert checks["face_pressure_impact"]["limit"] == pytest.approx(1907, abs=1)
    assert said.json["load"]["blocking_force_N"] == pytest.approx(5050, abs=1)
    assert said.json["load"]["force_per_dog_N"] == pytest.approx(1666.7, abs=0.1)
    assert "16MnCr5" in said.json["material"]["set"]


def test_a_design_that_fails_says_which_check(dogshape: Call) -> None:
    weak = ("--set", "dog.traction_deg=5")
    bad = dogshape("strength", "mq200_paper", "--no-simulate", "--explain", *weak)
    assert bad.status == 1
    line = next(line for line in bad.out.splitlines() if "traction_release" in line)
    assert " ".join(line.split()).endswith("NO Jasny et al. 2019")
    for words in (
        "verdict: fails: ", "not judged: flank strike (give",
        "smallest margin: \N{MINUS SIGN}27 %, traction_release",
        "Jasny et al. 2019", "ISO 6336-3", "1.5 F/(b s)", "load.friction_release",
    ):  # fmt: skip
        assert words in bad.out


def test_a_check_prints_and_records_the_landing_that_decides(dogshape: Call) -> None:
    weak = ("mq200_paper", "--set", "dog.edge_radius_mm=0.3", "--set", "expectation.angles=8")
    said = dogshape("check", *weak, "--explain")
    record = dogshape("check", *weak, "--json").json
    landing = record["decisive_landing"]
    overlap = f"{landing['overlap_mm']:.2g} mm"
    words = f"{landing['force_per_dog_N']:.0f} N on the worst dog, overlap"
    assert f"decisive landing, of {landing['check']}: {words} {overlap}" in said.out
    assert "1.5 F/(b s)" in said.out
    bedding = record["edge_bedding"]
    assert 0.3 <= bedding["radius_low_mm"] <= bedding["radius_mm"] <= bedding["radius_high_mm"]
    checks = {check["name"]: check for check in record["checks"]}
    assert bedding["depth_um"] == pytest.approx(checks["edge_bedding_impact"]["value"])
    ends = [f"({name}_impact)" in said.out for name in ("core_pressure", "edge_bedding")]
    assert any(ends)


def test_a_tolerance_that_leaves_no_dog_is_null_in_json(dogshape: Call) -> None:
    """At 60 dogs the tip is so narrow that a deviation has the flanks meet."""
    asked = ("strength", "mq200_paper", "--no-simulate", "--set", "dog.count=60")
    said = dogshape(*asked, "--json")
    assert said.status == 1
    assert any(check["margin_worst_case"] is None for check in said.json["checks"])
    assert [one["check"] for one in said.json["verdict"]["not_judged"]] == [
        "flank_strike", "landing", "engagement"
    ]  # fmt: skip
    assert "no dog" in dogshape(*asked).out


def test_export_writes_ring_and_drawing_and_warns_of_a_weak_design(dogshape: Call) -> None:
    files = ("--stl", "ring.stl", "--svg", "dog.svg", "--set", "load.torque_Nm=900")
    said = dogshape("export", "mq200_paper", *files, "--json")
    assert said.status == 0
    assert "warning: a check fails (retention_traction" in said.err
    sheet = dogshape("export", "mq200_paper", "--sheet", "sheet.json", *files[4:])
    assert "a check fails" not in sheet.err
    light = ("--set", "load.torque_Nm=0.2")
    asked = "is load.torque_Nm in N m?"
    assert asked in dogshape("export", "mq200_paper", "--svg", "dog.svg", *light).err
    grid = ("--set", "operating.mismatch_rpm=[50]", "--set", "operating.force_N=[469]")
    few = (*grid, "--set", "expectation.angles=3", "--jobs", 1)
    block_map = dogshape("export", "mq200_paper", "--map", "map.csv", *light, *few)
    assert block_map.status == 0
    assert asked not in block_map.err
    assert "volume" not in sheet.out
    content = Path("ring.stl").read_bytes()
    (triangles,) = struct.unpack_from("<I", content, 80)
    assert len(content) == 84 + 50 * triangles
    assert triangles > 15 * 40
    assert said.json["ring_volume_mm3"] == pytest.approx(2858, abs=1)
    assert ElementTree.parse("dog.svg").getroot().tag.endswith("svg")


def test_drawing_carries_every_dimension() -> None:
    study = load_study("mq200_paper")
    words = dimensioned_svg(study.clutch.dog, study.limits)
    for text in (
        "tip (3.89)", "root (6.17)", "pitch (10.053)", "h 3.70 ±0.05", "flank (3.12)",
        "drop (0.58)", "3.66 over", "700 HV, CHD 550 HV = 0.4 mm", "8.00° ±0.25°", "12.00° ±0.25°",
        "22.00° ±0.25°", "R 0.30 ±0.05", "15 dogs on Ø52.00 ±0.15 / Ø44.00 ±0.15 mm",
        "travel 4.70 mm", "16MnCr5",
    ):  # fmt: skip
        assert text in words
    # The leader of the chamfer ends beside the dimension of the tip.
    paths = [re.findall(r"[ML]([\d.]+),", words.partition(w)[0]) for w in ("chamfer", "tip (")]
    assert max(map(float, paths[0][-5:-3])) < min(map(float, paths[1][-8:-6]))


def test_drawing_carries_roughness_only_where_the_study_gives_it() -> None:
    settings = ["manufacturing.flank_roughness_um=10", "manufacturing.crest_roughness_um=6.3"]
    given = load_study("mq200_paper", settings)
    drawing = dimensioned_svg(given.clutch.dog, given.limits)
    assert drawing.count(">Rz 10<") == 2  # either flank
    assert drawing.count(">Rz 6.3<") == 1
    assert "flanks Rz 10, crests Rz 6.3 µm" in drawing
    plain = load_study("mq200_paper")
    assert "Rz" not in dimensioned_svg(plain.clutch.dog, plain.limits)
    assert given.config_hash != plain.config_hash
    assert given.physics_hash == plain.physics_hash
    with pytest.raises(InputError, match=r"manufacturing\.crest_roughness_um is 500"):
        load_study("mq200_paper", ["manufacturing.crest_roughness_um=500"])


@pytest.mark.parametrize(("name", "datum"), [
    ("mq200_paper", "floors of the slots"), ("amt", "median plane"),
])  # fmt: skip
def test_drawing_has_one_datum(name: str, datum: str) -> None:
    study = load_study(name)
    drawing = dimensioned_svg(study.clutch.dog, study.limits)
    assert drawing.count(">A<") == 1
    assert f"datum A (ISO 5459): {datum}" in drawing


@pytest.mark.parametrize(("material", "note"), [
    ("18CrNiMo7-6", "case-hardened, surface hardness 720 HV, CHD 550 HV = 0.4 mm"),
    ("42CrMo4", "flanks and root induction-hardened, surface hardness 600 HV, SHD 550 HV = 1.0 mm"),
    ("31CrMoV9", "gas-nitrided, surface hardness 750 HV, NHD 550 HV = 0.3 mm"),
])  # fmt: skip
def test_heat_treatment_is_noted_as_by_its_standard(material: str, note: str) -> None:
    heat_treatment = material_of(material).heat_treatment
    assert heat_treatment.endswith(note)
    soft = replace(material_of(material), case_depth=0.0)
    assert heat_treatment.startswith(soft.heat_treatment)
    assert "550 HV" not in soft.heat_treatment


@pytest.mark.parametrize("name", ["mq200_paper", "ev_disconnect", "examples/sleeve.toml"])
def test_notes_of_a_drawing_end_within_its_width(name: str) -> None:
    """A character of 12 px is 6.1 px wide on average in DejaVu Sans, which is a wide font."""
    path = Path(__file__).parents[2] / name
    study = load_study(path if path.is_file() else name)
    material = replace(study.limits.material, name="steel of a long name " * 12)
    for limits in (study.limits, replace(study.limits, material=material)):
        root = ElementTree.fromstring(dimensioned_svg(study.clutch.dog, limits))
        width, height = (float(root.get(side, "0")) for side in ("width", "height"))
        texts = [text for text in root.iter() if text.tag.endswith("text")]
        notes = [text for text in texts if text.get("x") == "36.0"]
        assert max(36.0 + 6.1 * len(note.text or "") for note in notes) < width - 20.0
        assert max(float(note.get("y", "0")) for note in notes) < height - 10.0
        words = " ".join(note.text or "" for note in notes)
        assert words.endswith("General tolerances ISO 2768-f.")
        assert not any((note.text or "").startswith(("±", "mm")) for note in notes)


@pytest.mark.parametrize(("option", "library", "words"), [
    ("--step a.step", "build123d", "STEP files need build123d; dogshape[cad]"),
    ("--dxf a.dxf", "ezdxf", "DXF files need ezdxf; dogshape[dxf]"),
    ("--fmu a.fmu", "pythonfmu3", "an FMU needs pythonfmu3; dogshape[fmu]"),
    ("--fmi 2 --fmu a.fmu", "pythonfmu", "an FMU needs pythonfmu,; dogshape[fmu]"),
])  # fmt: skip
def test_nothing_is_written_where_the_extra_is_missing(
    dogshape: Call, monkeypatch: pytest.MonkeyPatch, option: str, library: str, words: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    said = dogshape("export", "mq200_paper", "--svg", "a.svg", "--stl", "a.stl", *option.split())
    for part in words.split("; "):
        assert part in said.sentence
    assert list(Path().iterdir()) == []


def test_a_limit_of_manufacture_fails_a_check_and_refuses_no_shift(dogshape: Call) -> None:
    steep = set_options(["dog.count=12", "dog.chamfer_deg=14", "dog.height_mm=3"])
    point = ("--mismatch-rpm", 50, "--force-N", 469)
    shift = dogshape("shift", "mq200_paper", *steep, *point, "--angle-deg", 5, "--json")
    assert (shift.status, shift.json["outcome"]) == (0, "engaged")
    for verb in ("check", "strength"):
        said = dogshape(verb, "mq200_paper", *steep, *QUICK, "--json")
        assert said.status == 1
        assert "chamfer_share" in said.json["verdict"]["failed"]
        assert "landing" not in [one["check"] for one in said.json["verdict"]["not_judged"]]
    time = dogshape("check", "mq200_paper", *steep, *QUICK, "--json").json["expected_shift_time_s"]
    assert 0.02 < time < 0.3
    # Fillets that do not fit are no solid.
    round_ = ("--set", "manufacturing.root_radius_mm=4", "--stl", "ring.stl")
    assert "the largest that fits into slot and tip is" in (
        dogshape("export", "mq200_paper", *steep, *round_).sentence
    )


def test_a_searched_design_is_named_by_its_number(dogshape: Call) -> None:
    """In its folder, in results/ beside a folder of the study, in a folder with a sign."""
    config = load_study("mq200")
    content = (bundled_root() / "mq200" / "result.json").read_text()
    design = next(row for row in json.loads(content)["trials"] if not row["prototype"])
    number = design["trial"]
    for name in ("results/moto", f"results/moto#{number}0"):
        folder = StudyFolder(Path(name))
        folder.root.mkdir(parents=True)
        folder.open(config, resume=False)
        folder.result.write_text(content)
    Path("moto").mkdir()
    (Path("moto") / "study.toml").write_text(text_of(find_study("mq200")))
    for name in (f"results/moto#{number}", f"moto#{number}", f"results/moto#{number}0#{number}"):
        study = _named_study(name, [])
        assert {key: study.dog[key] for key in config.variables} == pytest.approx(
            {key: design[key] for key in config.variables}
        )
        assert named_design(name).row is not None
    own = _named_study("results/moto", ["dog.chamfer_deg=12"])
    assert (own.dog["chamfer_deg"], own.dog["count"]) == (12.0, config.file.dog.count)
    assert named_design(f"results/moto#{number}0").result is not None
    said = dogshape("strength", f"results/moto#{number}", "--set", "dog.chamfer_deg=12")
    assert said.status == 2
    assert "is a design as it was simulated, which --set would change" in said.sentence
    missing = dogshape("strength", "results/moto#9999", "--no-simulate")
    assert (missing.status, "has no design 9999" in missing.sentence) == (2, True)
