"""``[mechanism]`` and ``[effects]`` of a study: keys, mistakes, hashes, and what they end in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.tolerance_time import tolerance_time
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.sim.clutch_tables import MechanismSection
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.shift.mechanism import NO_MECHANISM

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
PLACES = {"spline_radius_mm": 15.0, "detent_position_mm": 2.0, "detent_width_mm": 3.0,
          "input_stiffness_Nm_rad": 15e3, "spline_backlash_deg": 0.2,
          "output_stiffness_Nm_rad": 8e3, "force_factor": 1.0, "rise_factor": 1.0}  # fmt: skip
NONE = dict.fromkeys(MechanismSection.model_fields, 0.0) | PLACES


def _mechanism(**keys: float) -> dict[str, float]:
    return {f"mechanism.{key}": value for key, value in keys.items()}


def test_a_mechanism_of_noughts_is_none() -> None:
    plain, study = load_study("mq200_paper"), load_study("mq200_paper", _mechanism(**NONE))
    assert study.clutch == plain.clutch
    assert (study.clutch.mechanism, study.mechanism) == (NO_MECHANISM, {})
    assert (study.points, study.physics_hash) == (plain.points, plain.physics_hash)


@pytest.mark.parametrize("name", PAIRS)
def test_effect_and_mechanism_are_one_physics(name: str) -> None:
    value, keys = PAIRS[name]
    effect = load_study("mq200_paper", {f"effects.{name}": value})
    mechanism = load_study("mq200_paper", _mechanism(**keys))
    assert effect.clutch == mechanism.clutch
    assert effect.points == mechanism.points
    assert effect.physics == mechanism.physics != load_study("mq200_paper").physics
    assert effect.mechanism.items() >= keys.items()


@pytest.mark.parametrize(
    "name", [*PAIRS, "contact_friction", "contact_dissipation", "sliding_inertia"]
)
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


def test_force_at_the_sleeve_is_known_everywhere() -> None:
    study = load_study("mq200_paper", _mechanism(force_factor=0.8))
    plain = load_study("mq200_paper")
    assert study.forces == [0.8 * force for force in plain.forces]
    assert [p.profile.rise for p in study.points] == [p.profile.rise for p in plain.points]
    middle = plain.actuation.profile(400.0)
    assert study.actuation.profile(400.0) == replace(middle, force=0.8 * 400.0)
    assert study.actuation.at_sleeve(320.0).rise == pytest.approx(middle.rise)


def test_what_is_uncertain_keeps_dead_time_and_lag() -> None:
    spread = {
        "uncertain.force_factor": {"distribution": "uniform", "low": 0.9, "high": 1.1},
        "actuation": {"force_N": [100.0, 1000.0], "rise_s": [0.3, 0.1]},
    }
    study = load_study("mq200_paper", {**spread, **_mechanism(delay_s=0.05, lag_s=0.02)})
    assert study.uncertainty is not None
    point = study.points[0]
    variant = study.uncertainty.variants(point, 3, 1, 0)[0]
    drawn = variant.point(point).profile
    assert drawn.force == pytest.approx(variant.force * point.profile.force)
    assert drawn.rise == pytest.approx(study.actuation.at_sleeve(drawn.force).rise)
    assert drawn == replace(point.profile, force=drawn.force, rise=drawn.rise)


def test_a_wider_gap_adds_the_flight_of_all_that_moves() -> None:
    known = stored_surrogate(load_study("mq200_paper"), None)[0].surrogate
    studies = [load_study("mq200_paper", more) for more in ({}, _mechanism(added_mass_kg=0.9))]
    plain, heavy = (tolerance_time(s, known, s.prototype, study_mix(s)) for s in studies)
    assert heavy.by_dimension_s["axial_gap"] > 1.2 * plain.by_dimension_s["axial_gap"]


def test_a_folder_keeps_mechanism_and_effects(tmp_path: Path) -> None:
    given = {"mechanism.delay_s": 0.05, "effects": {"drag_torque": 0.2, "contact_dissipation": 3.0}}
    study, folder = load_study("mq200_paper", given), StudyFolder(tmp_path)
    folder.open(study, resume=False)
    stored = folder.stored_study()
    assert (stored.clutch, stored.config_hash) == (study.clutch, study.config_hash)
    assert study.clutch.contact.dissipation == 3.0
    assert study.retraction == pytest.approx(0.25)
