"""Plans of shifts: distances in closed form, limits, order, and the verb."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, setting_of
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.bench.stand_file import Sensor
from dogshape.diagnosis.inference.shift_plan import (
    LOT,
    VISITS,
    Field,
    field_of,
    shift_plan,
    steadiest,
    visits,
)
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem, score
from dogshape.diagnosis.prediction.hypotheses import spaces_for
from dogshape.diagnosis.settings import Rules, Settings
from dogshape.sim.bundled import bundled_root
from dogshape.sim.shift.clutch import OperatingPoint
from tests.conftest import Said
from tests.toy import CLUTCH, EFFECTS, Toy, bench_of, points_of

Call = Callable[..., Said]
POINTS = points_of((235.2, 641.5))
PLAIN = Rules(discrepancy=0.0)
LONGEST = EFFECTS["actuation_delay"].parameters[0].high  #: dead time of the range, s


def _field(
    names: tuple[str, ...],
    points: tuple[OperatingPoint, ...] = POINTS,
    rules: Rules = PLAIN,
) -> Field:
    bench = bench_of({}, np.random.default_rng(1), points=points)
    problem = Problem(observe(bench), Toy(points), Settings(rules))
    return field_of(problem, {name: EFFECTS[name] for name in names}, setting_of(bench))


def test_the_distance_of_a_dead_time_is_that_of_its_mean() -> None:
    """A dead time d moves all times alike: D = d^2 / (sd^2/n + e^2) at one operating point."""
    field = _field(("actuation_delay",), POINTS[:1])
    delays = LONGEST * (np.arange(24) + 0.5) / 24
    base = field.baseline
    for n in (1, 10, 400):
        variance = base.core_sd[0, 0] ** 2 / n + base.error[0, 0] ** 2
        found = field.distances(np.array([float(n)]))
        assert found[1:, 0] == pytest.approx(delays**2 / variance, rel=1e-3)
        # None, and any dead time, is imitated by a dead time.
        assert found[0].tolist() == pytest.approx([0.0, 0.0], abs=1e-9)
        assert found[1:, 1].max() < 4.0 * (LONGEST / 63 / 2) ** 2 / variance
        right = [field.log_odds(np.array([float(n)]))[1, 0], 0.5 * (delays**2 / variance).mean()]
        assert right[0] == pytest.approx(right[1], rel=1e-3)


def test_what_all_points_have_in_common_is_no_evidence_however_many_shifts() -> None:
    """With a discrepancy of s t in the mean square, D of a dead time stays below d^2 / (s t)^2."""
    point = POINTS[:1]
    whole = _field(("actuation_delay",), point, Rules(discrepancy=0.04))
    time = whole.baseline.core[0, 0]
    many = whole.distances(np.array([1e9]))[1:, 0]
    delays = LONGEST * (np.arange(24) + 0.5) / 24
    error = whole.baseline.error[0, 0]
    shared = whole.common[0, 0]
    assert np.sqrt(shared) == pytest.approx(0.04 * time, rel=0.15)
    limit = delays**2 / (shared + error**2)
    assert many == pytest.approx(limit, rel=1e-3)


def test_a_value_of_large_error_is_not_the_nearest_to_anything() -> None:
    """What emulation alone makes is taken off the nearest value, and does not choose it."""
    field = _field(("actuation_delay",), POINTS[:1])
    shifts = np.array([10.0])
    plain = field.distances(shifts)
    own = field.rivals.own.copy()
    own[-1] = 1.0  # the longest dead time, a quarter of a second from where none is
    doubtful = replace(field, rivals=replace(field.rivals, own=own))
    assert doubtful.distances(shifts)[0] == pytest.approx(plain[0])
    assert doubtful.distances(shifts)[5] == pytest.approx(plain[5])


def test_what_no_shift_shows_is_a_coin() -> None:
    """The toy knows no drag, so nothing tells it from none."""
    field = _field(("drag_torque",))
    plan = shift_plan(field, 40)
    assert plan.worth == pytest.approx(0.5)
    assert plan.apart[1, 0] == plan.apart[0, 1] == 0.0
    assert field.worth(np.zeros(field.cells)) == pytest.approx(0.5)


def test_a_pair_is_decided_by_half_the_distance() -> None:
    field = _field(("actuation_delay",))
    shifts = np.full(field.cells, 5.0)
    distances = field.distances(shifts)
    both = ndtr(0.5 * np.sqrt(distances[1:, 0])).mean(), ndtr(0.5 * np.sqrt(distances[0, 1]))
    assert field.worth(shifts) == pytest.approx(sum(both) / 2)


def test_more_shifts_are_worth_more_and_a_greedy_choice_beats_the_reference_alone() -> None:
    field = _field(("actuation_delay", "force_scale", "moving_mass", "sleeve_friction"))
    plans = [shift_plan(field, n) for n in (20, 60, 240)]
    worths = [plan.worth for plan in plans]
    assert worths == sorted(worths)
    for plan, total in zip(plans, (20, 60, 240), strict=True):
        assert sum(plan.shifts) == total
        alone = np.zeros(field.cells)
        alone[plan.reference] = total
        assert plan.worth >= field.worth(alone)
        assert plan.worth >= plan.evenly - 0.01


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
    field = _field(("actuation_delay", "moving_mass"))
    plan = shift_plan(field, 60, most=3)
    assert plan.reference == steadiest(field)
    assert field.baseline.core_sd[0, plan.reference] == field.baseline.core_sd[0].min()
    assert sum(n > 0 for n in plan.shifts) <= 3
    assert plan.shifts[plan.reference] >= VISITS * LOT
    assert plan.hours == pytest.approx(0.5 * len(plan.order) + 0.02 * 60)


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy in the place of a bank, at the operating points of the published tables."""

    class _Flights:
        def save(self) -> None:
            """Keep nothing."""

    def emulator_of(bench: Any, effects: Any, means: Any) -> tuple[Toy, _Flights]:
        return Toy(tuple(cell.point for cell in bench.cells)), _Flights()

    few = {n: EFFECTS[n] for n in ("actuation_delay", "moving_mass")}
    monkeypatch.setattr("dogshape.pipeline.diagnose.planned_bench.emulator_of", emulator_of)
    monkeypatch.setattr("dogshape.pipeline.diagnose.planned_bench.load", lambda _: few)


@pytest.mark.usefixtures("_toy")
def test_the_verb_plans_and_writes_a_table_to_fill_in(dogshape: Call, tmp_path: Path) -> None:
    said = dogshape("gap", "plan", "mq200_adams", "--shifts", 40, "--out", "s.csv", "--json")
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
    # Filled in, it is a table in whose series a drift is looked for.
    shutil.copy(bundled_root() / "bench" / "mq200_adams" / "bench.toml", tmp_path)
    lines = (tmp_path / "s.csv").read_text().splitlines()
    filled = [line.replace(",1,,,,", ",1,0.3,true,,") for line in lines]
    (tmp_path / "shifts.csv").write_text("\n".join(filled))
    drift = observe(load_bench(tmp_path)).drift
    assert drift is not None
    assert (drift.first, drift.last) == (1.0, 40.0)
    text = dogshape("gap", "plan", "mq200_paper", "--shifts", 40, "--points", 2).out
    assert "spread evenly over all 28" in text
    assert "reference" in text


@pytest.mark.usefixtures("_toy")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere", "--shifts", 40), "there is no data set and no study at nowhere"),
        (("mq200_adams", "--shifts", 19), "number of shifts is 19, but it must lie between 20"),
        (("mq200_adams", "--shifts", 40, "--points", 99), "give 1 to 28"),
        (("mq200_adams", "--shifts", 40, "--out", "no/s.csv"), "there is no folder no"),
    ],
)
def test_a_plan_that_cannot_be_is_a_sentence(
    dogshape: Call, arguments: tuple[object, ...], words: str
) -> None:
    said = dogshape("gap", "plan", *arguments)
    assert (said.status, words in said.sentence) == (2, True), said.err


def test_help_of_two_words_has_an_example_and_a_folder_of_that_name_is_reached(
    dogshape: Call,
) -> None:
    assert "Example: dogshape gap plan" in dogshape("gap", "plan", "--help").out
    assert "Example: dogshape gap mq200_stand" in dogshape("gap", "--help").out
    assert "there is no data set at ./plan" in dogshape("gap", "./plan").sentence


def test_half_the_distance_is_the_mean_log_bayes_factor_of_simulated_data() -> None:
    """A second method: data drawn with all their errors, scored by the likelihood itself."""
    points, n, count = POINTS[4:6], 10, 300
    field = _field(("actuation_delay",), points)
    shifts = np.full(2, float(n))
    truth = 1 + int(np.argmin(abs(field.distances(shifts)[1:, 0] - 8.0)))
    distance = field.distances(shifts)[truth, 0]
    delay = LONGEST * (truth - 0.5) / 24
    base = field.baseline
    widths = np.sqrt(base.core_sd[0] ** 2 / n + base.error[0] ** 2)
    generator = np.random.default_rng(1)
    spaces = spaces_for([(), ("actuation_delay",)], EFFECTS, setting_of(bench_of({}, generator)))
    odds = []
    for _ in range(count):
        means = base.core[0] + delay + widths * generator.standard_normal(2)
        readings = [
            Reading(k, point, n, float(mean), True)
            for k, (point, mean) in enumerate(zip(points, means, strict=True), start=2)
        ]
        bench = Bench("drawn", "", CLUTCH, gather(readings), None, Sensor())
        problem = Problem(observe(bench), Toy(points), Settings(PLAIN))
        none = score(problem, spaces[0], np.zeros((1, 0)))
        late = score(problem, spaces[1], np.array([[delay / LONGEST]]))
        odds.append(float(late.whole[0] - none.whole[0]))
    error = np.std(odds) / np.sqrt(count)
    assert np.mean(odds) == pytest.approx(0.5 * distance, abs=4.0 * error)
    assert 4.0 * error < 0.25 * distance
