"""Plans of shifts: distances in closed form, limits, order, and the verb ``plan-shifts``."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.inference import outcome
from dogshape.diagnosis.inference.outcome import Field, shift_plan, visits
from dogshape.diagnosis.terms import NONE
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions
from tests.conftest import Call
from tests.fits import POINTS, Array, field_at
from tests.toy import EFFECTS

LONGEST = EFFECTS["actuation_delay"].parameters[0].high  #: dead time of the range, s
DELAYS = LONGEST * (np.arange(outcome.TRUTHS) + 0.5) / outcome.TRUTHS
STEP = LONGEST / outcome.RIVALS  #: s, between rivals


def test_the_distance_of_a_dead_time_is_that_of_its_mean() -> None:
    """A dead time d moves all times alike: D = d^2 / (sd^2/n + e^2) at one operating point."""
    field = field_at(("actuation_delay",), POINTS[:1])
    base = field.baseline
    for n in (1, 10, 400):
        variance = base.sd[0, 0] ** 2 / n + 1e-6
        none, late = field.distances(np.array([float(n)]))
        assert late[:, 0] == pytest.approx(DELAYS**2 / variance, rel=1e-6)
        # None, and any dead time, is imitated by a dead time.
        assert max(none[0, 1], late[:, 1].max()) <= (STEP / 2) ** 2 / variance * (1 + 1e-6)


def test_what_all_points_have_in_common_is_no_evidence_however_many_shifts() -> None:
    """With a discrepancy of s t, D of a dead time stays below d^2 / (s^2 t^2 + e^2)."""
    field = field_at(("actuation_delay",), POINTS[:1], 0.04)
    time = field.baseline.mean[0, 0]
    many = field.distances(np.array([1e12]))[1][:, 0]
    assert many == pytest.approx(DELAYS**2 / ((0.04 * time) ** 2 + 1e-6), rel=1e-4)


def test_half_the_distance_is_the_mean_log_bayes_factor_of_simulated_means() -> None:
    """A second method: means drawn with scatter and common errors, scored by their density."""
    field, n, count = field_at(("actuation_delay",), POINTS[:3], 0.03), 10.0, 4000
    shifts, base = np.full(3, n), field.baseline
    covariance = np.diag(base.sd[0] ** 2 / n + 1e-6) + field.common
    truth = int(np.argmin(abs(field.distances(shifts)[1][:, 0] - 8.0)))
    generator = np.random.default_rng(1)
    means = generator.multivariate_normal(base.mean[0] + DELAYS[truth], covariance, count)

    def log(delay: float) -> Array:
        left = means - base.mean[0] - delay
        return np.asarray(-0.5 * (left * np.linalg.solve(covariance, left.T).T).sum(axis=1))

    odds = log(DELAYS[truth]) - log(0.0)
    error = odds.std() / np.sqrt(count)
    distance = field.distances(shifts)[1][truth, 0]
    assert odds.mean() == pytest.approx(0.5 * distance, abs=4.0 * error)
    assert 4.0 * error < 0.1 * distance


def test_more_shifts_are_worth_more_and_a_greedy_choice_beats_the_reference_alone() -> None:
    field = field_at(("actuation_delay", "force_scale", "moving_mass", "sleeve_friction"))
    plans = [shift_plan(field, n) for n in (20, 60, 240)]
    worths = [plan.worth for plan in plans]
    assert worths == sorted(worths)
    for plan, total in zip(plans, (20, 60, 240), strict=True):
        assert sum(plan.shifts) == total
        alone = np.zeros(len(field.common))
        alone[plan.reference] = total
        assert plan.worth >= field.worth(alone)
        assert plan.worth >= field.worth(np.full(len(plan.shifts), total / len(plan.shifts))) - 0.01


def test_the_reference_comes_first_amid_and_last_and_the_others_at_random() -> None:
    shifts = [0, 16, 5, 7, 9, 11, 6]
    found = visits(shifts, 1, seed=1)
    places = [place for place, _ in found]
    assert [k for k, place in enumerate(places) if place == 1] == [0, 3, 7]
    assert [n for place, n in found if place == 1] == [6, 5, 5]
    assert sorted(place for place in places if place != 1) == [2, 3, 4, 5, 6]
    assert {n for place, n in found if place == 4} == {9}
    orders = {tuple(place for place, _ in visits(shifts, 1, seed)) for seed in range(20)}
    assert len(orders) > 10
    assert visits(shifts, 1, seed=1) == found
    assert visits([0, 15], 1, seed=1) == ((1, 5), (1, 5), (1, 5))


def test_the_reference_scatters_least_and_a_limit_of_points_is_kept() -> None:
    field = field_at(("actuation_delay", "moving_mass"))
    plan = shift_plan(field, 60, max_points=3)
    assert field.baseline.sd[0, plan.reference] == field.baseline.sd[0].min()
    assert sum(n > 0 for n in plan.shifts) <= 3
    assert plan.shifts[plan.reference] >= outcome.REFERENCE_VISITS * outcome.MIN_LOT
    assert plan.hours == pytest.approx(0.5 * len(plan.order) + 0.02 * 60)
    assert field.hypotheses == (NONE, ("actuation_delay",), ("moving_mass",))


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy in the place of a bank, at the operating points of the published tables."""

    def predict_field(bench: Bench, means: BankOptions) -> Field:
        points = [cell.point for cell in bench.cells]
        return field_at(("actuation_delay", "moving_mass"), points)

    monkeypatch.setattr("dogshape.gap.predict_field", predict_field)


@pytest.mark.usefixtures("_toy")
def test_the_verb_plans_and_writes_a_table_to_fill_in(dogshape: Call, tmp_path: Path) -> None:
    said = dogshape("plan-shifts", "mq200_adams", "--shifts", 40, "--out", "s.csv", "--json")
    assert said.status == 0, said.err
    record = said.json
    assert sum(visit["shifts"] for visit in record["order"]) == record["shifts"] == 40
    assert [v["reference"] for v in record["order"]].count(True) == 3
    assert {pair["truth"] for pair in record["pairs"]} == {"none", "actuation_delay", "moving_mass"}
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    first = record["order"][0]
    assert len(rows) == 40
    assert float(rows[0]["mismatch_rpm"]) == pytest.approx(first["mismatch_rpm"])
    assert rows[0]["shift_time_s"] == ""
    assert [row["order"] for row in rows] == [str(k) for k in range(1, 41)]
    text = dogshape("plan-shifts", "mq200_paper", "--shifts", 40, "--points", 2).out
    assert "operating points, about" in text


@pytest.mark.usefixtures("_toy")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere", "--shifts", 40), "there is no data set and no study at nowhere"),
        (("mq200_adams", "--shifts", 19), "number of shifts is 19, but it must lie between 20"),
        (("mq200_adams", "--shifts", 10**6 + 1), "but it must lie between 20 and 1000000"),
        (("mq200_adams", "--shifts", 40, "--points", 99), "give 1 to 28"),
        (("mq200_adams", "--shifts", 40, "--out", "no/s.csv"), "there is no folder no"),
    ],
)
def test_a_plan_that_cannot_be_is_a_sentence(
    dogshape: Call, arguments: tuple[object, ...], words: str
) -> None:
    said = dogshape("plan-shifts", *arguments)
    assert (said.status, words in said.sentence) == (2, True), said.err
