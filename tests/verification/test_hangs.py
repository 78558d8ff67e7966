"""Probability of a hang against binomial data of known rates, and against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.result_records import ExpectedTime
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import engage, even_blocks
from dogshape.sim.statistics.expectation import (
    Estimate,
    MixExpectation,
    ShiftResult,
    expect,
    expect_point,
    positive_interval,
    share_over,
)
from dogshape.sim.statistics.hangs import (
    HangPrior,
    PriorSettings,
    interval,
    pool,
    weak_priors,
)
from tests.conftest import Point

REPLICATIONS = 500
SHIFTS = 384
COST = 1.2  #: s, time-out and retraction
ENGAGED = 0.03  #: s
#: Three standard deviations of a coverage of 95 % over 500 replications.
LEAST_COVERAGE = 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / REPLICATIONS)


def _expectation(point: Point, hangs: np.ndarray, shifts: int) -> MixExpectation:
    """Make an expectation over operating points of equal weight with so many hangs each."""
    engaged = ShiftResult(Outcome.ENGAGED, ENGAGED)
    hung = ShiftResult(Outcome.TIMED_OUT, None)
    places = [
        expect_point(point(50 + 10 * place, 469.0), [hung] * k + [engaged] * (shifts - k), 1.0, 0.2)
        for place, k in enumerate(hangs.tolist())
    ]
    return expect([replace(one, point=replace(one.point, weight=1.0)) for one in places])


def _cached(point: Point, rate: float, points: int) -> list[MixExpectation]:
    rng = np.random.default_rng(5)
    shifts, known = SHIFTS // points, dict[tuple[int, ...], MixExpectation]()
    drawn = []
    for _ in range(REPLICATIONS):
        hangs = np.sort(rng.binomial(shifts, rate, size=points))
        key = tuple(hangs.tolist())
        if key not in known:
            known[key] = _expectation(point, hangs, shifts)
        drawn.append(known[key])
    return drawn


@pytest.mark.parametrize("points", [1, 6])
@pytest.mark.parametrize("rate", [0.002, 0.005, 0.05, 0.6])
def test_interval_holds_the_true_rate_in_95_percent(rate: float, points: int, point: Point) -> None:
    ends = [one.hang_interval for one in _cached(point, rate, points)]
    assert np.mean([low <= rate <= high for low, high in ends]) >= LEAST_COVERAGE
    # Not by a wide interval: at most a tenth wider than Clopper and Pearson's, which holds surely.
    exact = [stats.binomtest(k, SHIFTS).proportion_ci() for k in
             np.random.default_rng(5).binomial(SHIFTS, rate, REPLICATIONS).tolist()]  # fmt: skip
    width = np.mean([high - low for low, high in exact])
    assert np.mean([high - low for low, high in ends]) <= 1.1 * width


def test_standard_error_of_the_expectation_covers_rare_hangs(point: Point) -> None:
    """A rate of 0.3 %, 384 shifts, 1.2 s a hang: 3.6 ms, where a third of the draws shows none."""
    rate, truth = 0.003, ENGAGED + COST * 0.003 / 0.997
    drawn = _cached(point, rate, 6)
    scores = [(one.mean - truth) / one.standard_error for one in drawn]
    assert np.mean(np.abs(scores) < 2.0) >= LEAST_COVERAGE
    assert min(one.standard_error for one in drawn) > 1e-3
    shares = [one.hangs / one.shifts for one in drawn]
    old = [COST * math.sqrt(q * (1.0 - q) / SHIFTS) / (1.0 - q) ** 2 for q in shares]
    apart = [abs(ENGAGED + COST * q / (1.0 - q) - truth) for q in shares]
    held = np.mean([gap < 2.0 * error for gap, error in zip(apart, old, strict=True)])
    assert held < 0.75  # the error by the share is 0 where no shift hangs


def test_many_shifts_lead_to_the_share_and_its_binomial_error(point: Point) -> None:
    for share in (0.01, 0.2, 0.6):
        n = 200_000
        one = _expectation(point, np.array([int(share * n)]), n)
        assert one.retries == pytest.approx(COST * share / (1.0 - share), rel=2e-3)
        error = COST / (1.0 - share) ** 2 * math.sqrt(share * (1.0 - share) / n)
        assert one.retries_error == pytest.approx(error, rel=2e-3)


def test_unseen_hangs_have_an_error_and_an_interval(point: Point) -> None:
    one = _expectation(point, np.zeros(6, int), 64)
    low, high = one.hang_interval
    assert 0.0 < low < 1e-4
    assert 0.004 < high < 0.009  # rule of three: 0.8 %
    assert one.retries_error > 1e-3
    assert one.engaged_mean == pytest.approx(ENGAGED)
    assert one.mean == pytest.approx(one.engaged_mean + one.retries)
    assert one.standard_error == pytest.approx(math.hypot(one.engaged_error, one.retries_error))


def test_posterior_of_one_part_is_conjugate() -> None:
    """Without a second part the posterior is Beta(a + k, b + n - k)."""
    found = HangPrior(rate=0.02, strength=50.0, blocked_share=1e-12).posterior(3, 100)
    exact = stats.beta(1.0 + 3, 49.0 + 97)
    assert found.mean == pytest.approx(exact.mean())
    assert found.variance == pytest.approx(exact.var())
    ends = interval(float(exact.mean()), float(exact.var()))
    assert ends == pytest.approx(exact.ppf([0.025, 0.975]))


def test_blocking_at_one_point_is_not_drawn_to_the_rare_rate() -> None:
    """Of 64 shifts 38 block: 59 % stay 59 %, whatever the other designs do."""
    rare = HangPrior(rate=0.003, strength=300.0, blocked_share=0.04)
    assert rare.posterior(38, 64).mean == pytest.approx(38.5 / 65.0)
    assert rare.posterior(1, 64).mean < 0.01


def test_points_together_are_one_point_with_all_shifts(point: Point) -> None:
    """The prior is spread over the points: six of 64 shifts say what one of 384 does."""
    many = _expectation(point, np.zeros(6, int), 64)
    single = _expectation(point, np.zeros(1, int), 384)
    assert many.hang_probability == pytest.approx(single.hang_probability, rel=0.1)
    assert many.retries_error == pytest.approx(single.retries_error, rel=0.15)


def test_pool_of_a_study_finds_the_rate_of_its_designs() -> None:
    rng, shifts = np.random.default_rng(3), np.full((60, 6), 64)
    hangs = rng.binomial(64, 0.003, size=shifts.shape)
    priors = pool(np.stack([hangs, shifts], axis=2))
    share = hangs.sum() / shifts.sum()
    assert np.mean([one.rate for one in priors]) == pytest.approx(share, rel=0.2)
    # Designs of one rate: its share counts for more than their own shifts at a point.
    assert priors[0].strength > 64
    blocked = hangs.copy()
    blocked[:10, 2] = rng.binomial(64, 0.6, size=10)
    assert pool(np.stack([blocked, shifts], axis=2))[2].rate < 0.02
    unseen = pool(np.stack([np.zeros_like(hangs), shifts], axis=2))
    assert 0.0 < unseen[0].rate < 1e-3


def test_one_hang_neither_sinks_nor_an_unseen_one_makes_a_design() -> None:
    """Of designs with one rate the order by posterior is nearer to the truth than by share."""
    rng, rate = np.random.default_rng(4), 0.003
    shifts = np.full((40, 6), 64)
    hangs = rng.binomial(64, rate, size=shifts.shape)
    priors = pool(np.stack([hangs, shifts], axis=2))
    pairs = list(zip(priors, range(6), strict=True))
    means = [np.mean([p.posterior(int(row[k]), 64).mean for p, k in pairs]) for row in hangs]
    assert max(means) - min(means) < 0.5 * np.ptp(hangs.mean(axis=1) / 64)
    assert np.abs(np.array(means) - rate).max() < np.abs(hangs.mean(axis=1) / 64 - rate).max()


def test_settings_of_the_prior_decide_it() -> None:
    given = PriorSettings(hangs=1.0, shifts=50.0, blocked_share=0.1)
    (one,) = weak_priors(1, given)
    assert (one.rate, one.strength, one.blocked_share) == (0.02, 50.0, 0.1)
    assert one.posterior(0, 100).mean > weak_priors(1)[0].posterior(0, 100).mean


@pytest.mark.parametrize(("shape", "least"), [(math.inf, 0.95), (2.0, 0.88), (0.7, 0.88)])
def test_pool_covers_designs_whose_rates_scatter(shape: float, least: float) -> None:
    """Designs hang Gamma(shape) times as often as the mean: alike, or scattered by 70 and 120 %.

    A fitted prior leaves out its own error, so that where rates scatter about 90 % are held.
    """
    rng, rates = np.random.default_rng(2), np.array([0.003, 0.006, 0.006, 0.0, 0.0, 0.005])
    shifts, held, widths = np.full((40, 6), 64), list[bool](), list[float]()
    for _ in range(20):
        factors = np.ones(40) if shape == math.inf else rng.gamma(shape, 1.0 / shape, size=40)
        true = factors[:, None] * rates
        hangs = rng.binomial(64, true)
        priors = pool(np.stack([hangs, shifts], axis=2))
        for row, share in zip(hangs.tolist(), true.mean(axis=1).tolist(), strict=True):
            found = [p.posterior(k, 64) for p, k in zip(priors, row, strict=True)]
            mean = sum(one.mean for one in found) / 6
            low, high = interval(mean, sum(one.variance for one in found) / 36)
            held.append(low <= share <= high)
            widths.append(high - low)
    assert np.mean(held) > least
    # Narrower than by the own shifts of a design, of which a hang or two are in 384.
    alone = stats.binomtest(1, 384).proportion_ci()
    assert np.mean(widths) < 0.8 * (alone.high - alone.low)


@pytest.mark.parametrize(("misses", "shifts"), [(0, 384), (1, 384), (40, 384), (3, 12)])
def test_share_over_a_mix_is_the_hang_probability_of_as_many_misses(
    misses: int, shifts: int, point: Point
) -> None:
    """Of a time-out a miss is a hang; at one point the posterior is that by quadrature."""
    expectation = _expectation(point, np.array([misses]), shifts)
    share = share_over([3.0], [(misses, shifts)])
    assert share.value == pytest.approx(1.0 - expectation.hang_probability, rel=1e-12)
    settings, q = PriorSettings(), (np.arange(200_000) + 0.5) / 200_000
    rare = stats.beta(settings.hangs, settings.shifts - settings.hangs).pdf(q)
    prior = (1.0 - settings.blocked_share) * rare + settings.blocked_share * stats.beta(
        0.5, 0.5
    ).pdf(q)
    weights = prior * q**misses * (1.0 - q) ** (shifts - misses)
    weights /= weights.sum()
    mean = float(weights @ q)
    assert 1.0 - share.value == pytest.approx(mean, rel=2e-2)
    assert share.standard_error**2 == pytest.approx(float(weights @ (q - mean) ** 2), rel=2e-2)


def test_share_over_many_shifts_is_the_share_with_its_binomial_error() -> None:
    share = share_over([1.0, 3.0], [(2_000, 10_000), (500, 10_000)])
    assert share.value == pytest.approx(1.0 - (0.2 + 3.0 * 0.05) / 4.0, rel=1e-3)
    variance = (0.2 * 0.8 + 9.0 * 0.05 * 0.95) / 16.0 / 10_000
    assert share.standard_error == pytest.approx(math.sqrt(variance), rel=1e-2)
    assert math.isnan(share_over([1.0], [(0, 0)]).value)
    assert share_over([1.0, 1.0], [(0, 20), (0, 0)]) == share_over([1.0], [(0, 20)])


def test_interval_of_a_sum_of_positive_parts() -> None:
    """Of one part it is Gamma's, of an exact one its value, of two small errors the normal one."""
    low, high = positive_interval(Estimate(15.0, 21.0))
    gamma = stats.gamma((15.0 / 21.0) ** 2, scale=21.0**2 / 15.0)
    assert high == pytest.approx(gamma.ppf(0.975), rel=2e-2)
    assert 0.0 < low == pytest.approx(gamma.ppf(0.025), rel=5e-2)
    assert positive_interval(Estimate(60.0, 0.0)) == (60.0, 60.0)
    ends = positive_interval(Estimate(60.0, 0.3), Estimate(40.0, 0.4))
    assert ends == pytest.approx((100.0 - 1.96 * 0.5, 100.0 + 1.96 * 0.5), rel=1e-3)
    assert all(map(math.isnan, positive_interval(Estimate(60.0, math.nan))))
    lower, upper = positive_interval(Estimate(15.0, 21.0), share=0.68)
    assert low < lower < upper < high


@pytest.mark.parametrize("static_friction", [0.12, 0.3])
def test_interval_of_few_angles_holds_the_time_of_many(static_friction: float) -> None:
    """Motorcycle, 0 and 1 % of hangs: 200 random starts of 4, 8, 16 and 48 of 192 angles."""
    study = load_study("motorcycle", [f"contact.static_friction={static_friction}"]).search_setup
    many = 192
    shifts = []
    for block in even_blocks(study.clutch, study.points, many, 7):
        results = [engage(block.clutch, block.point, angle) for angle in block.angles]
        shifts.append([ShiftResult(one.outcome, one.shift_time) for one in results])
    weights = np.array([point.weight for point in study.points])
    hung = np.array([sum(shift.shift_time is None for shift in row) for row in shifts]) / many
    engaged = [np.mean([shift.shift_time or 0.0 for shift in row]) for row in shifts] / (1.0 - hung)
    cost = study.clutch.timeout + study.retraction
    truth = float(weights @ (engaged + cost * hung / (1.0 - hung))) / weights.sum()
    rng = np.random.default_rng(1)
    for angles in (4, 8, 16, 48):
        ends = []
        for _ in range(200):
            starts = rng.integers(many // angles, size=len(shifts)).tolist()
            few = [row[start :: many // angles] for start, row in zip(starts, shifts, strict=True)]
            pairs = zip(study.points, few, strict=True)
            mean = expect(
                [expect_point(at, row, study.clutch.timeout, study.retraction) for at, row in pairs]
            )
            ends.append([mean.interval(share) for share in (0.68, 0.9, 0.95)])
            assert mean.interval()[0] > 0.0
        held = np.mean([[low <= truth <= high for low, high in row] for row in ends], axis=0)
        assert held[1] >= 0.9 - 3.0 * math.sqrt(0.9 * 0.1 / 200)
        assert held[2] >= 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 200)
        assert held[0] >= 0.68 - 3.0 * math.sqrt(0.68 * 0.32 / 200)


@pytest.mark.parametrize(("shifts", "judged"), [(4, False), (16, False), (64, True)])
def test_few_shifts_do_not_judge_hangs(shifts: int, judged: bool, point: Point) -> None:
    """Of six points without a hang: 15 ± 20, 5 ± 7 and 1.5 ± 2 ms beside 30 ms."""
    record = ExpectedTime.of(_expectation(point, np.zeros(6, int), shifts))
    assert record.judges_hangs is judged
