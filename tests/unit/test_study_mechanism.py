"""``[mechanism]`` and ``[effects]`` of a study: keys, mistakes, hashes, and what they end in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.mechanism import ACTUATION
from dogshape.pipeline.config.schema import keys_like
from dogshape.pipeline.config.study_file import find_study, load_study
from dogshape.pipeline.simulate.design import tolerance_time
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.training_rows import (
    stored_surrogate,
    study_mix,
)
from dogshape.sim.clutch_tables import MechanismSection
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import FIELDS, NOTHING
from dogshape.sim.statistics.blocks import even_block
from tests.conftest import Said

Call = Callable[..., Said]
EFFECTS = load()

#: Effects that a study takes, with the keys of ``[mechanism]`` that say the same.
PAIRS: dict[str, tuple[Any, dict[str, float]]] = {
    "actuation_delay": (0.05, {"delay_s": 0.05}),
    "actuation_lag": (0.02, {"lag_s": 0.02}),
    "detent_force": (
        {"detent_N": 40.0, "position_mm": 1.5},
        {"detent_N": 40.0, "detent_position_mm": 1.5},
    ),
    "drag_torque": (0.3, {"drag_torque_Nm": 0.3}),
    "force_loss": (30.0, {"force_loss_N": 30.0}),
    "force_rise": (1.7, {"rise_factor": 1.7}),
    "force_scale": (0.83, {"force_factor": 0.83}),
    "free_play": (0.4, {"free_play_mm": 0.4}),
    "linkage_compliance": (
        {"compliance_mm_kN": 3.7, "mass_behind_kg": 0.4},
        {"compliance_mm_kN": 3.7, "added_mass_kg": 0.4},
    ),
    "moving_mass": (0.7, {"added_mass_kg": 0.7}),
    "sleeve_friction": (30.0, {"friction_N": 30.0}),
    "spline_friction": (0.1, {"spline_friction": 0.1}),
    "viscous_damping": (60.0, {"damping_Ns_m": 60.0}),
}
PARTS = ("friction_N", "spline_friction", "added_mass_kg", "drag_torque_Nm", "damping_Ns_m",
         "compliance_mm_kN", "free_play_mm", "detent_N", "delay_s", "lag_s", "force_loss_N",
         "ring_inertia_kgm2", "wheel_inertia_kgm2")  # fmt: skip
PLACES = {"spline_radius_mm": 15.0, "detent_position_mm": 2.0, "detent_width_mm": 3.0,
          "input_stiffness_Nm_rad": 15e3, "spline_backlash_deg": 0.2,
          "output_stiffness_Nm_rad": 8e3}  # fmt: skip
NONE = {**dict.fromkeys(PARTS, 0.0), **PLACES, "force_factor": 1.0, "rise_factor": 1.0}


def _mechanism(**keys: float) -> dict[str, float]:
    return {f"mechanism.{key}": value for key, value in keys.items()}


def test_every_field_of_a_mechanism_has_its_key() -> None:
    keys = set(MechanismSection.model_fields)
    assert keys == {*FIELDS, *ACTUATION.values()}


def test_an_option_that_is_a_key_is_told() -> None:
    found = keys_like("spline")
    assert found[:2] == ["mechanism.spline_friction", "mechanism.spline_radius_mm"]
    assert found[2:] == ["mechanism.spline_backlash_deg"]
    assert keys_like("chamfer")[0] == "dog.chamfer_deg"


def test_a_mechanism_of_noughts_is_none() -> None:
    plain, study = load_study("mq200_paper"), load_study("mq200_paper", _mechanism(**NONE))
    assert study.clutch == plain.clutch
    assert study.clutch.mechanism == NOTHING
    assert study.points == plain.points
    assert study.physics_hash == plain.physics_hash
    assert study.mechanism == {}
    assert even_block(study.clutch, study.points[3], 3, (1, 3)).keys == (
        even_block(plain.clutch, plain.points[3], 3, (1, 3)).keys
    )


@pytest.mark.parametrize("name", PAIRS)
def test_effect_and_mechanism_are_one_physics(name: str) -> None:
    value, keys = PAIRS[name]
    effect, mechanism = (
        load_study("mq200_paper", given)
        for given in ({f"effects.{name}": value}, _mechanism(**keys))
    )
    assert effect.clutch == mechanism.clutch
    assert effect.points == mechanism.points
    assert effect.physics == mechanism.physics != load_study("mq200_paper").physics
    assert effect.mechanism.items() >= keys.items()


def test_inertia_as_an_effect_is_that_of_the_sliding_table() -> None:
    effect, table = (
        load_study("mq200_paper", given)
        for given in ({"effects.sliding_inertia": 3.0}, {"sliding.inertia_kgm2": 0.03})
    )
    assert effect.clutch == table.clutch
    assert effect.physics == table.physics


MORE = ("contact_friction", "contact_dissipation", "sliding_inertia")


@pytest.mark.parametrize("name", [*PAIRS, *MORE])
def test_a_study_has_the_shifts_that_the_diagnosis_has(name: str) -> None:
    """The bank's way: the effect applied to a setting of the plain study."""
    plain, effect = load_study("mq200_paper"), EFFECTS[name]
    values = {one.name: one.at(0.4) for one in effect.parameters}
    study = load_study("mq200_paper", {f"effects.{name}": values})
    setting = effect.apply(Setting(plain.clutch, plain.points[5]), values)
    point = study.points[5]
    prompt = replace(point, profile=replace(point.profile, delay=0.0))
    angles = (0.05, 0.2)
    assert setting.block(angles).keys == Setting(study.clutch, prompt).block(angles).keys
    assert point.profile.delay == setting.delay


MISTAKES = {
    "'effects.spline_fricton' is not a known effect; did you mean 'spline_friction'": {
        "effects.spline_fricton": 0.1
    },
    "mechanism.spline_friction is 2, but it must lie between 0 and 1.5; correct": {
        "mechanism.spline_friction": 2.0
    },
    "effects.sleeve_friction: mechanism.friction_N is -3 N, but it must": {
        "effects.sleeve_friction": -3
    },
    "effects.actuation_delay: mechanism.delay_s is -0.1 s, but": {"effects.actuation_delay": -0.1},
    "mechanism.lag_s is 1e-07 s, but it must lie between 1e-05 and 10 s": {"mechanism.lag_s": 1e-7},
    "force loss is 300 N, but it must leave 1 N or more of the shift force, 235.2 N; give a": {
        "mechanism.force_loss_N": 300.0
    },
    "mechanism.detent_position_mm belongs to mechanism.detent_N, which is not given": {
        "mechanism.detent_position_mm": 1.0
    },
    "mechanism.friction_N and effects.sleeve_friction both set mechanism.friction_N; leave out": {
        "mechanism.friction_N": 30.0,
        "effects.sleeve_friction": 30.0,
    },
    "contact.dynamic_friction and effects.contact_friction both set contact.dynamic_friction": {
        "contact.dynamic_friction": 0.11,
        "effects.contact_friction": {"static_friction": 0.2, "dynamic_friction": 0.1},
    },
    "effects.contact_friction is 0.1, but it must be a table of numbers; write effects.contact": {
        "effects.contact_friction": 0.1
    },
    "effects.drag_torque is 'low', but it must be a number, its drag_Nm; write": {
        "effects.drag_torque": "low"
    },
    "effects.reversed_mismatch is 1, but it must be true or false; write": {
        "effects.reversed_mismatch": 1
    },
    "effects.reversed_mismatch changes the mismatch, which .operating. gives": {
        "effects.reversed_mismatch": True
    },
    "effects.axial_gap changes the dog, which .dog. and .variables. give": {
        "effects.axial_gap": 0.1
    },
    "effects.relative_angle changes how often each relative angle comes": {
        "effects.relative_angle": {"concentration": 2.0, "centre_pitch": 0.3}
    },
}


@pytest.mark.parametrize("words", MISTAKES)
def test_mistakes_are_sentences(words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_study("mq200_paper", MISTAKES[words])


def test_force_at_the_sleeve_is_known_everywhere() -> None:
    study = load_study("mq200_paper", _mechanism(force_factor=0.8))
    plain = load_study("mq200_paper")
    assert study.forces == [0.8 * force for force in plain.forces]
    assert [p.profile.force for p in study.points] == [0.8 * p.profile.force for p in plain.points]
    assert [p.profile.rise for p in study.points] == [p.profile.rise for p in plain.points]
    assert study.operating_text == plain.operating_text
    middle = plain.actuation.profile(400.0)
    assert study.actuation.profile(400.0) == replace(middle, force=0.8 * 400.0)
    at_sleeve = study.actuation.at_sleeve(0.8 * 400.0)
    assert (at_sleeve.force, at_sleeve.rise) == pytest.approx((320.0, middle.rise))


def test_what_is_uncertain_keeps_dead_time_and_lag() -> None:
    factor = {"distribution": "uniform", "low": 0.9, "high": 1.1}
    spread = {
        "uncertain.force_factor": factor,
        "actuation.force_N": [100.0, 1000.0],
        "actuation.rise_s": [0.3, 0.1],
    }
    study = load_study("mq200_paper", {**spread, **_mechanism(delay_s=0.05, lag_s=0.02)})
    assert study.uncertainty is not None
    variant = study.uncertainty.variants(study.points[0], 3, 1, 0)[0]
    drawn = variant.point(study.points[0]).profile
    assert (drawn.delay, drawn.lag) == (0.05, 0.02)
    assert drawn.force == pytest.approx(variant.force * study.points[0].profile.force)
    assert drawn.rise == pytest.approx(study.actuation.at_sleeve(drawn.force).rise)


def test_a_wider_gap_adds_the_flight_of_all_that_moves() -> None:
    stored, _ = stored_surrogate(load_study("mq200_paper"), None)
    plain, heavy = (
        load_study("mq200_paper"),
        load_study("mq200_paper", _mechanism(added_mass_kg=0.9)),
    )
    times = [
        tolerance_time(one, stored.surrogate, one.prototype, study_mix(one))
        for one in (plain, heavy)
    ]
    gaps = [time.by_dimension_s["axial_gap"] for time in times]
    assert gaps[1] > 1.2 * gaps[0]


def test_a_study_file_may_hold_them(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    text = find_study("mq200_paper").read_text()
    path.write_text(
        f"{text}\n[mechanism]\nspline_friction = 0.1\ndelay_s = 0.05\n"
        "\n[effects]\ndrag_torque = 0.2\ncontact_dissipation = 3.0\n"
    )
    study = load_study(path)
    folder = StudyFolder(tmp_path / "results")
    folder.root.mkdir()
    folder.open(study, resume=False)
    assert folder.stored_study().clutch == study.clutch
    assert folder.stored_study().config_hash == study.config_hash
    assert study.clutch.contact.dissipation == 3.0
    assert study.retraction == pytest.approx(0.25)
