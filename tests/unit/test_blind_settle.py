"""Whether the advised test settles what is ambiguous: outcomes from the truth, then Bayes."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench, setting_of
from dogshape.diagnosis.bench.flight_marks import SIZE, WAYS
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.diagnosis.inference.next_test import EXACT
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.sim.units import RPM
from dogshape.validation.blind.advised_test import (
    ERROR,
    Advised,
    Stage,
    judged_by_test,
    more_shifts,
    more_traces,
    outcome_of,
    settled_figures,
    shares_of,
    updated,
)
from dogshape.validation.blind.field_set import FieldWanted
from dogshape.validation.blind.intervals import share
from dogshape.validation.blind.stand import Point, Truth, read_points, read_stand
from dogshape.validation.blind.true_effects import RANGES, truth_of
from dogshape.validation.second_engine import engine_available
from tests.conftest import needed
from tests.toy import EFFECTS, Toy, bench_of, points_of

BASE = bundled_root() / "bench" / "mq200_adams"
STAND = read_stand(BASE)
STAGE = Stage(STAND, read_points(BASE))
FAST = Point(249.0 * RPM, 641.5, 0.12614)
DELAY, LAG = ("actuation_delay",), ("actuation_lag",)


def _case(parameters: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"causes": sorted(parameters), "parameters": parameters, "outside": {}, "seed": 7} | more


LATE = _case({"actuation_delay": {"delay_s": 0.1}})


def _direct(means: dict[tuple[str, ...], list[float]], **more: Any) -> dict[str, Any]:
    """A diagnosis that is even between hypotheses and asks for the force at the sleeve."""
    foretold = [{"effects": list(h), "mean": m, "sd": [ERROR] * 2} for h, m in means.items()]
    return {
        "verdict": "ambiguous",
        "hypotheses": [{"effects": list(h), "probability": 1.0 / len(means)} for h in means],
        "next_test": {
            "name": "force at the sleeve over time", "kind": "direct",
            "parameters": ["delay_s", "lag_s"], "foretold": foretold,
        },
        **more,
    }  # fmt: skip


def _stage() -> Stage:
    return STAGE


def _told(case: dict[str, Any], result: dict[str, Any]) -> Advised:
    return judged_by_test("case_00", case, result, _stage)


def test_probabilities_after_an_outcome_are_those_of_bayes() -> None:
    """Two normal densities, 1 and 3 errors away: odds are 2 e^-0.5 to e^-4.5."""
    foretold = [
        {"effects": ["a"], "mean": [0.4], "sd": [0.1]},
        {"effects": ["b"], "mean": [0.0], "sd": [0.1]},
    ]
    found = updated({("a",): 0.6, ("b",): 0.3, ("c",): 0.1}, foretold, [0.3])
    assert found[("a",)] / found[("b",)] == pytest.approx(2.0 * math.exp(4.0))
    assert sum(found.values()) == pytest.approx(1.0)
    wide = updated({("a",): 0.5, ("b",): 0.5}, [foretold[0], foretold[1] | {"sd": [0.2]}], [0.4])
    assert wide[("a",)] / wide[("b",)] == pytest.approx(2.0 * math.exp(2.0))


def test_a_direct_test_of_the_truth_settles_it() -> None:
    found = _told(LATE, _direct({DELAY: [0.4, 0.0], LAG: [0.0, 0.7], ("unknown",): [0.0, 0.0]}))
    assert found.outcome == pytest.approx([0.4, 0.0], abs=5.0 * ERROR)
    assert (found.top, found.settled, found.exact, found.wrong) == (DELAY, True, True, False)
    json.dumps(found.as_dict(), allow_nan=False)


def test_what_stands_in_the_class_of_the_truth_settles_it_too() -> None:
    mass, friction = ("moving_mass",), ("sleeve_friction",)
    case = _case({"moving_mass": {"added_mass_kg": 1.0}})
    # The test tells that there is no lag, and neither of these foretells one.
    even = _direct({mass: [0.0, 0.0], friction: [0.0, 0.0], LAG: [0.0, 0.7]})
    assert _told(case, even).top is None
    result = _direct({friction: [0.0, 0.0], LAG: [0.0, 0.7]})
    assert (_told(case, result).wrong, _told(case, result).settled) == (True, False)
    found = _told(case, result | {"classes": [[["sleeve_friction"], ["moving_mass"]]]})
    assert (found.wrong, found.settled, found.exact) == (False, True, False)


def test_a_negative_reading_settles_nothing_wrongly() -> None:
    """A lag is read where something else looks like one: a rival is not the cause for that."""
    mass = ("moving_mass",)
    case = _case({}, outside={"speed_ripple": 0.5})
    result = _direct({LAG: [0.0, 0.7], mass: [0.0, 0.0], ("unknown",): [0.0, 0.0]})
    for one, chance in zip(result["hypotheses"], (0.85, 0.13, 0.02), strict=True):
        one["probability"] = chance
    assert _told(case, result).wrong
    for row in result["next_test"]["foretold"][:1]:
        row["imitator_odds"] = 0.1
    anything = {"effects": ["unknown"], "mean": [0.0, 0.5], "sd": [ERROR, 0.3], "share": 0.5}
    result["next_test"]["foretold"][2]["share"] = 0.5
    result["next_test"]["foretold"].append(anything)
    found = _told(case, result)
    assert (found.top, found.wrong) == (None, False)
    assert found.chances[("unknown",)] > 0.04


def test_covariances_and_marks_that_are_not_shown() -> None:
    """Two marks err together: their sum tells nothing, their difference all."""
    whole = [[1.0, 0.99], [0.99, 1.0]]
    rows = [
        {"effects": ["a"], "mean": [0.0, 0.0], "sd": [1.0, 1.0], "covariance": whole},
        {"effects": ["b"], "mean": [0.0, 1.0], "sd": [1.0, 1.0], "covariance": whole},
    ]
    even = {("a",): 0.5, ("b",): 0.5}
    assert updated(even, rows, [3.0, 3.0])[("a",)] > 0.999
    # The odds of the second mark alone are those of normal densities at 3.
    alone = updated(even, rows, [math.nan, 3.0])
    assert alone[("b",)] / alone[("a",)] == pytest.approx(math.exp(2.5))


def test_traces_that_nothing_predicts_settle_nothing() -> None:
    test = {"name": "traces of 10 shifts", "kind": "traces", "shifts": 10}
    found = _told(LATE, _direct({("unknown",): [0.0, 0.0]}) | {"next_test": test})
    assert (found.outcome, found.top, found.settled, found.wrong) == ((), None, False, False)
    figures = settled_figures(1, [found])
    assert (figures["judged"], figures["settled"]) == (0, share([False]))


def test_what_is_absent_reads_as_the_diagnosis_foretells_it() -> None:
    setting = setting_of(load_bench("mq200_adams"))
    for effect in load().values():
        names = [p.name for p in effect.parameters]
        absent = [p.share(p.neutral_of(setting)) for p in effect.parameters]
        assert shares_of(Truth(), STAND, names) == pytest.approx(absent), effect.name


def test_true_parameters_read_as_shares_of_the_priors() -> None:
    effects = load()
    cases = [case for case in FieldWanted().cases if case.kind in ("single", "pair")]
    for case in cases:
        for name, values in case.parameters.items():
            exact = [p.share(values[p.name]) for p in effects[name].parameters]
            assert shares_of(case.truth, STAND, list(values)) == pytest.approx(exact)
    assert {name for case in cases for name in case.parameters} == set(RANGES)


def test_an_effect_without_parameters_reads_as_there_or_not() -> None:
    assert shares_of(Truth(), STAND, ["reversed_mismatch"]) == [0.0]
    assert shares_of(truth_of({"reversed_mismatch": {}}, {}), STAND, ["reversed_mismatch"]) == [1.0]


def test_what_is_outside_the_list_reads_as_what_acts() -> None:
    names = ["delay_s", "force_factor", "gap_offset_mm"]
    truth = truth_of({}, {"sticking_valve": 0.5, "drift": 0.4, "high_dog": 0.5})
    # The mean delay of 0.1 s in 0 to 0.4; half of a drift of 0.42 in 0.5 to 1.5; a gap smaller by
    # 0.8 mm, the lower end of its range.
    assert shares_of(truth, STAND, names) == pytest.approx([0.25, 0.29, 0.0])


def test_the_error_of_a_direct_test_is_a_twentieth_and_repeatable() -> None:
    assert ERROR == EXACT
    test = _direct({DELAY: [0.25, 0.0]})["next_test"]
    assert outcome_of("case_00", LATE, test, STAGE) == outcome_of("case_00", LATE, test, STAGE)
    drawn = np.array([outcome_of(f"case_{k:03d}", LATE, test, STAGE) for k in range(400)])
    assert drawn.mean(axis=0) == pytest.approx([0.25, 0.0], abs=4.0 * ERROR / 20.0)
    assert drawn.std(axis=0) == pytest.approx([ERROR, ERROR], rel=0.15)


def test_more_shifts_are_those_of_the_second_engine_with_the_truth() -> None:
    needed(engine_available(), "mujoco")
    free = more_shifts(Truth(), STAGE, FAST, 3, 5)
    assert more_shifts(Truth(delay=0.1), STAGE, FAST, 3, 5) == pytest.approx([free[0] + 0.1])
    assert more_shifts(Truth(), Stage(replace(STAND, timeout=0.01), (FAST,)), FAST, 3, 5) == ()


def test_more_shifts_are_made_at_the_operating_point_of_the_test() -> None:
    needed(engine_available(), "mujoco")
    test = {"kind": "shifts", "mismatch_rpm": 249.0, "force_N": 641.5, "shifts": 2}
    (time,) = outcome_of("case_00", LATE, test, STAGE)
    assert 0.1 + 0.0196 < time < 0.3
    with pytest.raises(StorageError, match=r"at 250 1/min .* remove the results"):
        outcome_of("case_00", LATE, test | {"mismatch_rpm": 250.0}, STAGE)


def test_traces_show_the_marks_of_the_flight_with_the_truth() -> None:
    """A dead time moves all marks of the displacement, and the force measured at the actuator."""
    needed(engine_available(), "mujoco")
    free, late = (np.array(more_traces(t, STAGE, FAST, 2, 5)) for t in (Truth(), Truth(delay=0.1)))
    shown = np.isfinite(free[: len(WAYS)])
    assert shown.sum() >= 3
    moved = (late - free)[: len(WAYS)][shown]
    assert moved == pytest.approx(np.full(moved.size, 0.1), abs=2e-3)
    # The force is measured at the actuator, and so as late.
    assert (late - free)[len(WAYS)] == pytest.approx(0.1, abs=2e-3)
    assert more_traces(Truth(), Stage(replace(STAND, timeout=0.01), (FAST,)), FAST, 2, 5) == ()
    test = {"kind": "traces", "mismatch_rpm": 249.0, "force_N": 641.5, "shifts": 2}
    assert len(outcome_of("case_00", LATE, test, STAGE)) == SIZE


def test_the_record_of_a_diagnosis_has_what_is_needed_to_judge_its_test() -> None:
    """A delay that the toy cannot tell from a lag; the force at the sleeve tells it."""
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(1), shifts=20)
    effects = {name: EFFECTS[name] for name in (*DELAY, *LAG, "moving_mass")}
    record = diagnose(bench, Toy(points_of()), effects, pairs=[]).as_dict()
    assert record["verdict"] == "ambiguous"
    assert _told(_case({"actuation_delay": {"delay_s": 0.08}}), record).exact
