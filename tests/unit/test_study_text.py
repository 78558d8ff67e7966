"""Text of a study file with the values of a study that was changed after it was read."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import (
    Setup,
    build_study,
    bundled_studies,
    find_study,
    load_study,
    replace_keys,
)
from dogshape.pipeline.drafts.study_text import study_text
from dogshape.sim.clutch_tables import validate


def _read(text: str) -> Setup:
    return build_study(validate(StudyFile, tomllib.loads(text), "the text"))


@pytest.mark.parametrize("name", bundled_studies())
def test_an_unchanged_study_has_the_text_of_its_file(name: str) -> None:
    text = find_study(name).read_text("utf-8")
    assert study_text(load_study(name)).rstrip() == text.rstrip()


@pytest.mark.parametrize("name", bundled_studies())
@pytest.mark.parametrize(
    "settings",
    [
        {"load.torque_Nm": 180.0, "material.proof_stress_MPa": 700.0, "tolerance.height_mm": 0.1},
        {"load.landing_share": None, "name": "renamed", "search.trials": 64},
    ],
)
def test_a_changed_study_is_read_again_from_its_text(name: str, settings: dict[str, Any]) -> None:
    study = load_study(name)
    landing_share = study.file.load.landing_share
    if landing_share is None:
        settings = {key: value for key, value in settings.items() if value is not None}
    changed_study = replace_keys(study, settings)
    assert changed_study.config_hash != study.config_hash
    text = study_text(changed_study)
    assert _read(text).config_hash == changed_study.config_hash
    assert text.count("#") > 20


@pytest.mark.parametrize("name", bundled_studies())
def test_other_operating_points_replace_those_of_the_file(name: str) -> None:
    study = load_study(name)
    points = [{"mismatch_rpm": 35.0, "force_N": study.points[0].profile.force}]
    changed_study = replace_keys(study, {"operating.points": points})
    operating = tomllib.loads(study_text(changed_study))["operating"]
    assert operating.keys() == {"points"}
    assert _read(study_text(changed_study)).config_hash == changed_study.config_hash


def test_a_backlash_in_degrees_gives_way_to_one_in_mm() -> None:
    study = load_study("mq200_paper", {"dog.backlash_deg": 0.5, "dog.height_mm": 3.0})
    changed_study = replace_keys(study, {"dog.backlash_mm": 0.1})
    assert _read(study_text(changed_study)).config_hash == changed_study.config_hash


def test_a_study_without_a_file_has_all_its_values() -> None:
    study = load_study("amt")
    bare_study = ds.Study.from_config(build_study(study.file)).config
    assert bare_study.path is None
    assert _read(study_text(bare_study)).config_hash == study.config_hash
