"""Effects as values: neutral, composed, found by file, stored by key."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim.effect import BenchTest, Effect, InstrumentError, Parameter
from dogshape.sim.effects import load
from dogshape.sim.errors import EffectError, GeometryError, InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mechanism import FIELDS, Mechanism
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import clutch_record
from tests.conftest import CommandResult

EFFECTS = load()
#: Of the paper's study at its first operating point, without any mechanism.
PHYSICS, FIRST = "d9069ea6093eea848d23", "3d538982a61536408d1f"


def _values(effect: Effect) -> dict[str, float]:
    return {p.name: p.at(0.4 if p.name == "dynamic_friction" else 0.6) for p in effect.parameters}


def test_effects_are_those_of_the_contract_and_work(setting: Setting) -> None:
    for effect in EFFECTS.values():
        assert len(effect.parameters) <= 2
        effect.require_working(setting)
    reversed_ = EFFECTS["reversed_mismatch"]
    assert reversed_.apply(setting, {}) == setting.with_point(mismatch=-setting.point.mismatch)
    still = setting.with_point(mismatch=0.0)
    assert reversed_.apply(still, {}).block((0.1,)).keys == still.block((0.1,)).keys


def test_each_size_has_an_ordinary_range_that_holds_its_neutral_value(setting: Setting) -> None:
    """A place or a phase has none."""
    for effect in EFFECTS.values():
        for parameter in effect.parameters:
            ordinary = parameter.ordinary
            if parameter.name in ("position_mm", "centre_pitch"):
                assert ordinary is None
                continue
            assert ordinary is not None
            assert ordinary.source
            assert ordinary.low < parameter.neutral_of(setting) < ordinary.high


@pytest.mark.parametrize("effect", [e for e in EFFECTS.values() if e.parameters])
def test_neutral_values_change_nothing(effect: Effect, setting: Setting) -> None:
    same = effect.apply(setting, effect.neutral(setting))
    assert same == setting
    assert same.block((0.1,)).keys == setting.block((0.1,)).keys
    assert effect.apply(setting, _values(effect)) != setting


@pytest.mark.parametrize(("one", "two"), list(combinations(sorted(EFFECTS), 2)))
def test_effects_compose_in_either_order(setting: Setting, one: str, two: str) -> None:
    first, second = EFFECTS[one], EFFECTS[two]
    there = second.apply(first.apply(setting, _values(first)), _values(second))
    assert there == first.apply(second.apply(setting, _values(second)), _values(first))
    assert there not in (setting, first.apply(setting, _values(first)))


def test_each_effect_has_a_meaning_and_each_range_a_source() -> None:
    for effect in EFFECTS.values():
        assert effect.title
        assert effect.meaning
        assert all(parameter.source for parameter in effect.parameters)


def test_priors_run_from_end_to_end() -> None:
    for effect in EFFECTS.values():
        for parameter in effect.parameters:
            assert parameter.at(0.0) == pytest.approx(parameter.low)
            assert parameter.at(1.0) == pytest.approx(parameter.high)
            assert parameter.share(parameter.at(0.3)) == pytest.approx(0.3)
    middle = Parameter("x_N", 0.0, 1.0, 100.0, "log-uniform", "made up").at(0.5)
    assert middle == pytest.approx(10.0)
    with pytest.raises(InputError, match=r"the range of x_N is 0 to 1, but its prior"):
        Parameter("x_N", 0.0, 0.0, 1.0, "log-uniform", "made up")


def test_keys_of_shifts_without_mechanism_stay(setting: Setting) -> None:
    study = load_study("mq200_paper")
    assert study.physics_hash == PHYSICS
    assert Block(study.clutch, study.points[0], (0.1,)).keys == [FIRST]
    assert not [k for k in clutch_record(setting.clutch) if k.startswith("mechanism_")]


def test_every_part_of_a_mechanism_is_in_the_key(clutch: Clutch) -> None:
    point = OperatingPoint(5.0, ForceProfile(300.0, 0.2))
    keys = {Block(clutch, point, (0.1,)).keys[0]}
    needs = {"ring_inertia": {"input_stiffness": 1.0}, "wheel_inertia": {"output_stiffness": 1.0}}
    for name, value in vars(Mechanism()).items():
        own = {name: value + 1e-6, **needs.get(name, {})}
        other = replace(clutch, mechanism=Mechanism(**own))
        keys.add(Block(other, point, (0.1,)).keys[0])
    lagged = replace(point, profile=ForceProfile(300.0, 0.2, lag=0.01))
    keys.add(Block(clutch, lagged, (0.1,)).keys[0])
    assert len(keys) == 2 + len(FIELDS)


def test_mistakes_are_sentences(setting: Setting) -> None:
    friction = EFFECTS["sleeve_friction"]
    for values, words in (
        ({"friction": 1.0}, "'friction' is not a parameter of sleeve_friction; did you mean"),
        ({}, "sleeve_friction needs a value of 'friction_N'"),
        ({"friction_N": -1.0}, "mechanism.friction_N is -1 N, but it must lie between 0 and"),
    ):
        with pytest.raises(InputError, match=words):
            friction.apply(setting, values)
    steep = {"chamfer_offset_deg": 40.0}
    with pytest.raises(GeometryError):
        EFFECTS["chamfer_angle"].apply(setting, steep)
    assert not EFFECTS["chamfer_angle"].possible(setting, steep)
    crossed = {"static_friction": 0.1, "dynamic_friction": 0.2}
    assert not EFFECTS["contact_friction"].possible(setting, crossed)
    assert friction.possible(setting, {"friction_N": 20.0})


def test_each_parameter_has_the_error_of_an_instrument() -> None:
    for effect in EFFECTS.values():
        names = [error.parameter for error in effect.test.errors]
        assert names == [parameter.name for parameter in effect.parameters]
        assert all(error.source for error in effect.test.errors)
    friction = EFFECTS["sleeve_friction"]
    scale = friction.instrument_error(friction.parameters[0])
    assert scale.at(50.0) == pytest.approx(math.hypot(0.02 * 50.0, 0.5))


def test_an_error_that_a_test_does_not_state_and_wrong_ones() -> None:
    friction = EFFECTS["sleeve_friction"]
    unstated = replace(friction, test=BenchTest("look", "Look."))
    (parameter,) = friction.parameters
    error = unstated.instrument_error(parameter)
    width = parameter.high - parameter.low
    assert error.at(100.0) == pytest.approx(math.hypot(0.05 * 100.0, 0.02 * width))
    for absolute in (0.0, -1.0, math.inf):
        with pytest.raises(InputError, match="instrument error of friction_N"):
            InstrumentError("friction_N", 0.02, absolute, "a guess")
    wrong = InstrumentError("friction_kN", 0.02, 0.5, "a guess")
    with pytest.raises(InputError, match=r"friction_kN.*friction_N"):
        replace(friction, test=BenchTest("look", "Look.", (wrong,)))


OWN = """
from dogshape.sim.effect import BenchTest, Effect, Parameter

def _change(setting, values):
    return setting.with_mechanism(damping=values["damping_Ns_m"])

EFFECT = Effect(
    name="{name}",
    meaning="thick oil",
    parameters=(Parameter("damping_Ns_m", 0.0, 1.0, 9.0, "uniform", "a guess"),),
    change=_change,
    test=BenchTest("flight", "Let it fly."),
)
"""


def test_a_users_file_is_an_effect(tmp_path: Path, setting: Setting) -> None:
    (tmp_path / "thick_oil.py").write_text(OWN.format(name="thick_oil"))
    (tmp_path / "_notes.py").write_text("not python at all")
    found = load(tmp_path)
    assert set(found) == {*EFFECTS, "thick_oil"}
    changed = found["thick_oil"].apply(setting, {"damping_Ns_m": 3.0})
    assert changed.clutch.mechanism.damping == 3.0


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("mine.py", "EFFECT = 3", "mine.py defines no EFFECT; define one"),
        ("mine.py", OWN.format(name="yours"), "defines the effect 'yours', but an effect has"),
        ("free_play.py", OWN.format(name="free_play"), "'free_play', but there is one of that"),
        ("mine.py", "def (", r"cannot be run \(SyntaxError"),
        (
            "mine.py",
            OWN.format(name="mine").replace('"uniform"', '"unifrom"'),
            "scale of damping_Ns_m is 'unifrom', .*did you mean 'uniform'",
        ),
    ],
)
def test_mistakes_in_a_users_file(tmp_path: Path, file: str, text: str, words: str) -> None:
    (tmp_path / file).write_text(text)
    with pytest.raises(InputError, match=words):
        load(tmp_path)
    with pytest.raises(InputError, match="there is no folder"):
        load(tmp_path / "nowhere")


WRONG = {
    'return setting.with_mechanism(drag_Nm=values["damping_Ns_m"])': (
        "with_mechanism has no field 'drag_Nm'; valid are added_mass, .*drag_torque.*, in SI units"
    ),
    "return setting.with_dog(hight=0.003)": "with_dog has no field 'hight'; did you mean 'height'",
    "return 1.0 / 0.0": r"cannot be run at damping_Ns_m = .* \(ZeroDivisionError: ",
    "setting.with_mechanism(damping=1.0)": "returns None, but it must return a Setting",
    "return setting.with_mechanism(damping=-1.0)": "no value of the effect .* gives a bench: mech",
}


@pytest.mark.parametrize("change", WRONG)
def test_a_users_program_that_is_wrong_is_a_sentence(
    tmp_path: Path, setting: Setting, change: str
) -> None:
    right = 'return setting.with_mechanism(damping=values["damping_Ns_m"])'
    (tmp_path / "thick_oil.py").write_text(OWN.format(name="thick_oil").replace(right, change))
    effect = load(tmp_path)["thick_oil"]
    with pytest.raises(EffectError, match=WRONG[change]) as refused:
        effect.require_working(setting)
    assert "\n" not in str(refused.value)
    if "no value" not in WRONG[change]:
        with pytest.raises(EffectError):
            effect.possible(setting, {"damping_Ns_m": 3.0})


def test_a_bank_is_stored_and_goes_on(tmp_path: Path, setting: Setting) -> None:
    """Settings that differ in reading alone share their shifts; others of a journal stay apart."""
    late = EFFECTS["actuation_delay"].apply(setting, {"delay_s": 0.1})
    rubbing = EFFECTS["sleeve_friction"].apply(setting, {"friction_N": 20.0})
    angles = (0.2094395102393195,)
    journal, done = ShiftJournal(tmp_path / "shifts.jsonl"), list[int]()
    runner = Executor(journal, jobs=1, progress=lambda some, _: done.append(some))
    rows = runner.run([one.block(angles) for one in (setting, late, rubbing)])
    assert len(runner.journal.rows) == 2
    assert late.time_of(rows[1][0]) == pytest.approx(rows[0][0]["shift_time_s"] + 0.1)
    assert rows[2][0]["mechanism_friction_N"] == 20.0
    again = Executor(ShiftJournal(tmp_path / "shifts.jsonl"), jobs=1)
    assert again.run([rubbing.block(angles)]) == rows[2:]


def test_neutral_values_that_change_a_shift_are_refused(
    tmp_path: Path, dogshape: Callable[..., CommandResult]
) -> None:
    text = OWN.format(name="thick_oil").replace('"damping_Ns_m", 0.0', '"damping_Ns_m", 400.0')
    (tmp_path / "thick_oil.py").write_text(text)
    said = dogshape("diagnose", "mq200_stand", "--effects", tmp_path)
    assert said.status == 2
    assert "with its neutral values (damping_Ns_m = 400) the effect thick_oil" in said.sentence
