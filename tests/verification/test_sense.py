"""The reversed sense of rotation: its own bank, its prior, and the answer given either sense."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, setting_of
from dogshape.diagnosis.bench.reading import gather
from dogshape.diagnosis.bench.sense import (
    REVERSED,
    SHARES,
    Sense,
    both_senses,
    forward,
    predictable,
    turned,
)
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.verdict import decide
from dogshape.diagnosis.prediction.bank import Plan, blocks_of, collect
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.hypotheses import (
    NONE,
    UNKNOWN,
    pairs_of,
    priors_of,
    spaces_of,
    with_third,
)
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.prediction.sense_bank import (
    SenseEmulator,
    forward_plan,
    reversed_bench,
    reversed_plan,
)
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import BenchTest, Effect, Values
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import RPM
from tests.made_up import few_cells, made_up, mean_time
from tests.toy import Toy, bench_of, points_of

EFFECTS = load()
NAMES = ("actuation_delay", "moving_mass", "relative_angle", REVERSED, "sleeve_friction")
SOME = {name: EFFECTS[name] for name in NAMES}
CELLS = [(5, 235.2), (50, 469.0), (249, 641.5)]
BACK = 1.4  #: times a shift takes as long with the braking flanks


def _signed(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks of closed form, in which a negative mismatch throws dogs back."""
    found = []
    for block, rows in zip(blocks, made_up(blocks), strict=True):
        factor = BACK if block.point.mismatch < 0.0 else 1.0
        found.append([{**row, "shift_time_s": factor * row["shift_time_s"]} for row in rows])
    return found


def _bench(sense: Sense) -> Bench:
    return _with_sense(few_cells(load_bench("mq200_adams"), CELLS), sense)


def _with_sense(bench: Bench, sense: Sense) -> Bench:
    return replace(bench, record=replace(bench.record, sense=sense))


def _emulator(sense: Sense) -> SenseEmulator:
    bench, other = _bench(sense), reversed_bench(_bench(sense))
    plain = collect(forward_plan(SOME), bench, _signed)
    turned_over = collect(reversed_plan(SOME, bench), other, _signed, numerics=plain.numerics)
    return SenseEmulator(BankEmulator(plain), turned_over)


@pytest.fixture(scope="module")
def emulator() -> SenseEmulator:
    return _emulator("unknown")


def test_the_reversed_bank_is_that_of_the_negated_points() -> None:
    bench = _bench("unknown")
    other = reversed_bench(bench)
    plan = reversed_plan(SOME, bench)
    assert [c.point.mismatch for c in other.cells] == [-c.point.mismatch for c in bench.cells]
    assert {block.point.mismatch < 0.0 for block in blocks_of(plan, other)} == {True}
    assert REVERSED not in plan.named
    assert REVERSED not in forward_plan(SOME).named
    assert set(plan.named) == set(forward_plan(SOME).named)
    # Fewer levels and angles: a third of the shifts of the other bank.
    whole = reversed_plan(EFFECTS, bench).shifts(other) / forward_plan(EFFECTS).shifts(bench)
    assert 0.2 < whole < 0.4


def test_a_known_sense_costs_a_baseline_alone() -> None:
    bench = _bench("known")
    plan = reversed_plan(SOME, bench)
    assert plan.levels_for(reversed_bench(bench)) == ()
    assert set(plan.named) == {"actuation_delay", "relative_angle"}
    assert plan.shifts(reversed_bench(bench)) == len(CELLS) * 48


def test_each_hypothesis_asks_the_bank_of_its_sense(emulator: SenseEmulator) -> None:
    for cell, (mine, other) in enumerate(
        zip(emulator.plain.bank.settings, emulator.reversed.bank.settings, strict=True)
    ):
        assert other.point.mismatch == -mine.point.mismatch
        none = emulator.at(NONE, np.zeros((1, 0)), cell)
        back = emulator.at((REVERSED,), np.zeros((1, 0)), cell)
        true = BACK * mean_time(other.clutch, other.point)
        assert abs(back.times.mean() - true) < 3.0 * back.error[0]
        assert back.times.mean() == pytest.approx(emulator.reversed.bank.baseline[cell].mean())
        assert none.times.mean() == pytest.approx(emulator.plain.bank.baseline[cell].mean())
        late = emulator.at(turned(("actuation_delay",)), np.array([[0.07]]), cell)
        np.testing.assert_allclose(late.times, back.times + 0.07)
        # Of a sense alone: nothing that both signs make is combined.
        heavy = emulator.at(("moving_mass", REVERSED), np.array([[5.0]]), cell)
        alone = emulator.reversed.at(("moving_mass",), np.array([[5.0]]), cell)
        np.testing.assert_array_equal(heavy.times, alone.times)


def test_a_known_sense_knows_no_other_effect_reversed() -> None:
    found = _emulator("known")
    assert found.at((REVERSED,), np.zeros((2, 0)), 0).times.shape[0] == 2
    with pytest.raises(InputError, match="does not have the effect 'moving_mass'"):
        found.at(("moving_mass", REVERSED), np.array([[1.0]]), 0)
    assert not predictable(("moving_mass", REVERSED), "known")
    assert predictable(("actuation_delay", REVERSED), "known")


def test_hypotheses_of_both_senses_and_their_priors() -> None:
    setting = setting_of(_bench("known"))
    known = [space.hypothesis for space in spaces_of(SOME, setting)]
    assert [h for h in known if REVERSED in h] == [(REVERSED,), ("actuation_delay", REVERSED)]
    open_to = [space.hypothesis for space in spaces_of(SOME, setting, sense="unknown")]
    plain = [h for h in open_to if REVERSED not in h]
    assert [turned(h) for h in plain] == open_to[len(plain) :]
    assert not any(REVERSED in h for h in pairs_of(list(SOME)))
    assert with_third(("actuation_delay", REVERSED, "moving_mass"), SOME) == (
        ("actuation_delay", "moving_mass", "relative_angle", REVERSED),
        ("actuation_delay", "moving_mass", REVERSED, "sleeve_friction"),
    )
    bare = priors_of([*plain, UNKNOWN])
    for hypotheses, sense in ((known, "known"), (open_to, "unknown")):
        priors = priors_of([*hypotheses, UNKNOWN], sense)  # type: ignore[arg-type]
        assert sum(priors.values()) == pytest.approx(1.0)
        for h in hypotheses:
            if REVERSED in h:
                odds = SHARES[sense] / (1.0 - SHARES[sense])  # type: ignore[index]
                assert priors[h] == pytest.approx(odds * priors[forward(h)])
    # Which sense it was changes no prior of the effects, nor that of the unknown.
    whole = priors_of([*open_to, UNKNOWN], "unknown")
    assert whole[UNKNOWN] == pytest.approx(bare[UNKNOWN])
    for h in plain:
        assert whole[h] + whole[turned(h)] == pytest.approx(bare[h])
    assert both_senses([NONE], {"moving_mass": 1}, "unknown") == [NONE]
    # A three of one sense alone, which was tried since no pair of that sense fits.
    three = turned(("actuation_delay", "moving_mass", "sleeve_friction"))
    more = priors_of([*open_to, UNKNOWN, three], "unknown")
    assert 0.0 < more[three] < 0.05
    assert sum(more.values()) == pytest.approx(1.0)


class _TwoSenses(Toy):
    """A toy whose shifts take less time with the reversed sense, most of all slow ones."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Return what a hypothesis says of an operating point."""
        spread = super().at(forward(hypothesis), values, cell)
        factor = self.factors()[cell] if REVERSED in hypothesis else 1.0
        return replace(spread, times=spread.times * factor)

    def factors(self) -> Array:
        """Return the share of the time that is left of each point with the reversed sense."""
        slip = np.array([abs(point.mismatch) / RPM for point in self.points])
        found: Array = 1.0 - 0.6 / (1.0 + slip / 20.0)
        return found


def _found(values: Mapping[str, float], sense: Sense, *, other: bool) -> Diagnosis:
    points = points_of((235.2, 641.5))
    toy = _TwoSenses(points)
    bench = bench_of(values, np.random.default_rng(3), points=points)
    if other:
        times = [
            replace(cell.readings[0], time=(cell.time or 0.0) * factor)
            for cell, factor in zip(bench.cells, toy.factors(), strict=True)
        ]
        bench = replace(bench, cells=gather(times))
    names = ("actuation_delay", "moving_mass", REVERSED, "sleeve_friction")
    effects = {name: EFFECTS[name] for name in names}
    return diagnose(_with_sense(bench, sense), toy, effects)


@pytest.mark.parametrize("sense", ["known", "unknown"])
def test_a_reversed_sense_is_named_and_has_no_sizes(sense: Sense) -> None:
    found = _found({}, sense, other=True).as_dict()
    assert (found["verdict"], found["causes"]) == ("effect", [REVERSED])
    assert found["hypotheses"][0]["parameters"] == {}
    assert REVERSED not in found["bounds"]
    assert "reversed sense of rotation" in found["headline"]


@pytest.mark.parametrize("sense", ["known", "unknown"])
def test_a_right_sense_is_not_accused(sense: Sense) -> None:
    found = _found({"delay_s": 0.08}, sense, other=False).as_dict()
    assert (found["verdict"], found["causes"]) == ("effect", ["actuation_delay"])
    assert found["inclusion"].get(REVERSED, 0.0) < 0.01


def test_an_unknown_sense_is_told_with_sizes_for_either() -> None:
    found = _found({"added_mass_kg": 3.0}, "unknown", other=True)
    record = found.as_dict()
    assert REVERSED in record["causes"]
    assert set(record["hypotheses"][0]["effects"]) == {"moving_mass", REVERSED}
    assert record["inclusion"]["moving_mass"] > 0.9
    plain, other = record["senses"]
    assert (plain["reversed"], other["reversed"]) == (False, True)
    assert plain["probability"] + other["probability"] == pytest.approx(1.0)
    assert other["probability"] > 0.95
    for one in (plain, other):
        assert sum(h["probability"] for h in one["hypotheses"]) <= 1.0 + 1e-9
        assert not any(REVERSED in h["effects"] for h in one["hypotheses"])
    first = other["hypotheses"][0]
    assert first["effects"] == ["moving_mass"]
    assert first["parameters"]["added_mass_kg"]["mean"] == pytest.approx(3.0, rel=0.3)
    assert "Which way the rings turned past each other was not noted" in record["summary"]
    assert _found({"added_mass_kg": 3.0}, "known", other=False).as_dict()["senses"] == []


def test_the_sense_is_a_setting_beside_two_effects() -> None:
    alone = Confusion((), np.zeros((0, 0)), ())
    pair: Hypothesis = ("actuation_delay", "moving_mass", REVERSED)
    sure = decide({pair: 0.9, ("moving_mass", REVERSED): 0.1, UNKNOWN: 0.0}, alone, {pair: 0.5})
    assert sure.kind == "ambiguous"  # for the delay, which has 0.9
    sure = decide({pair: 0.96, ("moving_mass", REVERSED): 0.04}, alone, {pair: 0.5})
    assert (sure.kind, sure.causes) == ("effect", pair)
    # Sizes of effects are those of a sense, so that one must be as sure as they are.
    late: Hypothesis = ("actuation_delay",)
    half = decide({late: 0.85, turned(late): 0.15}, alone, {late: 0.5})
    assert (half.kind, half.causes) == ("ambiguous", late)
    near = decide({late: 0.96, turned(late): 0.04}, alone, {late: 0.5})
    assert (near.kind, near.causes) == ("effect", late)


def test_a_look_at_the_rig_is_the_first_test_where_it_decides() -> None:
    """Two shifts a point do not tell a delay from a reversed sense with another one."""
    points = points_of((641.5,))[4:]
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(3), shifts=2, points=points)
    effects = {name: EFFECTS[name] for name in ("actuation_delay", REVERSED)}
    found = diagnose(_with_sense(bench, "unknown"), _TwoSenses(points), effects)
    assert 0.05 < found.posterior[turned(("actuation_delay",))] < 0.95
    test = found.as_dict()["next_test"]
    assert test["name"] == "sense of rotation at the rig"
    assert test["parameters"] == [REVERSED]
    means = {tuple(one["effects"]): one["mean"] for one in test["foretold"]}
    assert means[("actuation_delay",)] == [0.0]
    assert means[turned(("actuation_delay",))] == [1.0]


def test_a_look_at_the_rig_confirms_what_rests_on_a_sense_that_nobody_noted() -> None:
    points = points_of()
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(3), points=points)
    effects = {name: EFFECTS[name] for name in ("actuation_delay", REVERSED)}
    names: dict[Sense, str] = {"unknown": "sense of rotation at the rig", "known": "force at the"}
    for sense, name in names.items():
        found = diagnose(_with_sense(bench, sense), _TwoSenses(points), effects)
        assert found.verdict.causes == ("actuation_delay",)
        assert found.tests[0].name.startswith(name)


def _heavier(setting: Setting, values: Values) -> Setting:
    return setting.with_mechanism(added_mass=2.0)


HEAVIER = Effect(
    "heavier", "a mass of 2 kg is there or not", (), _heavier, BenchTest("look", "Look at it.")
)


def test_an_effect_without_parameters_has_one_level_and_combines() -> None:
    """One of the user's own is there or not: its only level is simulated, and pairs with it."""
    bench = few_cells(load_bench("mq200_adams"), CELLS)
    effects = {
        "heavier": HEAVIER,
        **{n: EFFECTS[n] for n in ("actuation_delay", "sleeve_friction")},
    }
    bank = collect(Plan(tuple(effects.values())), bench, made_up)
    assert [bank.levels[k].values for k in bank.of(("heavier",))] == [()]
    assert len(bank.of(("heavier", "sleeve_friction"))) == 2
    emulator = BankEmulator(bank)
    for cell, setting in enumerate(bank.settings):
        with_it = _heavier(setting, {})
        true = mean_time(with_it.clutch, with_it.point)
        spread = emulator.at(("heavier",), np.zeros((3, 0)), cell)
        assert spread.times.shape[0] == 3
        assert abs(spread.times.mean() - true) < 3.0 * spread.error[0]
        assert spread.error[0] < 0.1 * true
        late = emulator.at(("actuation_delay", "heavier"), np.array([[0.05]]), cell)
        assert late.times.mean() == pytest.approx(spread.times.mean() + 0.05)
        rubbed = with_it.with_mechanism(friction=50.0)
        true = mean_time(rubbed.clutch, rubbed.point)
        both = emulator.at(("heavier", "sleeve_friction"), np.array([[50.0]]), cell)
        assert abs(both.times.mean() - true) < 3.0 * float(both.error[0] + abs(both.common[0]))
