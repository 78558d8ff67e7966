"""Field sets: their cases, data and seal; outcomes of advised tests by the truth of a case."""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.bench.bench_data import load_bench, setting_of
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.next_test import quantities_of
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.validation.blind import advised_test, data, field_set, score, sealed
from dogshape.validation.blind import cases as field_cases
from dogshape.validation.blind.advised_test import (
    hindsight_menu,
    judge_test,
    outcome_of,
    readings_of,
)
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import expect, true_points
from dogshape.validation.blind.field_set import base, cases_of, make_field
from dogshape.validation.blind.stand import read_points, read_stand
from dogshape.validation.blind.true_effects import RANGES

CANDIDATES = tuple(cases_of().values())
CASES = tuple(some[0] for some in CANDIDATES)
GRID = read_points(base("large"))
BASE_CASE = Case("none", "means", "planar", "large", 5)


def test_a_full_set_has_what_was_asked_for() -> None:
    # docs/blind.md has these numbers.
    assert Counter(case.engine for case in CASES) == {"planar": 26, "mujoco": 46}
    kinds = {"none": 10, "single": 22, "pair": 20, "outside": 20}
    assert Counter(case.kind for case in CASES) == kinds
    names = {name for case in CASES if case.kind == "single" for name in case.causes}
    assert names <= set(RANGES)
    assert len(names) >= 14
    pairs = [case.causes for case in CASES if case.kind == "pair"]
    assert not {name for pair in pairs for name in pair} & {*field_cases.READING_EFFECTS}
    forms = Counter(case.form for case in CASES)
    assert 0.4 * len(CASES) < forms["means"] < 0.6 * len(CASES)
    assert forms["traces"] > 0
    for case in CASES:
        assert 12 <= len(case.places) == len(case.numbers) <= 28
        assert 3 <= min(case.numbers) <= max(case.numbers) <= 20
        assert 0.01 <= case.force_error <= 0.03
        assert 0.01 <= case.speed_error <= 0.02
        assert case.displacement_at in (case.sensor, "unknown")
    assert all(len(set(case.numbers)) > 1 for case in CASES)


def test_nominal_values_are_off_by_their_errors() -> None:
    case = replace(
        BASE_CASE, places=(0,) * 24, numbers=(3,) * 24, force_error=0.03, speed_error=0.01
    )
    ratios = []
    for seed in range(40):
        pairs = zip(true_points(replace(case, seed=seed), GRID), GRID, strict=True)
        ratios += [(t.force / p.force, t.mismatch / p.mismatch) for t, p in pairs]
    spread = np.std(np.array(ratios) - 1.0, axis=0)
    assert spread == pytest.approx([0.03, 0.01], rel=0.1)
    assert true_points(case, GRID) == true_points(case, GRID)


def _likelihood(folder: Path, sensor: str, model: Any) -> Any:
    """Read the data, as any likelihood does."""
    assert sensor in ("sleeve", "actuator")
    load_bench(folder)
    return SimpleNamespace(model=model)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small set of the compiled engine at few angles, stopped once before its seal."""
    folder = tmp_path_factory.mktemp("field") / "set"

    def stopped(*_: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(field_cases, "COUNTS", {"planar": field_cases.COUNTS["planar"]})
        patch.setitem(data.ANGLE_COUNTS, "planar", 4)
        # The later of two candidates is clearer, and neither is clear.
        yards = iter({"noncentrality": float(k)} for k in range(9))
        patch.setattr(field_set, "yardstick_of", lambda *_: next(yards))
        cases = {
            n: (candidates[0], replace(candidates[0], seed=1))
            for n, candidates in cases_of(3, small=True).items()
        }
        seal = field_set._seal
        patch.setattr(field_set, "_seal", stopped)
        with pytest.raises(KeyboardInterrupt):
            make_field(folder, cases, _likelihood)
        patch.setattr(field_set, "_seal", seal)
        patch.setattr(field_set, "simulate_case", stopped)  # what is finished is not made again
        make_field(folder, cases, _likelihood)
    return folder


def test_a_set_that_was_stopped_is_sealed_whole(made: Path) -> None:
    manifest, key = sealed.manifest_of(made), sealed.open_key(made)
    assert set(manifest["cases"]) == set(key["cases"])
    assert [record["name"] for record in manifest["figures"]] == [
        record.name for record in score.HEADLINES
    ]
    assert {record["kind"] for record in key["cases"].values()} == {
        "none",
        "single",
        "pair",
        "outside",
    }
    for name, case in key["cases"].items():
        assert manifest["cases"][name] == sealed.hash_of(made / "cases" / name)
        assert case["seed"] == 1
        assert len(case["expected"]["mean"]) == len(case["places"])
    assert not (made / "making").exists()
    with pytest.raises(StorageError, match="has a set of cases already"):
        make_field(made, {}, _likelihood)


def test_data_say_nothing_of_the_truth(made: Path) -> None:
    for name, case in sealed.open_key(made)["cases"].items():
        with (made / "cases" / name / "shifts.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        bench = load_bench(made / "cases" / name)
        stated = bench.errors.each_point
        assert stated.sizes[0] == pytest.approx(case["force_error"], rel=0.01)
        assert stated.sizes[2] == pytest.approx(case["speed_error"], rel=0.01)
        assert bench.record.displacement_at == case["displacement_at"]
        points = {(row["mismatch_rpm"], row["force_N"]) for row in rows}
        assert len(points) == len(case["places"])
        assert {float(f) for _, f in points} <= {p.force for p in read_points(base(case["stand"]))}
        assert sum(int(row["n_shifts"]) for row in rows) == sum(case["numbers"])
        if case["form"] == "singles":
            order = [int(row["order"]) for row in rows]
            assert sorted(order) == list(range(1, len(rows) + 1))
            assert (order == sorted(order)) != case["shuffled"]


BENCH, EFFECTS = load_bench(base("prototype")), load(None)
DIAGNOSIS: Any = SimpleNamespace(
    bench=BENCH,
    effects=EFFECTS,
    settings=USUAL,
    model=SimpleNamespace(setting=setting_of(BENCH)),
    flights=SimpleNamespace(marks=None),
)
MASS = Case("single", "means", "planar", "prototype", 3, {"moving_mass": {"added_mass_kg": 1.0}})


def _direct(*effects: str) -> NextTest:
    names = tuple(p.name for e in effects for p in EFFECTS[e].parameters or [EFFECTS[e]])
    return NextTest("look", "Look.", "direct", 1.0, effects, names, information=1.0, gain=0.3)


def test_direct_tests_read_the_truth_with_the_errors_of_their_instruments() -> None:
    test = _direct("moving_mass", "reversed_mismatch", "actuation_delay")
    effects = [EFFECTS[name] for name in test.effects]
    quantities = quantities_of(effects, DIAGNOSIS.model.setting, DIAGNOSIS.settings.presence_error)
    assert readings_of(MASS, quantities) == pytest.approx([1.0, 0.0, 0.0])
    reversed_case = replace(MASS, parameters={**MASS.parameters, "reversed_mismatch": {}})
    assert readings_of(reversed_case, quantities)[1] == 1.0
    outcomes = [outcome_of(Path(), replace(MASS, seed=k), DIAGNOSIS, test) for k in range(300)]
    mass, presence, delay = np.std(np.array(outcomes), axis=0)
    # 3 % of 1 kg and 20 g; a clock of 1 ms.
    assert mass == pytest.approx(np.hypot(0.03, 0.02), rel=0.15)
    assert presence == pytest.approx(DIAGNOSIS.settings.presence_error, rel=0.15)
    assert delay == pytest.approx(1e-3, rel=0.15)


def test_more_shifts_have_the_mean_that_the_engine_expects() -> None:
    cell = BENCH.cells[20].point
    place = cell.mismatch, cell.profile.force
    test = NextTest("more", "Shift.", "shifts", 1.0, cell=20, point=place, shifts=120)
    folder = base("prototype")
    mean, engaged = outcome_of(folder, MASS, DIAGNOSIS, test)
    exact = expect("planar", read_stand(folder), [read_points(folder)[20]], MASS.truth, [0.0])
    assert mean == pytest.approx(exact.mean[0], abs=4.0 * exact.sd[0] / 120**0.5)
    assert engaged == 1.0


@pytest.mark.parametrize(
    ("after", "rise", "realised", "misled"),
    [
        ({("moving_mass",): 0.9, (): 0.1}, 0.5, 0.6, False),
        ({(): 0.9, ("moving_mass",): 0.1}, -0.3, -0.5, False),
        ({("detent_force",): 0.9, ("moving_mass",): 0.1}, -0.3, -0.1, True),
        ({("detent_force",): 0.6, ("moving_mass",): 0.4}, 0.0, -0.1, False),
    ],
)
def test_a_test_lifts_the_truth_or_misleads(
    after: Any, rise: float, realised: float, misled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second test of the menu names the truth: it is the best one in hindsight."""
    better = replace(_direct("moving_mass"), name="better")

    def update(_: Any, test: NextTest, __: Any) -> Any:
        return {("moving_mass",): 1.0} if test is better else after

    monkeypatch.setattr(advised_test, "update_posterior", update)
    posterior = {(): 0.5, ("moving_mass",): 0.4, ("detent_force",): 0.1}
    tests = [_direct("moving_mass"), better]
    fields = {**vars(DIAGNOSIS), "tests": tests, "posterior": posterior}
    diagnosis: Any = SimpleNamespace(**fields)
    correct = [("moving_mass",)]
    advised = judge_test(Path(), MASS, diagnosis, correct)
    assert advised is not None
    assert (advised.rise, advised.realised) == pytest.approx((rise, realised))
    assert (advised.misled, advised.foreseen) == (misled, 0.3)
    assert (advised.best_test, advised.best_rise) == ("better", pytest.approx(0.6))


def test_of_more_shifts_at_a_point_the_larger_number_counts_in_hindsight() -> None:
    counts = [
        NextTest(f"{n} at {cell}", "", "shifts", 1.0, cell=cell, shifts=n)
        for cell in (0, 1)
        for n in (10, 40)
    ]
    menu = [test.name for test in hindsight_menu([*counts, _direct("moving_mass")])]
    assert menu == ["10 at 0", "40 at 0", "40 at 1", "look"]
