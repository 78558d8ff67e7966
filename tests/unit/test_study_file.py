"""The study file: what it builds, and one sentence for every mistake."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dogshape.pipeline.config.schema import SearchSection
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root


def test_paper_study_is_the_prototype_at_the_published_points() -> None:
    study = load_study("mq200_paper")
    assert study.clutch.dog.count == 15
    assert study.clutch.contact.name == "lubricated_steel"
    assert len(study.points) == 28
    assert {round(p.mismatch / RPM) for p in study.points} == {5, 10, 25, 50, 100, 149, 249}
    assert study.prototype["height_mm"] == 3.7
    assert study.clutch.shift_travel == pytest.approx(4.65e-3)


def test_overrides_replace_keys_and_change_the_right_hashes() -> None:
    plain = load_study("mq200_paper")
    other_dog = load_study("mq200_paper", ["dog.chamfer_deg=14", "dog.count=18"])
    other_contact = load_study("mq200_paper", ["contact.set=adams2019"])
    assert other_dog.prototype["chamfer_deg"] == 14
    assert other_dog.physics_hash == plain.physics_hash
    assert other_dog.config_hash != plain.config_hash
    assert other_contact.physics_hash != plain.physics_hash


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("dog.heigth_mm=3", "'dog.heigth_mm' is not a known key; did you mean 'dog.height_mm'?"),
        ("surprise.key=1", "'surprise' is not a known key; valid are"),
        ("dog.height_mm='3.7 mm'", "dog.height_mm is '3.7 mm', but it must be a number in mm; "),
        ("dog.height_mm=0.0037", "dog.height_mm is 0.0037 mm"),
        ("dog.chamfer_deg=nan", "dog.chamfer_deg is nan deg"),
        ("sliding.mass_kg=-0.3", "sliding.mass_kg is -0.3 kg"),
        ("dog.count=70", "tip width at the inner radius is -"),
        ("dog.chamfer_deg=30", "height of the braking flank is"),
        ("contact.set=lubricated_stel", "did you mean 'lubricated_steel'?"),
        ("contact.dynamic_friction=0.5", "it must not exceed contact.static_friction = 0.12"),
        ("shift.timeout_s=-1", "shift.timeout_s is -1 s"),
        ("operating.force_N=[100]", "the rise times of the study cover 235.2 to 641.5 N"),
        ("actuation.rise_s=[0.1]", "actuation.force_N has 4 and actuation.rise_s 1 values"),
        ("variables.count=[24, 6]", "variables.count is [24, 6]"),
        ("variables.braking_deg=[5, 70]", "variables.braking_deg is 70 deg"),
        ("load.load_height=0.4", "load.load_height is 0.4, but it must lie between 0.5 and 1"),
        ("load.friction_hold=0.2", "load.friction_hold is 0.2, but it must not exceed"),
        ("material.set=16MnCr", "which is not a material set; did you mean '16MnCr5'?"),
        ("material.proof_stress_MPa=1", "material.proof_stress_MPa is 1 MPa"),
        ("tolerance.height_mm=-1", "tolerance.height_mm is -1 mm"),
        ("manufacturing.chamfer_share=0.6", "manufacturing.chamfer_share is 0.6"),
        ("solver.scheme=rk4", "solver.scheme is 'rk4', which is not a scheme"),
        ("format=2", "format is 2, but this version reads format 1"),
        ("dog.count", "--set dog.count is not KEY=VALUE"),
        ("chamfer_deg=9", "'chamfer_deg' is not a known key; did you mean 'dog.chamfer_deg'?"),
        ("name.x=1", "--set name.x=1: name is a value and not a table"),
    ],
)
def test_every_mistake_is_one_sentence(override: str, sentence: str) -> None:
    with pytest.raises(DogshapeError) as refused:
        load_study("mq200_paper", [override])
    text = str(refused.value)
    assert sentence in text
    assert "\n" not in text


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(DogshapeError, match="there is no study at"):
        load_study(tmp_path / "nowhere")
    broken = tmp_path / "study.toml"
    broken.write_text("format = 1\nname = \n")
    with pytest.raises(DogshapeError, match=r"not valid TOML.*line 2"):
        load_study(tmp_path)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DogshapeError, match="not valid TOML"):
        load_study(broken)
    broken.write_text("format = 1\nname = 'x'\n")
    with pytest.raises(DogshapeError, match="'dog' is missing; add it"):
        load_study(broken)


@pytest.mark.parametrize("name", ["mq200", "mq200_paper", "mq200_robust", "mq200_three"])
def test_a_key_that_came_later_leaves_kept_results_of_the_same_study(name: str) -> None:
    kept = json.loads((bundled_root() / name / "result.json").read_text(encoding="utf-8"))
    assert load_study(name).config_hash == kept["config_hash"]


def test_an_override_without_a_value_takes_a_key_out() -> None:
    """As if the file did not have it: a key with a default then has that."""
    plain = load_study("mq200_paper", ["load.landing_share=", "search.confirm_angles="])
    assert plain.file.load.landing_share is None
    fields = SearchSection.model_fields
    assert plain.file.search.confirm_angles == fields["confirm_angles"].default
    assert load_study("mq200_paper", {"load.landing_share": None}).file.load == (
        load_study("mq200_paper", ["load.landing_share="]).file.load
    )
    with pytest.raises(InputError, match="'name' is missing"):
        load_study("mq200_paper", ["name="])
    with pytest.raises(InputError, match=r"no key search\.screen to take out; check the key"):
        load_study("mq200_paper", ["search.screen="])
