"""Probabilities that hold what they say, on data drawn as the likelihood says that data come about.

Ranks of true values are uniform, and intervals and probabilities hit as often as they say (Talts et
al. 2018, simulation-based calibration). The predictive p-value of a hypothesis without parameters
would be uniform; parameters fitted to the same data, and late shifts said of points that have none,
make it conservative (Meng 1994), so that only too many small values are a fault.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import binom, kstest

import dogshape.diagnosis.inference.evidence as integral
from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.next_test import setting_of
from dogshape.diagnosis.inference.posterior import folding, noise, probabilities
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.likelihood.cell_likelihood import timed
from dogshape.diagnosis.likelihood.signature import metric_of
from dogshape.diagnosis.prediction.hypotheses import NONE, Space, spaces_for
from dogshape.diagnosis.prediction.prediction import Array, Hypothesis, Prediction
from tests.declared import Declared, drawn, problem_of
from tests.toy import EFFECTS, bench_of, points_of

POINTS = points_of((235.2, 641.5))[::2]
TOY = Declared(POINTS)
NOTHING = np.zeros((1, 0))
TRIED: tuple[Hypothesis, ...] = (
    NONE,
    ("actuation_delay",),
    ("force_scale",),
    ("mismatch_speed",),
    ("sleeve_friction",),
)
SURE = 0.999  #: of the bounds
SHIFTS = 20  #: of a point where spreads are to be told


def _spaces(hypotheses: tuple[Hypothesis, ...]) -> tuple[Space, ...]:
    setting = setting_of(bench_of({}, np.random.default_rng(0), points=POINTS))
    return spaces_for(hypotheses, EFFECTS, setting)


def _within(hits: int, count: int, share: float) -> bool:
    """Whether so many hits of a share are no rarer than two in a thousand."""
    low, high = binom.ppf([1.0 - SURE, SURE], count, share)
    return bool(low <= hits <= high)


@pytest.mark.parametrize("single", [False, True], ids=["means", "singles"])
def test_the_p_value_of_what_made_the_data_is_seldom_small(single: bool) -> None:
    (space,) = _spaces((NONE,))
    found = []
    for seed in range(100):
        bench = drawn(TOY, NONE, NOTHING, np.random.default_rng(seed), single=single)
        problem = problem_of(TOY, bench)
        found.append(p_value(problem, evidence(problem, space)))
    small = int((np.array(found) < 0.05).sum())
    assert small <= binom.ppf(SURE, len(found), 0.05)
    # Not so conservative that nothing would ever be found.
    assert 0.4 < np.mean(found) < 0.7


def test_a_fitted_effect_has_a_small_p_value_no_more_often() -> None:
    (space,) = _spaces((("sleeve_friction",),))
    found = []
    for seed in range(40):
        generator = np.random.default_rng(seed)
        values = space.values(generator.random((1, 1)))
        problem = problem_of(TOY, drawn(TOY, space.hypothesis, values, generator))
        found.append(p_value(problem, evidence(problem, space)))
    assert (np.array(found) < 0.05).sum() <= binom.ppf(SURE, len(found), 0.05)


def _made(stretch: float, offset: float) -> Bench:
    """Return single shifts at even shares of what is said, stretched, and moved to either side.

    ``offset`` is in standard errors of their mean.
    """
    points = points_of()
    said = problem_of(
        Declared(points), bench_of({}, np.random.default_rng(0), points=points)
    ).predictions(NONE, NOTHING)
    even = np.sqrt(3.0) * (2.0 * (np.arange(SHIFTS) + 0.5) / SHIFTS - 1.0)
    readings: list[Reading] = []
    for cell, point in enumerate(points):
        error = np.hypot(said.sd[cell, 0] / np.sqrt(SHIFTS), said.error[cell, 0])
        middle = said.mean[cell, 0] + offset * error * (-1.0) ** cell
        for time in middle + stretch * said.sd[cell, 0] * even:
            readings.append(Reading(len(readings) + 2, point, 1, float(time), True))
    return replace(bench_of({}, np.random.default_rng(0)), cells=gather(readings))


@pytest.mark.parametrize(
    ("stretch", "offset"), [(2.0, 0.0), (1.0, 3.0), (0.4, 0.0)], ids=["wide", "off", "narrow"]
)
def test_spreads_and_means_each_make_the_joint_p_value_small(stretch: float, offset: float) -> None:
    toy = Declared(points_of())
    problem, (space,) = problem_of(toy, _made(stretch, offset)), _spaces((NONE,))
    assert p_value(problem, evidence(problem, space)) < 1e-3
    usual = problem_of(toy, _made(1.0, 0.0))
    assert p_value(usual, evidence(usual, space)) > 0.5


class _Reliable(Declared):
    """The toy whose shifts engage in 99 % of all tries."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        said = super().at(hypothesis, values, cell)
        one = np.ones(len(values))
        return replace(said, engaged=0.99 * one, engaged_error=0.002 * one)


def test_points_where_a_shift_failed_are_judged_among_all() -> None:
    """By themselves they are the worst of them: half of all sets then had a p-value below 0.2."""
    toy, (space,) = _Reliable(points_of()), _spaces((NONE,))
    found = []
    for seed in range(40):
        problem = problem_of(toy, drawn(toy, NONE, NOTHING, np.random.default_rng(seed)))
        found.append(p_value(problem, evidence(problem, space)))
    assert (np.array(found) < 0.2).sum() <= binom.ppf(SURE, len(found), 0.2)
    assert np.mean(found) > 0.4


def test_late_shifts_that_are_found_count_once() -> None:
    """Ten timely single shifts tell of the share of late ones by their number alone."""
    toy = Declared(points_of()[20:21])
    bench = bench_of({}, np.random.default_rng(1), points=toy.points, single=True)
    problem = problem_of(toy, bench)
    said = problem.predictions(NONE, NOTHING)
    logs = [
        timed(
            problem.seen, replace(said, outlier_share=np.full_like(said.outlier_share, share))
        ).log[0, 0]
        for share in (0.02, 0.2)
    ]
    size, n = 24.0, int(problem.seen.n[0])
    none = [
        sum(np.log((size * (1.0 - share) + k) / (size + k)) for k in range(n))
        for share in (0.02, 0.2)
    ]
    assert logs[0] - logs[1] == pytest.approx(none[0] - none[1], abs=0.5)


@dataclass(frozen=True)
class Hits:
    """What data drawn from the priors gave.

    ``ranks`` of true shares of priors and whether their 90 % interval held; ``given`` and ``true``
    are probabilities of hypotheses and which of them was it, (sets, hypotheses).
    """

    ranks: Array
    held: np.ndarray
    given: Array
    true: np.ndarray


def _hits(count: int, single: bool) -> Hits:
    spaces = _spaces(TRIED)
    before = np.array(list(probabilities(dict.fromkeys(TRIED, 0.0)).values()))
    ranks, given, true = [], [], []
    for seed in range(count):
        generator = np.random.default_rng(1000 + seed)
        which = int(generator.choice(len(TRIED), p=before))
        shares = generator.random((1, len(spaces[which].parameters)))
        values = spaces[which].values(shares)
        bench = drawn(TOY, TRIED[which], values, generator, single=single)
        problem = problem_of(TOY, bench)
        scored = [evidence(problem, space) for space in spaces]
        found = probabilities({one.hypothesis: one.log_evidence for one in scored})
        given.append([found[h] for h in TRIED])
        true.append(np.arange(len(TRIED)) == which)
        if which:
            below = scored[which].rows.shares[:, 0] < shares[0, 0]
            ranks.append(float(scored[which].weights()[below].sum()))
    places = np.array(ranks)
    return Hits(places, abs(places - 0.5) < 0.45, np.array(given), np.array(true))


@pytest.mark.parametrize("single", [False, True], ids=["means", "singles"])
@pytest.mark.parametrize("count", [40, pytest.param(600, marks=pytest.mark.slow)])
def test_inference_is_calibrated(count: int, single: bool) -> None:
    found = _hits(count, single)
    assert kstest(found.ranks, "uniform").pvalue > 1.0 - SURE
    assert _within(int(found.held.sum()), found.held.size, 0.9)
    # Sums of probabilities are numbers of hits, of all and of those that were thought likely.
    for some in (found.given < 0.5, found.given >= 0.5, found.given > 0.8):
        chances = found.given[some]
        error = np.sqrt((chances * (1.0 - chances)).sum())
        assert abs(found.true[some].sum() - chances.sum()) < 3.3 * error + 1.0


def _noisy(
    monkeypatch: pytest.MonkeyPatch, seeds: int, enough: float
) -> tuple[Array, Array, float]:
    """Return probabilities of a pair by some seeds, the noise of each, and effective draws."""
    pair = ("actuation_delay", "sleeve_friction")
    truth = {"delay_s": 0.05, "friction_N": 60.0}
    bench = bench_of(truth, np.random.default_rng(3), points=POINTS)
    problem = problem_of(TOY, bench)
    spaces = _spaces((NONE, ("actuation_delay",), ("sleeve_friction",), pair))
    monkeypatch.setattr(integral, "ENOUGH", enough)
    monkeypatch.setattr(integral, "SAMPLINGS", 40)
    once = [evidence(problem, space) for space in spaces[:3]]
    sample, found = integral.sampled, []
    for seed in range(seeds):
        with monkeypatch.context() as other:
            other.setattr(integral, "sampled", partial(sample, seed=seed))
            scored = {one.hypothesis: one for one in (*once, evidence(problem, spaces[3]))}
        raw = probabilities({h: one.log_evidence for h, one in scored.items()})
        metric = metric_of(problem.seen, scored[NONE].rows.predicted, problem.discrepancy)
        fold = folding(problem, list(scored.values()), metric, raw)
        draws = 1.0 / float((scored[pair].weights() ** 2).sum())
        found.append((fold.fold(raw)[pair], noise(pair, raw, fold, scored), draws))
    given, said, effective = np.array(found).T
    return given, said, float(effective.mean())


def test_noise_is_how_far_seeds_are_apart_and_falls_with_draws(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given, said, draws = _noisy(monkeypatch, 12, 150.0)
    assert 0.05 < given.mean() < 0.95
    assert 0.4 < given.std(ddof=1) / np.sqrt(np.mean(said**2)) < 1.7
    _, fewer, more = _noisy(monkeypatch, 2, 1500.0)
    # By the root of the number of draws that count.
    assert more > 1.8 * draws
    assert 0.6 < fewer.mean() / said.mean() * np.sqrt(more / draws) < 1.7
