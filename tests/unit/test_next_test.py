"""Advice on the next bench test: hand-made fits, and outcomes in closed form."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from dogshape.bench.flight_marks import FORCES, SIZE, WAYS
from dogshape.bench.stand_file import Measured, TestTerms
from dogshape.diagnosis.inference.outcome import (
    SETUP_HOURS,
    SHIFT_HOURS,
    TRACING_HOURS,
    Densities,
    NextTest,
    PredictedOutcome,
    smooth_draws,
)
from dogshape.diagnosis.next_test import (
    FURTHER_SHIFTS,
    TRACED_SHIFTS,
    imitator_odds,
    rank_support,
    rank_tests,
    update_posterior,
)
from dogshape.diagnosis.terms import NONE, UNKNOWN, Hypothesis
from dogshape.sim.shift.actuation import ForceProfile
from tests.fits import BENCH, CELLS, POINTS, SETTINGS, UNTRACED, Array, diagnosis_of, fit_of
from tests.toy import EFFECTS

DELAY, LAG = ("actuation_delay",), ("actuation_lag",)
FRICTION, DRAG, REVERSED = ("sleeve_friction",), ("drag_torque",), ("reversed_mismatch",)
FORCE = EFFECTS["actuation_delay"].test.name
SPREAD = np.linspace(0.3, 0.7, 64)[:, None]


def _open(**more: Any) -> Any:
    """Delay against drag, which no shift can tell apart."""
    fits = {DELAY: fit_of(DELAY, SPREAD), DRAG: fit_of(DRAG, SPREAD), NONE: fit_of(NONE)}
    return diagnosis_of({DELAY: 0.55, DRAG: 0.43, UNKNOWN: 0.02}, fits, **more)


def _named(tests: tuple[NextTest, ...], name: str) -> NextTest:
    return next(test for test in tests if test.name == name)


def test_a_direct_test_that_reads_a_parameter_settles_the_cause() -> None:
    diagnosis = _open()
    first = rank_tests(diagnosis)[0]
    assert first.name == EFFECTS["drag_torque"].test.name
    # All but the imitators and unknown, 0.02, are settled; a run-down reads none of the delay's.
    real = 0.98 / (1.0 + imitator_odds(SETTINGS))
    assert first.settles == pytest.approx(real, abs=0.03)
    assert first.misleads < 1.0 - real + 0.01
    # The delay is 0.12 to 0.28 s.
    force = _named(rank_tests(diagnosis), FORCE)
    assert force.parameters == ("delay_s",)
    assert update_posterior(diagnosis, force, [0.24])[DELAY] > 0.95
    nothing = update_posterior(diagnosis, force, [0.0])
    assert nothing[DELAY] < 1e-3 < nothing[UNKNOWN]
    assert sum(nothing.values()) == pytest.approx(1.0)


def test_effects_of_one_test_share_its_outcome() -> None:
    """The force over time reads delay and lag: either hypothesis has the other neutral."""
    fits = {DELAY: fit_of(DELAY, SPREAD), LAG: fit_of(LAG, SPREAD)}
    diagnosis = diagnosis_of({DELAY: 0.5, LAG: 0.5}, fits)
    test = _named(rank_tests(diagnosis), FORCE)
    assert test.effects == (*DELAY, *LAG)
    assert test.parameters == ("delay_s", "lag_s")
    lag = EFFECTS[LAG[0]].parameters[0].at(0.5)
    assert update_posterior(diagnosis, test, [0.2, 0.0])[DELAY] > 0.95
    assert update_posterior(diagnosis, test, [np.nan, lag])[LAG] > 0.9


def test_a_direct_test_reads_with_the_error_of_its_instrument() -> None:
    """A push scale of 2 % and 0.5 N reads 50 N, or nothing; a fit without scatter."""
    share = EFFECTS[FRICTION[0]].parameters[0].share(50.0)
    fits = {FRICTION: fit_of(FRICTION, share), DRAG: fit_of(DRAG, SPREAD)}
    diagnosis = diagnosis_of({FRICTION: 0.5, DRAG: 0.5}, fits)
    test = _named(rank_tests(diagnosis), EFFECTS[FRICTION[0]].test.name)
    assert test.outcome is not None
    density = np.exp(test.outcome.log_density(np.array([[48.0], [1.0]])))
    sd = np.hypot(0.02 * 50.0, 0.5)
    assert density[0, 0] == pytest.approx(norm.pdf(48.0, 50.0, sd))
    assert density[1, 1] == pytest.approx(norm.pdf(1.0, 0.0, 0.5))
    # 1 % of the readings of 50 N lie outside 2.576 errors; below them friction is refuted.
    low = 50.0 - norm.ppf(0.995) * sd
    assert test.refutes == f"A reading of friction below {low:.3g} N refutes " + (
        "dry friction of the sliding ring."
    )


def test_wide_priors_make_no_instrument_worse() -> None:
    """Of an unlisted cause alone the range decides what is read."""
    fits = {FRICTION: fit_of(FRICTION), DRAG: fit_of(DRAG)}
    outcomes = []
    for share in (0.0, 1.0):
        diagnosis = diagnosis_of({FRICTION: 0.5, DRAG: 0.5}, fits)
        effect = diagnosis.effects[FRICTION[0]]
        widened = effect.parameters[0].widened(share, upper=True)
        diagnosis.effects[FRICTION[0]] = replace(effect, parameters=(widened,))
        outcome = _named(rank_tests(diagnosis), effect.test.name).outcome
        assert outcome is not None
        outcomes.append(outcome.log_density(np.array([[24.0], [0.2]])))
    assert outcomes[0][:, :2].tolist() == outcomes[1][:, :2].tolist()
    assert outcomes[0][0, 2] != outcomes[1][0, 2]


def test_further_shifts_tell_means_apart_as_two_normal_densities() -> None:
    """Mean of n shifts at a point without any so far: sd^2/n and the error of the simulation."""
    fits = {DELAY: fit_of(DELAY, time=0.3), DRAG: fit_of(DRAG, time=0.32)}
    seen = SimpleNamespace(count=np.zeros(CELLS), mean=np.zeros(CELLS))
    diagnosis = diagnosis_of({DELAY: 0.5, DRAG: 0.5}, fits, observed=seen)
    ten = next(test for test in rank_tests(diagnosis) if test.shifts == min(FURTHER_SHIFTS))
    found = update_posterior(diagnosis, ten, [0.303, np.nan])
    width = np.hypot(0.02 / (10 * 0.98) ** 0.5, 1e-3)
    odds = norm.pdf(0.303, 0.3, width) / norm.pdf(0.303, 0.32, width)
    assert found[DELAY] / found[DRAG] == pytest.approx(odds, rel=1e-6)
    assert update_posterior(diagnosis, ten, [0.303])[DELAY] == pytest.approx(found[DELAY])
    assert ten.hours == pytest.approx(SETUP_HOURS + 10 * SHIFT_HOURS)


def _flying(hypothesis: Hypothesis, values: Array, profile: ForceProfile, **_: Any) -> Any:
    """A lag bends the marks that a delay moves all alike."""
    shares = np.array([*(np.cbrt(WAYS) * 0.3), *FORCES])
    late = values @ ([1.0] if hypothesis == DELAY else [0.0] * values.shape[1])
    bent = values @ ([0.7] if hypothesis == LAG else [0.0] * values.shape[1])
    times = profile.rise * shares + late[:, None] + bent[:, None] * np.sqrt(shares)
    return SimpleNamespace(times=times, error=1e-4 + 0.0 * times, creep=0.0 * times)


def _delay_or_lag(**more: Any) -> Any:
    """Both move all times by 80 ms, with errors of some ms."""
    shares = {
        DELAY: [EFFECTS[DELAY[0]].parameters[0].share(v) for v in np.linspace(0.075, 0.085, 64)],
        LAG: [EFFECTS[LAG[0]].parameters[0].share(v) for v in np.linspace(0.11, 0.12, 64)],
    }
    fits = {h: fit_of(h, np.array(rows)[:, None]) for h, rows in shares.items()}
    return diagnosis_of({DELAY: 0.5, LAG: 0.5}, fits, **more)


def test_traces_tell_apart_what_no_time_does() -> None:
    diagnosis = _delay_or_lag(bench=UNTRACED, flights=SimpleNamespace(marks=_flying))
    (test,) = (t for t in rank_tests(diagnosis) if t.kind == "traces")
    assert test.hours == pytest.approx(SETUP_HOURS + TRACING_HOURS + SHIFT_HOURS * TRACED_SHIFTS)
    assert test.point is not None
    assert test.point[1] == 235.2
    assert test.settles > 0.9
    assert test.misleads < 0.05
    # Marks of a true delay, with the force that acts or the nominal one.
    still = _flying(NONE, np.zeros((1, 0)), POINTS[0].profile).times[0]
    for nominal in (0.0, 0.08):
        moved = still + np.where(np.arange(SIZE) < len(WAYS), 0.08, nominal)
        assert update_posterior(diagnosis, test, moved.tolist())[DELAY] > 0.95
        moved[[0, 7]] = np.nan
        assert update_posterior(diagnosis, test, moved.tolist())[DELAY] > 0.95
    odd = still + 0.08 * np.sin(3.0 * np.arange(SIZE))
    assert update_posterior(diagnosis, test, odd.tolist())[UNKNOWN] > 0.95


def test_traces_lead_where_unknown_does_at_the_largest_residual() -> None:
    seen = SimpleNamespace(count=np.full(CELLS, 10.0), mean=0.3 + 0.2 * (np.arange(CELLS) == 9))
    chances, fits = {UNKNOWN: 0.9, NONE: 0.1}, {NONE: fit_of(NONE)}
    flights = SimpleNamespace(marks=_flying)
    diagnosis = diagnosis_of(chances, fits, UNTRACED, observed=seen, flights=flights)
    first = rank_tests(diagnosis)[0]
    assert (first.kind, first.cell) == ("traces", 9)
    assert update_posterior(diagnosis, first, []) == diagnosis.posterior
    blind = replace(UNTRACED, tests=(TestTerms(name="traces", possible=False),))
    diagnosis.bench = blind
    assert "traces" not in {test.kind for test in rank_tests(diagnosis)}


def _gain(monkeypatch: pytest.MonkeyPatch, gains: dict[str, float]) -> None:
    """Give tests of some names or kinds a gain."""

    def judged(diagnosis: Any, test: NextTest, seed: int = 1, draw_count: int = 1) -> NextTest:
        return replace(test, gain=gains.get(test.name, gains.get(test.kind, 0.0)))

    monkeypatch.setattr("dogshape.diagnosis.next_test._add_worth", judged)


@pytest.mark.parametrize(("gain", "kind"), [(0.35, "direct"), (0.42, "direct"), (0.49, "shifts")])
def test_gain_per_hour_ranks_tests_and_hours_equal_ones(
    monkeypatch: pytest.MonkeyPatch, gain: float, kind: str
) -> None:
    """Shifts of 0.7 h, and a run-down of 0.5 h that gains 0.3."""
    name = EFFECTS["drag_torque"].test.name
    _gain(monkeypatch, {"shifts": gain, name: 0.3})
    diagnosis = _open(bench=replace(BENCH, tests=(TestTerms(name=name, hours=0.5),)))
    first = rank_tests(diagnosis)[0]
    assert first.kind == kind


BOTH = (*DELAY, *FRICTION)
SLOW_PUSH = EFFECTS[FRICTION[0]].test.name


def test_the_effect_that_a_rival_replaces_at_least_cost_is_the_least_supported() -> None:
    posterior = {
        BOTH: 0.85,
        (*DELAY, *DRAG): 0.08,  # drag in the place of friction
        FRICTION: 0.04,  # delay removed
        DRAG: 0.02,  # shares no effect
        (*DELAY, *DRAG, *LAG): 0.005,  # larger
        UNKNOWN: 0.005,
    }
    assert rank_support(posterior, BOTH) == [*FRICTION, *DELAY]
    assert rank_support({BOTH: 0.9, DELAY: 0.04, FRICTION: 0.05}, BOTH) == [*DELAY, *FRICTION]
    assert rank_support({DELAY: 0.9, NONE: 0.1}, DELAY) == [*DELAY]


@pytest.mark.parametrize(("probability", "gain"), [(0.9, 0.6), (0.7, 0.02)])
def test_the_least_supported_effect_is_tested_where_a_set_is_named_or_nothing_gains(
    monkeypatch: pytest.MonkeyPatch, probability: float, gain: float
) -> None:
    """However many hours its test takes; the other effect's where it is impossible."""
    _gain(monkeypatch, {"shifts": gain})
    fits = {BOTH: fit_of(BOTH), DELAY: fit_of(DELAY)}
    posterior = {BOTH: probability, DELAY: 1.0 - probability}
    bench = replace(BENCH, tests=(TestTerms(name=SLOW_PUSH, hours=9.0),))
    first = rank_tests(diagnosis_of(posterior, fits, bench=bench))[0]
    assert first.name == SLOW_PUSH
    assert "A reading of friction below" in first.refutes
    assert first.refutes in first.why
    assert first.to_dict()["refutes"] == first.refutes
    bench = replace(BENCH, tests=(TestTerms(name=SLOW_PUSH, possible=False),))
    assert rank_tests(diagnosis_of(posterior, fits, bench=bench))[0].name == FORCE


def test_each_kind_of_test_has_a_result_that_refutes_the_leading_hypothesis() -> None:
    tests = rank_tests(_open())
    run_down = _named(tests, EFFECTS[DRAG[0]].test.name)
    # Without drag a torque wrench reads 0 N m to 0.02 N m.
    drag = f"{norm.ppf(0.995) * 0.02:.3g}"
    end = "refutes dead time of the actuation as the whole cause."
    assert run_down.refutes == f"A reading of drag above {drag} N m {end}"
    ten = next(test for test in tests if test.shifts == min(FURTHER_SHIFTS))
    assert re.fullmatch(
        r"A mean time of the 10 shifts outside 2\d\d to 3\d\d ms refutes "
        r"dead time of the actuation\.",
        ten.refutes,
    )
    spline = ("spline_friction",)
    fits = {spline: fit_of(spline), REVERSED: fit_of(REVERSED)}
    tests = rank_tests(diagnosis_of({spline: 0.6, REVERSED: 0.4}, fits))
    words = EFFECTS[spline[0]].plain
    assert _named(tests, EFFECTS[REVERSED[0]].test.name).refutes == (
        f"The presence of reversed sense of rotation refutes {words} as the whole cause."
    )
    # In the middle of its prior, 0.0548, read to 6 % and 0.005.
    low = 0.0548 - norm.ppf(0.995) * np.hypot(0.06 * 0.0548, 0.005)
    assert _named(tests, EFFECTS[spline[0]].test.name).refutes == (
        f"A reading of spline friction below {low:.3g} refutes {words}."
    )
    tests = rank_tests(diagnosis_of({REVERSED: 0.6, spline: 0.4}, fits))
    assert _named(tests, EFFECTS[REVERSED[0]].test.name).refutes == (
        "The absence of reversed sense of rotation refutes reversed sense of rotation."
    )
    diagnosis = diagnosis_of({NONE: 0.6, DRAG: 0.4}, {NONE: fit_of(NONE), DRAG: fit_of(DRAG)})
    (test,) = (t for t in rank_tests(diagnosis) if t.kind == "direct")
    assert test.refutes == f"A reading of drag above {drag} N m refutes that no effect acts."


def test_a_question_about_the_record_settles_by_its_answers() -> None:
    """Times start with the command (0.6: a delay) or the force (0.4: three effects, so open)."""
    three = (*DRAG, *LAG, *FRICTION)  # never named, however probable
    command, force = {DELAY: 0.9, DRAG: 0.1}, {DELAY: 0.0, three: 0.9, UNKNOWN: 0.1}
    answers = (("command", 0.6, command, "effect"), ("force", 0.4, force, "ambiguous"))
    readings = tuple(
        SimpleNamespace(
            key="time_zero", value=value, probability=p, posterior=after,
            verdict=SimpleNamespace(kind=kind),
        )
        for value, p, after, kind in answers
    )  # fmt: skip
    diagnosis = _open(record_meanings=readings)
    (test,) = (t for t in rank_tests(diagnosis) if t.kind == "record")
    assert (test.settles, test.misleads) == pytest.approx((0.54, 0.06))
    # From 0.54 to 0.9 by either answer, of the set of three from 0.36.
    assert test.gain == pytest.approx(0.6 * (0.9 - 0.54) + 0.4 * (0.9 - 0.36))
    assert test.refutes == "The answer 'force' refutes dead time of the actuation."
    mixed = {h: 0.6 * command.get(h, 0.0) + 0.4 * force.get(h, 0.0) for h in (*force, DRAG)}
    every = mixed, command, force
    before, first, second = (-sum(p * np.log(p) for p in one.values() if p) for one in every)
    assert test.information == pytest.approx(before - 0.6 * first - 0.4 * second)
    assert update_posterior(diagnosis, test, "force") == force


def test_the_menu_has_the_hours_of_the_stand_and_no_test_that_is_made_or_impossible() -> None:
    terms = TestTerms(name=FORCE, hours=7.0), TestTerms(name="more shifts", hours=3.0)
    found = rank_tests(_open(bench=replace(BENCH, tests=terms)))
    ten = next(test for test in found if test.shifts == 10)
    assert (_named(found, FORCE).hours, ten.hours) == (7.0, pytest.approx(3.0 + 10 * SHIFT_HOURS))
    measured = (Measured(effect="actuation_delay", value=0.1, standard_error=0.01),)
    assert FORCE not in {t.name for t in rank_tests(_open(bench=replace(BENCH, measured=measured)))}
    shifts = replace(BENCH, tests=(TestTerms(name="more shifts", possible=False),))
    assert {test.kind for test in rank_tests(_open(bench=shifts))} == {"direct"}


MASS: Hypothesis = ("moving_mass",)
ODDS = 0.15 * 0.5 / 0.85


def _normal(means: dict[Hypothesis, float], sd: float = 1.0) -> PredictedOutcome:
    """Densities of one value, one of each hypothesis; unknown lies far off."""
    every = means | {UNKNOWN: 1e3}
    one = {
        h: Densities(np.ones(1), np.array([[m]]), np.array([[[sd**2]]])) for h, m in every.items()
    }
    return PredictedOutcome.of(one, lambda _: False)


def _before(*chances: float) -> np.ndarray:
    return np.array([*chances, 1e-12]) / (sum(chances) + 1e-12)


@pytest.mark.parametrize(("apart", "chance"), [(0.5, 0.5), (2.0, 0.5), (3.0, 0.2), (6.0, 0.7)])
def test_information_and_chances_of_two_normal_densities(apart: float, chance: float) -> None:
    """Mutual information by quadrature; the truth is named where its odds exceed 4 : 1."""
    outcome = _normal({LAG: 0.0, MASS: apart})
    chances = {0.0: chance, apart: 1.0 - chance}

    def gain(y: float) -> float:
        parts = [p * norm.pdf(y, m) for m, p in chances.items()]
        both = zip(parts, chances.values(), strict=True)
        return float(sum(part * np.log(part / p / sum(parts)) for part, p in both))

    information = quad(gain, -8.0, apart + 8.0, limit=200)[0]
    # Log odds of y, apart^2/2 - y apart + ln(p/(1 - p)), exceed ln 4 below this point.
    first, second = (
        apart / 2.0 + sign * (np.log(chance / (1.0 - chance)) * sign - np.log(4.0)) / apart
        for sign in (1.0, -1.0)
    )
    right = chance * norm.cdf(first) + (1.0 - chance) * norm.sf(second, apart)
    wrong = chance * norm.sf(second) + (1.0 - chance) * norm.cdf(first, apart)
    # The answer changes where the odds are even.
    even = apart / 2.0 + np.log(chance / (1.0 - chance)) / apart
    first_right, first_wrong = norm.cdf(even), norm.cdf(even, apart)
    share = chance * first_right + (1.0 - chance) * first_wrong
    gained = chance * first_right + (1.0 - chance) * (1.0 - first_wrong)
    gained -= chance * share + (1.0 - chance) * (1.0 - share)
    before = _before(*chances.values())
    found = np.array([outcome.worth(before, 0.0, SETTINGS, k) for k in range(100)])
    mean, error = found.mean(axis=0), 4.0 * found.std(axis=0) / np.sqrt(len(found))
    exact = [information, gained, right, wrong]
    assert abs(mean - exact) == pytest.approx(0.0, abs=float(max(error)))
    assert max(error) < 0.02


def test_a_perfect_test_of_an_even_pair_gains_half_and_a_useless_test_nothing() -> None:
    for apart, gain in ((0.0, 0.0), (60.0, 0.5)):
        worth = _normal({LAG: 0.0, MASS: apart}).worth(_before(0.5, 0.5), 0.0, SETTINGS)
        assert worth.gain == pytest.approx(gain, abs=1e-9)


def test_a_useless_test_inherits_nothing_from_the_leader() -> None:
    """A named leader stays named with or without the test, right or wrong."""
    worth = _normal({LAG: 0.0, MASS: 0.0}).worth(_before(0.9, 0.1), 0.0, SETTINGS)
    assert worth == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-9)


@given(
    probabilities=arrays(float, 4, elements=floats(0.01, 1.0)),
    means=arrays(float, 4, elements=floats(-3.0, 3.0)),
    odds=floats(0.0, 0.3),
)
def test_no_test_loses_in_expectation(probabilities: Array, means: Array, odds: float) -> None:
    """Gain by the law of total probability, with imitators too; at most that of a perfect test."""
    hypotheses = (LAG, MASS, DRAG, UNKNOWN)
    parts = {
        h: Densities(np.ones(1), np.array([[mean]]), np.ones((1, 1, 1)))
        for h, mean in zip(hypotheses, means, strict=True)
    }
    outcome = PredictedOutcome.of(parts, lambda h: h == LAG)
    before = probabilities / probabilities.sum()
    gain = outcome.worth(before, odds, SETTINGS).gain
    assert 0.0 <= gain <= 1.0 - 1.0 / 4.0


def test_a_set_of_three_is_no_settled_cause() -> None:
    for causes, settles in ((LAG, 0.6), ((*DRAG, *LAG, *FRICTION), 0.0)):
        outcome = _normal({causes: 0.0, MASS: 9.0})
        worth = outcome.worth(_before(0.6, 0.4), 0.0, SETTINGS)
        assert worth[1:] == pytest.approx((0.48, settles + 0.4, 0.0), abs=1e-3)


def test_the_interval_of_a_mixture_leaves_its_share_outside() -> None:
    parts = {
        LAG: Densities(np.array([0.5, 0.5]), np.array([[0.0], [9.0]]), np.ones((2, 1, 1))),
        UNKNOWN: Densities(np.ones(1), np.array([[99.0]]), np.ones((1, 1, 1))),
    }
    low, high = PredictedOutcome.of(parts, lambda _: True).interval(LAG, 0, 0.01)
    # Half of each density: 1 % beyond its outer end.
    assert (low, high) == pytest.approx((norm.ppf(0.01), 9.0 + norm.ppf(0.99)), abs=1e-6)


def test_few_draws_give_the_density_of_many() -> None:
    """Draws that agree stay sharp, however far others of the same hypothesis lie."""
    generator, still = np.random.default_rng(3), np.zeros((64, 2))
    draws, more = (generator.normal(size=(n, 2)) @ [[1.0, 0.6], [0.0, 0.5]] for n in (64, 2000))
    error = np.tile(0.01 * np.eye(2), (64, 1, 1))
    rows = {LAG: draws, MASS: still, DRAG: np.vstack([still[:32], 9.0 + draws[:32]])}
    found = PredictedOutcome.of(
        {h: smooth_draws(one, error) for h, one in rows.items()}, lambda _: True
    )
    exact = multivariate_normal(cov=np.array([[1.01, 0.6], [0.6, 0.62]])).logpdf(more).mean()
    assert found.log_density(more)[:, 0].mean() == pytest.approx(exact, abs=0.2)
    _, alone, half = found.log_density(np.zeros((1, 2)))[0]
    assert alone - half == pytest.approx(np.log(2.0))


def test_densities_are_those_of_a_mixture_and_draws_follow_them() -> None:
    parts = {
        LAG: Densities(
            np.array([0.25, 0.75]), np.array([[0.0], [4.0]]), np.array([[[1.0]], [[0.25]]])
        ),
        UNKNOWN: Densities(np.ones(1), np.array([[9.0]]), np.array([[[1.0]]])),
    }
    outcome = PredictedOutcome.of(parts, lambda _: True)
    assert outcome.is_read.tolist() == [True, False]
    density = np.exp(outcome.log_density(np.array([[3.0]])))[0]
    assert density[0] == pytest.approx(0.25 * norm.pdf(3.0) + 0.75 * norm.pdf(3.0, 4.0, 0.5))
    drawn = outcome.draw(np.repeat([0, 1], 20000), np.random.default_rng(1))[:, 0]
    assert drawn[:20000].mean() == pytest.approx(3.0, abs=0.06)
    assert drawn[:20000].var() == pytest.approx(0.25 * (1.0 + 9.0) + 0.75 * (0.25 + 1.0), rel=0.06)
    assert drawn[20000:].min() > 4.0


def _reading() -> PredictedOutcome:
    """A direct test of the lag: 0.7 of its range, or nothing; unknown nothing, half, or 0.7."""
    small = np.array([[[0.0025]]])
    parts = {
        LAG: Densities(np.ones(1), np.array([[0.7]]), small),
        MASS: Densities(np.ones(1), np.array([[0.0]]), small),
        UNKNOWN: Densities(np.array([0.5, 0.5]), np.array([[0.0], [0.7]]), np.repeat(small, 2, 0)),
    }
    return PredictedOutcome.of(parts, {"actuation_lag"}.intersection)


def test_a_negative_reading_does_not_hand_its_probability_to_the_runner_up() -> None:
    """A lag of 0.96 is not found: without imitators the mass would be named."""
    read, before = _reading(), _before(0.96, 0.04)
    log = read.log_density(np.array([[0.0]]))
    assert read.update(before, log, 0.0)[0, 1] > 0.99
    lag, mass, unknown = read.update(before, log, ODDS)[0]
    # Odds: half of the lag's imitator to the mass.
    assert unknown / mass == pytest.approx(0.5 * 0.96 * ODDS / (1.0 + ODDS) / 0.04, rel=1e-4)
    assert (lag, mass) < (1e-6, 0.6)


def test_an_imitator_counts_with_its_hypothesis_until_an_outcome_tells_them_apart() -> None:
    read, before = _reading(), _before(0.7, 0.3)
    same = replace(read, mean=0.0 * read.mean)
    assert same.update(before, same.log_density(np.zeros((1, 1))), ODDS)[0] == pytest.approx(before)
    assert read.update(before, read.log_density(np.array([[0.7]])), ODDS)[0, 0] > 0.9


def test_a_value_that_is_not_shown_does_not_count() -> None:
    """Two values that err together: their difference tells all, the second alone little."""
    whole = np.array([[[1.0, 0.99], [0.99, 1.0]]])
    parts = {
        LAG: Densities(np.ones(1), np.array([[0.0, 0.0]]), whole),
        MASS: Densities(np.ones(1), np.array([[0.0, 1.0]]), whole),
        UNKNOWN: Densities(np.ones(1), np.full((1, 2), 1e3), whole),
    }
    both = PredictedOutcome.of(parts, lambda _: False)
    assert both.update(_before(0.5, 0.5), both.log_density(np.array([[3.0, 3.0]])), 0)[0, 0] > 0.999
    second = both.select(np.array([False, True]))
    after = second.update(_before(0.5, 0.5), second.log_density(np.array([[3.0]])), 0.0)[0]
    assert after[1] / after[0] == pytest.approx(np.exp(2.5))
