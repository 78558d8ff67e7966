"""Actuators of a study: keys, refusals, records, drafts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import dogshape as ds
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.drafts.draft_keys import ACTUATOR_NUMBERS
from dogshape.pipeline.drafts.study_folder import write_study
from dogshape.pipeline.simulate.design import design_of
from dogshape.sim.errors import InputError
from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.actuators import EXAMPLES, KINDS, PROFILE, keys_of, required_keys
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.statistics.shift_records import clutch_record
from dogshape.validation.second_engine import stand_of


def _settings(kind: str, **changes: Any) -> dict[str, Any]:
    """Return the keys of an example at full command; None leaves one of them out."""
    changes = {"variables.height_mm": [1.6, 5.0], **changes}
    numbers = record_quantities(EXAMPLES[kind])
    keys = {f"actuation.{key}": value for key, value in numbers.items() if value}
    settings = {"actuation.kind": kind, "operating.force_N": None, **keys, **changes}
    absent = {key for key in changes if key.startswith("actuation.") and changes[key] is None}
    return {key: value for key, value in settings.items() if key not in absent}


def _study(kind: str, **changes: Any) -> Setup:
    return load_study("mq200", _settings(kind, **changes))


@pytest.mark.parametrize("kind", KINDS)
def test_a_study_takes_each_kind(kind: str) -> None:
    study = _study(kind)
    example = EXAMPLES[kind]
    assert study.clutch.actuator is not None
    assert study.clutch.actuator.record == pytest.approx(example.record)
    assert study.forces == [pytest.approx(example.full_force)]
    assert study.actuator_text.startswith(f"actuator: {kind}, at most ")
    assert study.clutch.has_forces
    names = set(clutch_record(study.clutch))
    assert {"actuator", *(f"{kind}_{key}" for key in keys_of(kind))} <= names


def test_a_profile_has_no_trace_in_hash_and_record() -> None:
    """Keys added later are no part of a hash at their default."""
    plain = load_study("mq200")
    named = load_study("mq200", {"actuation.kind": PROFILE})
    assert named.config_hash == plain.config_hash == "0d6af760e1fdd8166227"
    assert plain.clutch.actuator is None
    assert plain.actuator_text == ""
    assert "actuator" not in plain.physics


def test_an_actuator_reaches_the_depth_of_the_lower_dog() -> None:
    """The travel of searched heights ends where the higher dog meets the floor of the lower."""
    cam = {"actuation.stroke_mm": 5.0}
    output = {"variables.output_dog.height_mm": [2.0, 5.0]}
    without = {"variables.height_mm": None}
    assert _study("cam", **cam, **output, **without).variables["output_dog_height_mm"][1] == 5.0
    assert _study("cam", **cam, **{"output_dog.height_mm": 3.7}).variables["height_mm"][1] == 5.0
    with pytest.raises(InputError, match=r"5\.95 mm into engagement at the end of variables\.hei"):
        _study("cam", **cam, **output)


def test_numbers_of_an_actuator_change_the_physics() -> None:
    force = {"operating.force_N": [400.0]}
    stiff = _study("cam", **force)
    soft = _study("cam", **force, **{"actuation.stiffness_N_mm": 300.0})
    assert stiff.points == soft.points
    assert stiff.physics_hash != soft.physics_hash


@pytest.mark.parametrize(
    ("kind", "changes", "sentence"),
    [
        ("cam", {"actuation.stroke_mm": None}, "'actuation.stroke_mm' is missing; add it"),
        (
            "cam",
            {"operating.force_N": [600.0]},
            "shift force is 600 N, but the cam actuator gives 500 N at its full force limit; lower",
        ),
        (
            "cam",
            {"actuation.supply_bar": 8.0},
            'supply_bar belongs to actuation.kind = "pneumatic" or "hydraulic", but the kind is',
        ),
        ("cam", {"actuation.rise_s": [0.1]}, 'rise_s belongs to actuation.kind = "profile"'),
        ("cam", {"actuation.stroke_mm": 3.0}, "with 500 N is 3 mm, but the ring travels 4.65 mm"),
        (
            "cam",
            {"actuation.stroke_mm": 5.0},
            "ring travels 5.95 mm into engagement at the end of variables.height_mm; narrow",
        ),
        (
            "spring",
            {"operating.force_N": [80.0]},
            "spring actuator pushes with 80 N is 4 mm, but the ring travels 4.65 mm into",
        ),
        (
            "solenoid",
            {"actuation.return_preload_N": 200.0},
            "pushes with 250 N is 0 mm, but the ring travels",
        ),
        (
            "solenoid",
            {"actuation.end_force_N": 100.0},
            "end_force_N is 100 N, but it must exceed actuation.start_force_N = 150; exchange",
        ),
        (
            "solenoid",
            {"mechanism.lag_s": 0.02},
            "lag_s is 0.02 s, but the solenoid actuator has a course of its own, the rise of its",
        ),
        ("motor", {"effects.actuation_lag": 0.02}, "the run-up of its inertia; leave it out"),
        (
            "cam",
            {"mechanism.rise_factor": 2.0},
            "rise_factor is 2, but the cam actuator has no rise time that it could scale; leave",
        ),
        (
            "cam",
            {"variables.rise_factor": [0.5, 2.0]},
            "variables.rise_factor is [0.5, 2], but the cam actuator has no rise time; leave it",
        ),
        (
            "cam",
            {"variables.force_factor": [0.5, 1.2]},
            "largest force of variables.force_factor is 600 N, but the cam actuator gives 500 N",
        ),
        (
            "hydraulic",
            {"actuation.back_pressure_bar": 2.0},
            "actuation.back_pressure_bar and actuation.back_area_cm2 go together; give both",
        ),
        (
            "pneumatic",
            {"actuation.return_preload_N": 2000.0},
            "static force of the pneumatic actuator is -1000 N, but it must leave 1 N or more at",
        ),
        ("pneumatic", {"actuation.supply_bar": 2000.0}, "it must lie between 0.1 and 1000 bar"),
    ],
)
def test_contradictions_have_a_sentence(kind: str, changes: Any, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        _study(kind, **changes)
    assert sentence in str(refused.value)


def test_other_sentences() -> None:
    with pytest.raises(InputError, match="kind is 'coil', but it must be one of 'profile', 'spr"):
        load_study("mq200", {"actuation.kind": "coil"})
    with pytest.raises(InputError, match=r"'actuation\.rise_s' is missing; add it"):
        load_study("mq200", {"actuation.rise_s": None})
    points = [{"mismatch_rpm": 50.0}]
    with pytest.raises(InputError, match=r"'operating\.points\.0\.force_N' is missing; add it"):
        load_study("mq200", {"operating.points": points})
    assert _study("cam", **{"operating.points": points}).forces == [500.0]
    study = _study("cam")
    with pytest.raises(InputError, match=r"rise time of the force is 0\.1 s, but the cam actuator"):
        study.actuation.profile(400.0, 0.1)
    with pytest.raises(InputError, match="the second engine has no cam actuator; take actuation"):
        stand_of(study.clutch)


def test_effects_act_on_the_command() -> None:
    """A factor above 1 is a deviation of the actuator, which may exceed its nominal force."""
    study = _study(
        "spring",
        **{"effects.force_scale": 1.2, "mechanism.lag_s": 0.01, "mechanism.force_loss_N": 30.0},
    )
    profile = study.points[0].profile
    assert (profile.force, profile.lag) == pytest.approx((360.0, 0.01))
    numbers = study.clutch.shift_numbers(profile).actuator
    assert (numbers.command, numbers.force_share) == pytest.approx((360.0, 330.0 / 360.0))
    assert study.clutch.numbers.actuator.kind == 0


def test_checks_take_the_static_force() -> None:
    """The shift force is the limit of what pulls the ring out."""
    checks = {check.name: check for check in design_of(_study("hydraulic"), {}).checks}
    assert checks["pull_out_force"].limit == pytest.approx(450.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_draft_has_an_example_for_each_kind(kind: str, tmp_path: Path) -> None:
    draft = write_study(tmp_path / "own", "mq200", {"actuation.kind": kind})
    study = load_study(str(tmp_path / "own"))
    assert study.clutch.actuator is not None
    assert study.clutch.actuator.kind == kind
    notes = " ".join(draft.assumed)
    assert "an example, give your actuator's: actuation." in notes
    assert all(f"actuation.{key} " in notes for key in required_keys(kind))
    assert "replaced by values of yours: actuation.force_N, actuation.rise_s" in notes
    assert study.forces == [pytest.approx(study.clutch.actuator.full_force, abs=0.01)]
    assert all(f"actuation.{key}" in ACTUATOR_NUMBERS for key in keys_of(kind))


def test_the_dialogue_asks_for_the_kind_and_its_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    typed = "mq200|solenoid|60|180|6 mm|12 V|2,1 ohm|9 mH||25 N||".replace("|", "\n") + 60 * "\n"
    done = CliRunner().invoke(app, ["init", "study", "--out", "coil"], input=typed)
    assert done.exit_code == 0, done.stderr
    assert "kind of the actuator; profile: a force over time [profile]:" in done.stderr
    assert "final forces of the actuator" not in done.stderr
    actuator: Any = load_study("coil").clutch.actuator
    assert (actuator.start_force, actuator.end_force) == (60.0, 180.0)
    assert actuator.inductance == pytest.approx(9e-3)


#: The actuators of assumed data sheets, none measured: kind to begin with, and values.
SHEETS: dict[str, tuple[str, dict[str, Any]]] = {
    "motorcycle gear": ("motorcycle", {
        "actuation.kind": "cam", "actuation.stroke_mm": 7.0, "actuation.ramp_deg": 60.0,
        "actuation.drum_speed_rpm": 250.0, "actuation.stiffness_N_mm": 500.0,
        "actuation.force_limit_N": 250.0, "mechanism.added_mass_kg": 0.15,
    }),
    "truck sleeve": ("amt", {
        "actuation.kind": "pneumatic", "actuation.supply_bar": 12.0, "actuation.area_cm2": 19.6,
        "actuation.back_pressure_bar": 0.5, "actuation.back_area_cm2": 12.5,
        "actuation.conductance_dm3_s_bar": 1.6, "actuation.dead_volume_cm3": 1200.0,
    }),
    "electric disconnect": ("ev_disconnect", {
        "actuation.kind": "solenoid", "actuation.start_force_N": 60.0,
        "actuation.end_force_N": 180.0, "actuation.stroke_mm": 4.0, "actuation.voltage_V": 12.0,
        "actuation.resistance_ohm": 2.1, "actuation.inductance_mH": 9.0,
        "actuation.return_preload_N": 25.0,
    }),
    "rally gear": ("motorcycle", {
        "actuation.kind": "motor", "actuation.stall_torque_Nm": 0.6,
        "actuation.no_load_speed_rpm": 6000.0, "actuation.torque_limit_Nm": 0.36,
        "actuation.rotor_inertia_kgm2": 5e-6, "actuation.gear_ratio": 1.0,
        "actuation.lead_mm": 5.0, "actuation.stiffness_N_mm": 5000.0,
    }),
    "outboard": ("mq200", {
        "actuation.kind": "spring", "actuation.preload_N": 250.0, "actuation.rate_N_mm": 12.0,
    }),
}  # fmt: skip


@pytest.mark.parametrize("name", SHEETS)
def test_a_data_sheet_is_entered_by_its_actuator(name: str, tmp_path: Path) -> None:
    """Draft, study and one shift, by options alone."""
    origin, values = SHEETS[name]
    draft = write_study(tmp_path / "own", origin, {**values, "operating.mismatch_rpm": [40.0]})
    assert "an example" not in " ".join(draft.assumed)
    study = load_study(str(tmp_path / "own"))
    clutch = replace(study.clutch, timeout=2.0).with_engine("planar")
    outcomes = {
        engage(clutch, study.points[0], share * clutch.dog.pitch_angle).outcome
        for share in (0.1, 0.5, 0.8)
    }
    assert Outcome.ENGAGED in outcomes
    assert Outcome.DIVERGED not in outcomes


def test_a_profile_needs_the_force_of_a_shift() -> None:
    with pytest.raises(InputError, match="one operating point needs mismatch_rpm and force_N; giv"):
        ds.Study("mq200").shift(mismatch_rpm=50, angle_deg=9)


def test_results_name_the_actuator(tmp_path: Path) -> None:
    write_study(tmp_path / "own", "mq200", {"actuation.kind": "cam"})
    study = ds.Study(tmp_path / "own")
    shift = study.shift(mismatch_rpm=50, angle_deg=9)
    assert shift.engagement.point.profile.force == 500.0
    assert "actuator: cam, at most 500 N: stroke 8 mm" in str(shift)
    assert shift.to_dict()["actuator"]["cam_ramp_deg"] == pytest.approx(60.0)
