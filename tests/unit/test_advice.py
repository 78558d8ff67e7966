"""Worth of bench tests: what unknown causes and imitators predict, and what misleads."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from dogshape.diagnosis.bench.flight_marks import FORCES, SIZE, WAYS
from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.bench.stand_file import TestTerms
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference import next_test
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.next_test import (
    ABSENT,
    EXACT,
    MISLED,
    SETUP,
    SHIFT,
    TRACED,
    TRACING,
    NextTest,
    Standing,
)
from dogshape.diagnosis.inference.outcome import ODDS, Decision, Outcome
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.prediction.prediction import Marks, Prediction
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.shift.actuation import ForceProfile
from tests.toy import EFFECTS, Toy, bench_of, named_values, points_of

LAG, MASS, DELAY = ("actuation_lag",), ("moving_mass",), ("actuation_delay",)
STIFF = ("contact_stiffness",)
ALONE = Confusion((), np.zeros((0, 0)), ())
POINTS = points_of((235.2, 641.5))
FORCE = EFFECTS["actuation_delay"].test.name


def _decision(odds: float = ODDS, **chances: float) -> Decision:
    """Two hypotheses and unknown, of which none imitates another."""
    names = (LAG, MASS, UNKNOWN)
    shares = [chances.get(name, 1e-9) for name in ("lag", "mass", "unknown")]
    return replace(Decision.of(names, np.array(shares), ALONE), odds=odds)


def _reading(*, of: Hypothesis = LAG) -> Outcome:
    """A direct test of the lag: 0.7 of its prior, or nothing; unknown nothing or anything."""
    mean = np.array([[0.7], [0.0], [0.0], [0.5]])
    variance = np.array([EXACT, EXACT, EXACT, np.hypot(EXACT, 12.0**-0.5)]) ** 2
    read = np.array([of == LAG, of == MASS, False])
    share = np.array([1.0, 1.0, ABSENT, 1.0 - ABSENT])
    return Outcome(np.array([0, 1, 2, 2]), share, mean, variance[:, None, None], read)


def _nothing() -> Outcome:
    """A test of which all hypotheses predict the same."""
    return Outcome.normal(np.zeros((3, 1)), np.ones((3, 1)))


def test_densities_are_those_of_a_mixture_and_draws_follow_them() -> None:
    outcome = _reading()
    place = np.array([[0.3]])
    tall = np.exp(-0.5 * (0.3 / EXACT) ** 2) / (EXACT * np.sqrt(2.0 * np.pi))
    width = np.hypot(EXACT, 12.0**-0.5)
    wide = np.exp(-0.5 * (0.2 / width) ** 2) / (width * np.sqrt(2.0 * np.pi))
    found = np.exp(outcome.log_density(place))[0]
    assert found[1:] == pytest.approx([tall, 0.5 * tall + 0.5 * wide])
    drawn = outcome.draw(np.repeat([1, 2], 20000), np.random.default_rng(1))[:, 0]
    assert drawn[:20000].std() == pytest.approx(EXACT, rel=0.03)
    assert drawn[20000:].mean() == pytest.approx(0.25, abs=0.01)
    second = 0.5 * EXACT**2 + 0.5 * (0.25 + width**2)
    assert (drawn[20000:] ** 2).mean() == pytest.approx(second, rel=0.03)


def test_a_negative_reading_does_not_hand_its_probability_to_the_runner_up() -> None:
    """A lag of 0.96 is not found: without imitators the mass would be named."""
    read, absent = _reading(), np.array([[0.0]])
    chances = {"lag": 0.96, "mass": 0.04}
    bare = _decision(0.0, **chances)
    lag, mass, _ = bare.after(read.log_density(absent), read.read)[0]
    assert (lag < 1e-6, mass > 0.99) == (True, True)
    decision = _decision(**chances)
    lag, mass, unknown = decision.after(read.log_density(absent), read.read)[0]
    # Odds: the imitator of the lag, half of it with nothing to show, to the mass and its own.
    width = np.hypot(EXACT, 12.0**-0.5)
    wide = EXACT / width * np.exp(-0.5 * (0.5 / width) ** 2)
    imitator = 0.96 * ODDS / (1.0 + ODDS) * (ABSENT + (1.0 - ABSENT) * wide)
    assert unknown / mass == pytest.approx(imitator / 0.04, rel=1e-6)
    assert unknown > 0.5 > mass
    assert lag < 1e-6


def test_an_imitator_counts_with_its_hypothesis_until_it_is_told_apart() -> None:
    decision = _decision(lag=0.7, mass=0.2, unknown=0.1)
    nothing = _nothing()
    same = decision.after(nothing.log_density(np.zeros((1, 1))), nothing.read)[0]
    assert same == pytest.approx([0.7, 0.2, 0.1])
    read = _reading()
    found = decision.after(read.log_density(np.array([[0.7]])), read.read)[0]
    assert found[0] > 0.95


def test_naming_by_a_test_that_reads_nothing_itself_misleads_by_the_imitators() -> None:
    """A test that parts lag and mass for sure, but none from what looks like it."""
    decision = _decision(lag=0.5, mass=0.5)
    apart = Outcome.normal(np.array([[0.0], [9.0], [99.0]]), np.ones((3, 1)))
    worth = decision.worth(apart)
    assert worth.misleads == pytest.approx(ODDS / (1.0 + ODDS), abs=0.003)
    assert worth.settles == pytest.approx(1.0 / (1.0 + ODDS), abs=0.003)
    assert worth.information == pytest.approx(np.log(2.0), abs=0.01)
    direct = decision.worth(replace(apart, read=np.array([True, True, False])))
    assert direct.misleads < 0.01
    assert direct.settles > 0.99


def test_a_test_that_only_excludes_a_rival_misleads() -> None:
    decision = _decision(lag=0.6, mass=0.4)
    reads_lag, reads_mass = (decision.worth(_reading(of=h)) for h in (LAG, MASS))
    # The same outcomes: here what looks like the lag would be seen, there it is not.
    assert reads_lag.misleads < reads_mass.misleads
    assert decision.worth(_nothing()).misleads == 0.0


def test_a_decision_is_settled_by_a_class_or_by_causes_in_any_case() -> None:
    pair, other = ("actuation_delay", "drag_torque"), ("actuation_delay", "free_play")
    names = (pair, other, DELAY, UNKNOWN)
    even = np.array([0.49, 0.49, 0.01, 0.01])
    alone = Decision.of(names, even, ALONE)
    truth = np.array([2, 0])
    # Delay is part of the cause with 0.99, the drag with 0.49.
    settled, wrong = alone.judged(np.array([even, even]), truth, ())
    assert (settled.tolist(), wrong.tolist()) == ([True, False], [False, False])
    sure = np.array([[0.9, 0.05, 0.04, 0.01]])
    told = alone.judged(np.repeat(sure, 3, axis=0), np.array([0, 1, 3]), ())
    assert [one.tolist() for one in told] == [[True, False, False], [False, True, True]]
    classed = Decision.of(names, even, Confusion((), np.zeros((0, 0)), ((pair, other),)))
    settled, wrong = classed.judged(sure, np.array([1]), ())
    assert (settled.tolist(), wrong.tolist()) == ([True], [False])


def test_contact_of_the_simulation_is_named_by_its_direct_test_alone() -> None:
    decision = Decision.of((STIFF, NONE, UNKNOWN), np.array([0.9, 0.09, 0.01]), ALONE)
    sure, truth = np.array([[0.99, 0.01, 0.0]]), np.array([0])
    assert not decision.judged(sure, truth, ())[0].any()
    assert decision.judged(sure, truth, STIFF)[0].all()


def _found(*terms: TestTerms, emulator: Toy | None = None, shifts: int = 20) -> Diagnosis:
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(1), shifts=shifts, points=POINTS)
    few = {name: EFFECTS[name] for name in (*DELAY, *LAG, *MASS)}
    return diagnose(replace(bench, tests=terms), emulator or Toy(POINTS), few, pairs=[])


def test_unknown_predicts_nothing_or_anything_in_a_direct_test() -> None:
    found = _found()
    test = next(t for t in found.tests if t.name == FORCE)
    rows = [row for row in test.as_dict()["foretold"] if row["effects"] == ["unknown"]]
    assert [row["mean"] for row in rows] == [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]]
    assert sum(row["share"] for row in rows) == pytest.approx(1.0)
    assert rows[0]["share"] == ABSENT
    assert rows[1]["sd"] == pytest.approx([np.hypot(EXACT, 12.0**-0.5), EXACT], rel=1e-5)
    delay = next(r for r in test.as_dict()["foretold"] if r["effects"] == list(DELAY))
    assert delay["imitator_odds"] == pytest.approx(ODDS)
    shifts = next(t for t in found.tests if t.asked.kind == "shifts").as_dict()
    assert all("imitator_odds" not in row for row in shifts["foretold"])


def test_a_test_that_misleads_yields_to_one_that_is_worth_its_cost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Shifts that would settle most for their hours, and mislead a little too often."""
    judged = next_test._judged

    def misled(standing: Standing, test: NextTest) -> NextTest:
        shifts = test.asked.kind == "shifts"
        chances = {"settles": 0.9, "misleads": 1.1 * MISLED} if shifts else {"settles": 0.5}
        return replace(judged(standing, test), **{"misleads": 0.9 * MISLED, **chances})

    monkeypatch.setattr(next_test, "_judged", misled)
    found = _found()
    assert found.verdict.kind == "ambiguous"
    first, best = found.tests[0], max(found.tests, key=lambda test: test.value)
    assert (first.asked.kind, best.asked.kind) == ("direct", "shifts")
    assert first.misleads <= MISLED < best.misleads
    assert 0.0 < first.value < best.value
    record = found.as_dict()
    assert record["next_test"]["misleads"] == record["tests"][0]["misleads"] == first.misleads


@dataclass(frozen=True)
class Flying(Toy):
    """The toy with flights: a lag bends the marks that a delay moves all alike."""

    def flight(self, hypothesis: Hypothesis, values: Array, profile: ForceProfile) -> Marks:
        """Return the marks of the flight."""
        named = named_values(hypothesis, values)
        shares = np.array([*(np.cbrt(WAYS) * 0.3), *FORCES])
        still = profile.rise * shares
        late = named.get("delay_s", 0.0) + 0.7 * named.get("lag_s", 0.0) * np.sqrt(shares)
        times = np.broadcast_to(still + late, (len(values), SIZE)).copy()
        return Marks(times, np.full_like(times, 1e-4), np.zeros_like(times))


def test_traces_are_predicted_where_flights_are_known() -> None:
    plain, flying = _found(), _found(emulator=Flying(POINTS))
    assert not [t for t in plain.tests if t.asked.kind == "traces"]
    (test,) = (t for t in flying.tests if t.asked.kind == "traces")
    assert test.hours == pytest.approx(SETUP + TRACING + SHIFT * TRACED)
    # No time of a shift parts these; the marks of the flight do, at the least force.
    assert {DELAY, LAG} <= set(test.hypotheses)
    assert test.asked.point is not None
    assert test.asked.point[1] == 235.2
    assert test.information is not None
    assert test.information > 0.2
    assert test.settles > 0.9
    assert test.misleads < MISLED
    rows = test.as_dict()["foretold"]
    delay = [row for row in rows if row["effects"] == list(DELAY)]
    assert [row["share"] for row in delay] == [0.5, 0.5]
    assert len(delay[0]["mean"]) == SIZE
    still = Flying(POINTS).flight(NONE, np.zeros((1, 0)), POINTS[0].profile).times[0]
    assert np.array(delay[0]["mean"]) - still == pytest.approx(np.full(SIZE, 0.08), abs=5e-3)
    # Where the force of the traces is the nominal one, its marks are the baseline's.
    assert delay[1]["mean"][len(WAYS) :] == pytest.approx(still[len(WAYS) :])
    assert np.linalg.eigvalsh(np.array(delay[0]["covariance"])).min() > 0.0
    unknown = [row for row in rows if row["effects"] == ["unknown"]]
    assert sum(row["share"] for row in unknown) == pytest.approx(1.0)


def test_the_record_of_each_kind_of_test_has_its_keys() -> None:
    found = _found(emulator=Flying(POINTS))
    assert {test.asked.kind for test in found.tests} == {"direct", "shifts", "traces"}
    common = {"name", "kind", "misleads", "foretold"}
    asked = {"direct": {"parameters"}, "shifts": {"mismatch_rpm", "force_N", "shifts"}}
    for test in found.tests:
        record = json.loads(json.dumps(test.as_dict(), allow_nan=False))
        assert set(record) == common | asked.get(test.asked.kind, asked["shifts"])
        assert record["misleads"] == test.misleads


def test_traces_that_a_stand_cannot_make_are_not_advised() -> None:
    found = _found(TestTerms("traces", possible=False), emulator=Flying(POINTS))
    assert not [t for t in found.tests if t.asked.kind == "traces"]


@dataclass(frozen=True)
class Sided(Toy):
    """The toy whose shifts are shorter with the reversed sense."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Return what a hypothesis says of an operating point."""
        one = super().at(hypothesis, values, cell)
        return replace(one, times=one.times * (0.75 if REVERSED in hypothesis else 1.0))


def test_the_sense_is_looked_at_first_where_a_reversed_one_is_named() -> None:
    bench = bench_of({}, np.random.default_rng(1), shifts=40, points=POINTS)
    cells = tuple(
        replace(
            cell, readings=tuple(replace(r, time=0.75 * (r.time or 0.0)) for r in cell.readings)
        )
        for cell in bench.cells
    )
    few = {name: EFFECTS[name] for name in (*DELAY, *LAG, *MASS, REVERSED)}
    found = diagnose(replace(bench, cells=cells), Sided(POINTS), few, pairs=[])
    assert found.verdict.causes == (REVERSED,)
    first = found.tests[0]
    assert first.name == EFFECTS[REVERSED].test.name
    assert first.misleads < MISLED
    assert first.hours == 0.25


@pytest.mark.parametrize(("hours", "leads"), [(0.1, True), (0.65, True), (9.0, False)])
def test_the_direct_test_of_a_settled_cause_leads_where_it_costs_least(
    monkeypatch: pytest.MonkeyPatch, hours: float, leads: bool
) -> None:
    """Ten more shifts, of 0.7 h, would tell something, the direct test nothing."""
    judged = next_test._judged

    def informed(standing: Standing, test: NextTest) -> NextTest:
        told = 0.5 if test.asked.kind == "shifts" else 0.0
        return replace(judged(standing, test), information=told, misleads=0.0)

    monkeypatch.setattr(next_test, "_judged", informed)
    bench = bench_of({"delay_s": 0.16}, np.random.default_rng(1), shifts=40, points=POINTS)
    few = {name: EFFECTS[name] for name in (*DELAY, *MASS)}
    found = diagnose(replace(bench, tests=(TestTerms(FORCE, hours),)), Toy(POINTS), few, pairs=[])
    assert found.verdict.causes == DELAY
    assert found.tests[0].decided
    assert (found.tests[0].name == FORCE) == leads
