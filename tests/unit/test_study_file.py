"""The study file: what it builds, and a sentence of the project's own for every mistake."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel, ValidationError

from dogshape.bench.stand_file import _BenchFile
from dogshape.pipeline.config.schema import SearchSection, StudyFile, keys_like
from dogshape.pipeline.config.study_file import load_study, require_variables
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.search.confirmation import new_angles
from dogshape.sim.clutch_tables import RULES, BrokenRule, DriveSection
from dogshape.sim.errors import DogshapeError, GeometryError, InputError
from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.drive import NO_DRIVE, Drive, SpeedControl
from dogshape.sim.units import DEG, MM, RPM

DRAWN = "operating.mismatch_rpm={distribution="
FORCE = "operating.force_N={distribution="
FRICTION = "uncertain.friction_factor={distribution="
POINT = "{mismatch_rpm=5, force_N=300"
STRIKE = ["strike.ring_inertia_kgm2=5e-4", "strike.input_stiffness_Nm_rad=15e3"]
SHAFT = ["mechanism.ring_inertia_kgm2=5e-4", "mechanism.input_stiffness_Nm_rad=15000"]
MISTAKES: list[tuple[str | list[str] | dict[str, Any], str]] = [
    ("dog.heigth_mm=3", "'dog.heigth_mm' is not a known key; did you mean 'dog.height_mm'?"),
    ("chamfer_deg=9", "'chamfer_deg' is not a known key; did you mean 'dog.chamfer_deg'?"),
    ("dog.backlash=1", "'dog.backlash' is not a known key; did you mean 'dog.backlash_mm'?"),
    ("dog.chamfer=9", "'dog.chamfer' is not a known key; did you mean 'dog.chamfer_deg'?"),
    ("dog.torque=90", "'dog.torque' is not a known key; did you mean 'load.torque_Nm'?"),
    ("surprise.key=1", "'surprise' is not a known key; valid are"),
    ("dog.height_mm='3.7 mm'", "'3.7 mm', but it must be a number in mm; write the number alone"),
    ("dog.height_mm='3,7'", "but it must be a number in mm; write 3.7"),
    ("dog=3", "dog is 3, but it must be a table of keys; give its keys one by one"),
    ("dog.chamfer_deg=nan", "dog.chamfer_deg is nan deg"),
    ("dog.count=70", "tip width at the inner radius is -"),
    ("contact.set=lubricated_stel", "did you mean 'lubricated_steel'?"),
    ("expectation.limit_torques_Nm=[2.0, 0.0]", "limit_torques_Nm is 0 N m, but each torque is an"),
    ("expectation.limit_torques_Nm=[2.0, 2.0]", "limit_torques_Nm is 2 N m, but each torque is an"),
    ("expectation.limit_torque_side=input", "limit_torque_side is 'input', but it must be one of"),
    ("contact.dynamic_friction=0.5", "it must not exceed contact.static_friction = 0.12"),
    (["dog.backlash_mm=0.3", "dog.backlash_deg=1"], "dog.backlash_deg is 1 deg beside dog.backl"),
    ("dog.backlash_deg='1 deg'", "dog.backlash_deg is '1 deg', but it must be a number in deg"),
    ("dog.backlash_deg=200", "backlash_deg is 200 deg, but it must lie between 0 and 119.366 deg"),
    (["dog.backlash_deg=1", "dog.inner_diameter_mm=x"], "inner_diameter_mm is 'x', but it must be"),
    ("dog.chamfer_back_deg=12", "it must be 0 with dog.crest = 1: the ridge stands on the"),
    ("variables.output_dog.heigt_mm=[2, 3]", "did you mean 'variables.output_dog.height_mm'"),
    ("variables.output_dog.height_mm=[3, 2]", "variables.output_dog.height_mm is [3, 2], but the"),
    ("variables.output_dog.height_mm=[0.1, 2]", "is 0.1 mm, but it must lie between 0.2 and 100"),
    ("variables.output_dog.crest=[0.5, 2]", "variables.output_dog.crest is 2, but it must lie"),
    ("variables.output_dog.traction_deg=[5, 9]", "dogs of one number, annulus and pair of side"),
    ("variables.output_dog.edge_radius_mm=[0, 1]", "did you mean 'output_dog.edge_radius_mm'?"),
    ("variables.output_dog=[2, 3]", "variables.output_dog is [2, 3], but it must be a table"),
    (["variables.output_dog.height_mm=[2, 3]", "wear.crest_loss_mm=0.05"],
     "[variables.output_dog] makes them unlike; leave one of them out"),
    ("variables.crest=[0.3, 1.5]", "variables.crest is 1.5, but it must lie between 0 and 1"),
    (["dog.traction_deg=-5", "dog.braking_deg=-3"], "play at the mouth of a slot is -0."),
    (["contact.set=adams_impact", "solver.engine=drake"],
     "but contact set 'adams_impact' has the law IMPACT for a whole dog, which Drake has not"),
    (["contact.set=adams_impact", "contact.stiffness_Pa_m=1e12"],
     "contact.stiffness_Pa_m is 1e+12 Pa/m, but the set has the law IMPACT, which has its own"),
    (["contact.set=adams_impact", "contact.stiction_velocity_m_s=1"],
     "contact.stiction_velocity_m_s is 1 m/s, but friction is dynamic from 1 m/s on"),
    (["contact.set=adams_impact", "effects.contact_dissipation=3"], "leave it out, or take"),
    ("shift.timeout_s=-1", "shift.timeout_s is -1 s, but it must lie between 0.001 and 60 s"),
    ("driveline.stiffness_Nm_rad=0", "must lie between 1 and 1e+07 N m/rad; check the value"),
    ("actuation.rise_s=[0.1]", "actuation.force_N has 4 and actuation.rise_s 1 values"),
    ("variables.braking_deg=[5, 70]", "variables.braking_deg is 70 deg, but it must lie between"),
    ("load.load_height=0.4", "load.load_height is 0.4, but it must lie between 0.5 and 1"),
    ("load.friction_hold=0.2", "load.friction_hold is 0.2, but it must not exceed"),
    ("load.spectrum=[[0, 1e4]]", "load.spectrum: largest torque is 0, but it must lie between"),
    ("load.spectrum=[[1.0]]", "load.spectrum.0 is [1.0], but it must be a list of at least 2"),
    ("strike.ring_inertia_kgm2=1", "'strike.input_stiffness_Nm_rad' is missing; add it"),
    ([*STRIKE, "strike.wheel_inertia_kgm2=0.01"], "go together"),
    ([*STRIKE, "strike.ring_inertia_kgm2=0.02"], "it is a part of sliding.inertia_kgm2 = 0.01"),
    ([*STRIKE, "strike.strikes=0"], "strike.strikes is 0"),
    ([*STRIKE, "strike.ring_inertia_kgm2=[1e-4]"], "must be a list of at least 2 values"),
    ([*STRIKE, "strike.ring_inertia_kgm2=[1e-4,0.02]"], "it is a part of sliding.inertia_kgm2"),
    ("load.accuracy=14", "load.accuracy is 14, but it must lie between 1 and 11"),
    ("load.pitch_sd_um=-1", "load.pitch_sd_um is -1 um"),
    (["load.accuracy=6", "load.pitch_sd_um=3"], "leave out one"),
    ("load.tilt_mrad=-1", "load.tilt_mrad is -1 mrad, but"),
    ("load.run_out_um=2000", "load.run_out_um is 2000 um"),
    ("load.pull_out_force_limit_N=0", "load.pull_out_force_limit_N is 0 N"),
    ("manufacturing.rim_mm=0", "manufacturing.rim_mm is 0 mm"),
    ("contact.stiffness_Pa_m=1e10", "contact.stiffness_Pa_m is 1e+10 Pa/m"),
    ("material.set=16MnCr", "which is not a material set; did you mean '16MnCr5'?"),
    ("wear.edge_radius_mm=0.001", "wear.edge_radius_mm is 0.001 mm"),
    ("wear={rate_mm3_Nm=1e-6, crest_loss_mm=0.1}", "give one and not both"),
    ("wear={}", "give one and not both"),
    ("wear.rate_mm3_Nm=1.0", "wear.rate_mm3_Nm is 1 mm3/(N m), but it must lie"),
    ("wear.crest_loss_mm=-1", "wear.crest_loss_mm is -1 mm"),
    ("wear.crest_los_mm=1", "did you mean 'wear.crest_loss_mm'"),
    ("wear.crest_loss_mm=9", "wear.crest_loss_mm is 9 mm, but it must lie between 0 and 2 mm"),
    ("solver.scheme=rk4", "solver.scheme is 'rk4', which is not a scheme"),
    ("format=2", "format is 2, but this version reads format 1"),
    ("dog.count", "settings dog.count is not KEY=VALUE"),
    ("name.x=1", "name.x cannot be set: name is a value and not a table"),
    ("name=", "'name' is missing"),
    ("name=a b", "name is 'a b', but it must be letters, digits"),
    ("name='x" + "x" * 200 + "'", "(203 characters), but it must be not longer than 100"),
    ("search.trials=10001", "search.trials is 10001, but it must be at most 10000; lower it"),
    ("search.screen=", "no key search.screen to take out; check the key"),
    # operating points and what is uncertain
    ("operating.force_N=300,400", "write [300,400]"),
    ("operating.force_N=300,5 400", "write [300.5,400]"),
    ("operating.mismatch_rpm=-25 to 25", 'write [-25,25] for two values, {distribution="uniform",'
     "low=-25,high=25} for a range"),
    ("actuation.rise_s=0.1 to 0.2", "a list in square brackets; write [0.1,0.2]"),
    ("operating=3", "operating is 3, but it must be a table of keys"),
    ("operating.force_N=[100]", "the rise times of the study cover 235.2 to 641.5 N"),
    (f"{DRAWN}'norml', mean=1}}", "did you mean 'normal'?"),
    (f"{DRAWN}'normal', mean=1}}", "lacks 'sd'"),
    (f"{DRAWN}'uniform', low=1, high=2, sd=3}}", "sd is nothing that a uniform distribution has"),
    (f"{DRAWN}'normal', mean=9, sd=0}}", "mismatch_rpm.sd is 0, but it must be more than 0"),
    (f"{DRAWN}'normal', mean=0, sd=1, low=9}}", "next to nothing of the normal distribution lies"),
    (f"{FORCE}'uniform', low=500, high=300}}", "low is 500, but it must lie below high = 300"),
    (f"{FORCE}'triangular', low=300, mode=200, high=400}}", "lie between low = 300 and high = 400"),
    ("operating.seed=8", "operating.seed cannot stand beside lists of values; remove one"),
    ("operating.force_weight=[1, 1, 0, 1]", "force_weight.2 is 0, but it must be above 0.0"),
    ([f"{DRAWN}'normal', mean=9, sd=1}}", "operating.force_weight=[1]"], "beside a distribution"),
    ("operating={set='ampt'}", "operating.set is 'ampt', which is not a set of points; did"),
    ("operating={set='amt', force_N=[300]}", "operating.force_N cannot stand beside operating.set"),
    (f"operating={{points=[{POINT}}}], seed=1}}",
     '(settings={"operating.points": None}), or set operating.'),
    ("operating={force_N=[300]}", "'operating.mismatch_rpm' is missing"),
    (f"operating={{points=[{POINT}, wight=1}}]}}", "did you mean 'operating.points.0.weight'?"),
    (f"operating={{points=[{POINT}}}, {POINT}}}]}}", "has 5 1/min with 300 N 2 times"),
    (f"{FRICTION}'normal', mean=1, sd=0.1}}", "a factor must be positive and at most 10"),
    ("uncertain.force_factor={distribution='uniform', low=0.7, high=1.3}",
     "narrow uncertain.force_factor"),
    ([f"{FRICTION}'uniform', low=1, high=9.9}}", "contact.static_friction=0.3"],
     "contact.static_friction is 2.97"),
    ("variables.force_factor=[0.5, 2.0]", "shift force is 117.6 N, but the rise times"),
    ("variables.force_factor=[-1, 2.0]", "variables.force_factor is -1, but it must lie"),
    ("variables.mismatch_set_rpm=[3, 1]", "the first must be below the second"),
    ("variables.force_facter=[1, 2]", "did you mean 'variables.force_factor'"),
    # mechanism and effects
    ("effects.spline_fricton=0.1", "is not a known effect; did you mean 'spline_friction'"),
    ("effects.sleeve_friction=-3", "effects.sleeve_friction: mechanism.friction_N is -3 N, but"),
    ("effects.actuation_delay=-0.1", "mechanism.delay_s is -0.1 s, but"),
    ("mechanism.lag_s=1e-7", "force_lag_s is 1e-07 s, but it must lie between"),
    ("mechanism.force_loss_N=300", "it must leave 1 N or more of force_N = 235.2"),
    (SHAFT[:1], "mechanism.ring_inertia_kgm2 needs mechanism.input_stiffness_Nm_rad"),
    (SHAFT[1:], "belongs to mechanism.ring_inertia_kgm2"),
    ("mechanism.spline_backlash_deg=0.2", "belongs to mechanism.ring_inertia_kgm2"),
    (["mechanism.ring_inertia_kgm2=0.02", SHAFT[1]], "part of sliding.inertia_kgm2 = 0.01"),
    ("mechanism.detent_position_mm=1", "belongs to mechanism.detent_N, which is not given"),
    ({"mechanism.detent_N": 50.0, "mechanism.detent_position_mm": 2.0,
      "mechanism.detent_seat_mm": 2.0}, "must be above mechanism.detent_position_mm = 2; exchange"),
    ({"mechanism.friction_N": 30.0, "effects.sleeve_friction": 30.0},
     "mechanism.friction_N and effects.sleeve_friction both set mechanism.friction_N; leave out"),
    ({"contact.dynamic_friction": 0.11,
      "effects.contact_friction": {"static_friction": 0.2, "dynamic_friction": 0.1}},
     "contact.dynamic_friction and effects.contact_friction both set contact.dynamic_friction"),
    ("effects.contact_friction=0.1", "must be numbers, as {static_friction = 0.25, dynamic"),
    ("effects.drag_torque='low'", "effects.drag_torque is 'low', but it must be numbers, as {drag"),
    ("effects.reversed_mismatch=1", "effects.reversed_mismatch is 1, but it must be true or false"),
    ("effects.reversed_mismatch=true", "changes mismatch, which no study takes from an effect"),
    ("effects.axial_gap=0.1", "effects.axial_gap changes dog.axial_gap, which no study takes"),
]  # fmt: skip


@pytest.mark.parametrize(("overrides", "sentence"), MISTAKES)
def test_every_mistake_is_one_sentence(overrides: Any, sentence: str) -> None:
    with pytest.raises(DogshapeError) as refused:
        load_study("mq200_paper", [overrides] if isinstance(overrides, str) else overrides)
    text = str(refused.value)
    assert sentence in text
    assert "\n" not in text


def test_missing_and_broken_files(tmp_path: Path) -> None:
    broken = tmp_path / "study.toml"
    for text, words in (
        (b"format = 1\nname = \n", r"not valid TOML.*line 2"),
        (b"\xff\xfe\x00", "not valid TOML"),
        (b"format = 1\nname = 'x'\n", "'dog' is missing; add it"),
    ):
        broken.write_bytes(text)
        with pytest.raises(InputError, match=words):
            load_study(tmp_path)


def test_paper_study_is_the_prototype_at_the_published_points() -> None:
    study = load_study("mq200_paper")
    assert (study.clutch.dog.count, study.prototype["height_mm"]) == (15, 3.7)
    assert study.clutch.contact.name == "lubricated_steel"
    assert len(study.points) == 28
    assert {round(p.mismatch / RPM) for p in study.points} == {5, 10, 25, 50, 100, 149, 249}
    assert study.clutch.shift_travel == pytest.approx(4.65e-3)
    assert "wear" not in study.file.model_dump()


def test_a_ridge_and_backlash_are_keys_and_variables_of_the_dog() -> None:
    plain = load_study("mq200_paper")
    keys = {"dog.crest": 0.4, "dog.chamfer_back_deg": 12.0, "dog.backlash_deg": 0.5}
    ranges = {"variables.crest": [0.3, 0.7], "variables.backlash_mm": [0.0, 0.5]}
    study = load_study("mq200_paper", {**keys, **ranges})
    dog = study.clutch.dog
    assert dog.backlash == pytest.approx(0.5 * DEG * dog.mean_radius)
    assert study.prototype["crest"] == 0.4
    assert study.dog_with({"crest": 0.6}).crest == 0.6
    assert load_study("mq200_paper", ranges).prototype["backlash_mm"] == 0.0
    assert study.physics_hash != plain.physics_hash
    same = {"dog.crest": 1.0, "dog.chamfer_back_deg": 0.0, "dog.backlash_mm": 0.0}
    assert load_study("mq200_paper", same).physics_hash == plain.physics_hash


def test_dimensions_of_the_output_dog_are_variables() -> None:
    """Own values are those of [output_dog], else of the sliding dog; no hash has the searched."""
    plain = load_study("mq200_paper")
    assert "output_dog" not in plain.file.model_dump()["variables"]
    searched = {"height_mm": [2.0, 4.5], "crest": [0.3, 1.0]}
    ranges = {f"variables.output_dog.{key}": ends for key, ends in searched.items()}
    study = load_study("mq200_paper", ranges)
    assert study.shape_keys[-2:] == ("output_dog_height_mm", "output_dog_crest")
    assert study.variables["output_dog_height_mm"] == (2.0, 4.5)
    assert study.prototype["output_dog_height_mm"] == 3.7
    assert study.prototype["output_dog_crest"] == 1.0
    assert study.physics_hash == plain.physics_hash
    assert study.config_hash != plain.config_hash
    unlike = load_study("mq200_paper", {**ranges, "output_dog.height_mm": 3.2})
    assert unlike.prototype["output_dog_height_mm"] == 3.2
    assert unlike.physics_hash == study.physics_hash
    params = {"height_mm": 3.0, "output_dog_height_mm": 2.5}
    pair = study.clutch_with(params).pair
    heights = (pair.sliding.height, pair.output.height)
    assert heights == pytest.approx((3.0 * MM, 2.5 * MM))
    operated = study.with_design(params)
    assert operated.limits.output_dog == operated.clutch.output_dog
    assert study.with_design({"height_mm": 3.0}) is study
    with pytest.raises(GeometryError, match=r"must exceed half of dog\.height_mm, 3 mm"):
        study.dog_with({"height_mm": 6.0, "output_dog_height_mm": 2.5})


def test_a_name_of_a_design_is_one_quantity() -> None:
    """The objective is the mean of both rings, the variable the backlash of one of them."""
    study = load_study("mq200_both")
    assert "backlash_mm" in study.file.search.objectives
    require_variables(study)
    for settings in (
        {"output_dog.backlash_mm": 0.3},
        {"variables.output_dog.backlash_mm": [0.0, 0.5]},
    ):
        with pytest.raises(InputError, match="backlash_mm, the mean of both rings, but variables"):
            require_variables(load_study("mq200_both", settings))
        alone = load_study("mq200_both", {**settings, "variables.backlash_mm": None})
        require_variables(alone)


def test_overrides_replace_keys_and_change_the_right_hashes() -> None:
    plain = load_study("mq200_paper")
    other_dog = load_study("mq200_paper", ["dog.chamfer_deg=14", "dog.count=18"])
    assert other_dog.prototype["chamfer_deg"] == 14
    assert other_dog.physics_hash == plain.physics_hash
    assert other_dog.config_hash != plain.config_hash
    other_contact = load_study("mq200_paper", ["contact.set=adams2019"])
    assert other_contact.physics_hash != plain.physics_hash


def test_an_override_without_a_value_takes_a_key_out() -> None:
    """As if the file did not have it: a key with a default then has that."""
    keys = "load.landing_share", "search.confirm_angles"
    plain = load_study("mq200_paper", [f"{key}=" for key in keys])
    assert plain.file.load.landing_share is None
    assert plain.file.search.confirm_angles == SearchSection.model_fields["confirm_angles"].default
    assert load_study("mq200_paper", dict.fromkeys(keys)).file == plain.file


def test_one_angle_confirms_a_study_of_the_compiled_engine() -> None:
    """Where Drake makes the means themselves, an error needs three."""
    one = "search.confirm_angles=1"
    assert new_angles(load_study("mq200_both", [one]).search_setup) == 2 * 24
    with pytest.raises(InputError, match=r"confirm_angles is 1, but .* at least 3.*engine out"):
        load_study("mq200_both", [one, "solver.engine=drake"])


def test_a_word_finds_the_keys_that_begin_with_it() -> None:
    assert keys_like("chamfer")[0] == "dog.chamfer_deg"
    assert keys_like("spline")[:2] == ["mechanism.spline_friction", "mechanism.spline_radius_mm"]
    assert keys_like("x") == keys_like("c") == []


#: One of these breaks any rule that a key may have.
BAD: tuple[Any, ...] = (
    None, True, "", "x", "3,7", "a b", "n" * 300, 1.5, -1, 0, 1e9,
    10**30, [], [1], [1, 2, 3] * 2000, ["x"], [-1.5, "y"], {}, {"x": 1},
)  # fmt: skip
#: Words of the validator, none of which is to reach a user.
THEIRS = ("input should", "valid dictionary", "instance of", "unable to parse", "after validation",
          "should match pattern", "extra inputs", "field required")  # fmt: skip


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        yield annotation
    for one in get_args(annotation):
        yield from _sections(one)


def _models(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    yield model
    for field in model.model_fields.values():
        for section in _sections(field.annotation):
            yield from _models(section)


def _faults(model: type[BaseModel]) -> Iterator[tuple[str, Any, Any]]:
    """Every key of a table with every bad value, and what the validator says."""
    for name in model.model_fields:
        for value in BAD:
            try:
                empty = model.model_construct()
                model.__pydantic_validator__.validate_assignment(empty, name, value)
            except ValidationError as error:
                yield from ((name, value, one) for one in error.errors())


@pytest.mark.parametrize("file", [StudyFile, _BenchFile])
def test_every_rule_of_the_files_has_a_sentence(file: type[BaseModel]) -> None:
    kinds = set()
    for model in set(_models(file)):
        for name, _, fault in _faults(model):
            if fault["type"] in {"missing", "extra_forbidden", "frozen_instance"}:
                continue  # these are sentences of their own
            kinds.add(fault["type"])
            sentence = BrokenRule.of(fault).sentence(name)
            assert "of another kind" not in sentence, fault
            assert "{" not in sentence.replace(repr(fault["input"]), ""), sentence
            assert not any(words in sentence.lower() for words in THEIRS), sentence
            assert len(sentence) < 300
    assert kinds <= set(RULES)
    assert {"float_type", "int_type", "string_type", "list_type"} <= kinds


def test_one_value_is_a_list_of_it_and_an_own_key_replaces_its_other_unit() -> None:
    own = "dog.backlash_deg=20", "load.pitch_sd_um=5", "actuation.force_N=250"
    point = "actuation.rise_s=0.04", "operating.points={mismatch_rpm=200, force_N=250}"
    study = load_study("motorcycle", [*own, *point, "search.objectives=expected_shift_time_s"])
    assert study.clutch.dog.backlash == pytest.approx(20.0 * DEG * study.clutch.dog.mean_radius)
    assert (study.limits.load.accuracy, study.limits.load.pitch_sd) == (None, pytest.approx(5e-6))
    assert (study.forces, len(study.points)) == ([250.0], 1)
    assert study.file.search.objectives == ["expected_shift_time_s"]


@pytest.mark.parametrize(
    ("overrides", "head", "faults"),
    [
        (["load.torque_Nm=-3", "shift.timeout_s=0", "dog.traction_deg=80"],
         "mq200_paper: 3 mistakes",
         ["shift.timeout_s is 0", "load.torque_Nm is ", "dog.traction_deg is 80"]),
        (["load.torque_Nm=x", "dog.backlash_deg=x", "dog.cont=3"],
         "with settings: 2 mistakes", ["dog.backlash_deg is 'x', but", "load.torque_Nm is "]),
        (["dog.height_mm=x", "dog.cuont=3", "search.trials=0", "name=a b"],
         "with settings: 4 mistakes",
         ["'dog.cuont' ", "name ", "dog.height_mm ", "search.trials "]),
    ],
)  # fmt: skip
def test_all_mistakes_of_a_study_are_told_at_once(
    overrides: list[str], head: str, faults: list[str]
) -> None:
    with pytest.raises(InputError) as refused:
        load_study("mq200_paper", overrides)
    first, *lines = str(refused.value).split("\n- ")
    assert first.endswith(head)
    assert all(one.startswith(words) for one, words in zip(lines, faults, strict=True)), lines


def test_a_drive_is_read_with_its_units_and_its_faults() -> None:
    """Numbers and lists of torques, the control, and the key that it has replaced."""
    settings = [
        "drive.shaft_speed_rpm=1500", "drive.engine_side=output", "drive.sliding_torque_Nm=[0, 4]",
        "drive.output_torque_Nm=-30", "drive.torque_time_s=[0, 0.1]", "drive.pack_torque_Nm=2",
        "drive.pack_speed_rpm=900", "drive.synchroniser_torque_Nm=1.5",
        "drive.control={set_point_rpm = 20, integral_Nm_rad = 8.0, cycle_s = 0.005}",
    ]  # fmt: skip
    study = load_study("mq200_paper", settings)
    control = SpeedControl(20 * RPM, integral=8.0, cycle=0.005)
    assert study.clutch.drive == Drive(
        1500 * RPM, "output", (0.0, 4.0), (-30.0,), (0.0, 0.1), pack_torque=2.0,
        pack_speed=900 * RPM, synchroniser=1.5, control=control,
    )  # fmt: skip
    written = tomllib.loads(toml_text({"drive": study.clutch.drive.table}, {}))
    again = DriveSection.model_validate(written["drive"]).value
    assert record_quantities(again) == pytest.approx(record_quantities(study.clutch.drive))
    assert record_quantities(again.control) == pytest.approx(record_quantities(control))
    assert (again.engine_side, again.sliding_torque, again.output_torque, again.times) == (
        "output", (0.0, 4.0), (-30.0,), (0.0, 0.1),
    )  # fmt: skip
    plain = load_study("mq200_paper")
    assert plain.clutch.drive == NO_DRIVE
    assert plain.physics_hash == load_study("mq200_paper", ["drive.shaft_speed_rpm=0"]).physics_hash
    assert plain.config_hash == load_study("mq200_paper", ["drive.shaft_speed_rpm=0"]).config_hash
    for fault, words in (
        ("sliding.initial_speed_rpm=-2000", "drive.shaft_speed_rpm, of the ring on the wheels"),
        ("drive.shaft_speed_rpm=3e4", "drive.shaft_speed_rpm is 30000 1/min"),
        ("drive.engine_side=wheel", "drive.engine_side is 'wheel'"),
        ("drive.shaft_rpm=2000", "'drive.shaft_rpm' is not a known key"),
        ("drive.sliding_torque_Nm=[1, 2]", "give lists of equal length, or one torque"),
        ("drive.control={set_point_rpm = 20}", "needs a gain"),
        ("drive.control={integral_Nm_rad = 1, cycle_s = 0}", "drive.control.cycle_s is 0 s"),
    ):
        with pytest.raises(InputError) as refused:
            load_study("mq200_paper", [fault])
        assert words in str(refused.value)
