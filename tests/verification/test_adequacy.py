"""P-values of a fit: uniform for true values, small for what they are to find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm

from dogshape.bench.bench_data import Cell, Reading
from dogshape.diagnosis.inference.adequacy import (
    best_direction_p,
    combine_draws,
    combine_parts,
    order_p,
    rank_p,
    sum_of_squares_p,
    worst_p,
)
from dogshape.diagnosis.likelihood.likelihood import Likelihood, Terms
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, Array
from tests.verification.test_likelihood import world

SETS = 2000
SHIFTS = 12  #: at an operating point


def test_p_of_draws_is_uniform_whatever_their_dependence() -> None:
    generator = np.random.default_rng(1)
    for correlation in (0.0, 0.7, 1.0):
        common = generator.normal(size=(SETS, 1))
        single = generator.normal(size=(SETS, 6))
        scores = correlation**0.5 * common + (1.0 - correlation) ** 0.5 * single
        p_values = np.array([combine_draws(row) for row in norm.sf(scores)])
        for level in (0.01, 0.05):
            error = (level * (1.0 - level) / SETS) ** 0.5
            assert (p_values < level).mean() < level + 3.5 * error
        assert (p_values < 0.05).mean() > 0.03


def test_p_of_one_draw_is_its_own() -> None:
    assert combine_draws(np.array([0.3, np.nan])) == pytest.approx(0.3)
    assert combine_draws(np.array([1e-6, 1.0, 1.0, 1.0])) == pytest.approx(4e-6, rel=0.01)
    assert np.isnan(combine_draws(np.array([np.nan])))


def test_p_of_parts_is_uniform_and_that_of_the_least() -> None:
    parts = np.random.default_rng(6).random((SETS, 7))
    p_values = [combine_parts(row) for row in parts]
    assert kstest(p_values, "uniform").pvalue > 0.003
    assert combine_parts([0.001, 1.0, 0.9]) == pytest.approx(0.003, rel=0.01)


def test_sum_and_largest_of_deviates_are_those_of_normal_ones() -> None:
    scores = np.random.default_rng(2).normal(size=(SETS, 9))
    scores[:, :2] = np.nan
    for p_values in (sum_of_squares_p(scores), worst_p(scores)):
        assert kstest(p_values, "uniform").pvalue > 0.003
    assert sum_of_squares_p(np.array([[1.0, 2.0, np.nan]])) == pytest.approx(chi2.sf(5.0, 2))
    assert worst_p(np.array([[1.0, -4.0, np.nan]])) == pytest.approx(
        1.0 - (1.0 - 2.0 * norm.sf(4.0)) ** 2
    )
    assert np.isnan(sum_of_squares_p(np.full((1, 3), np.nan))).all()


def test_ranks_find_a_trend_alone() -> None:
    generator = np.random.default_rng(3)
    force = np.repeat([235.0, 469.0, 641.0], 6)
    scores = generator.normal(size=(SETS, force.size))
    scores[:, 4] = np.nan
    assert kstest(rank_p(scores, force), "uniform").pvalue > 0.003
    trend = scores[:100] + 2.0 * (force - force.mean()) / force.std()
    assert np.median(rank_p(trend, force)) < 0.01
    assert np.isnan(rank_p(scores, np.ones_like(force))).all()
    assert np.isnan(rank_p(scores[:, :4], force[:4])).all()


def _series(delays: Array, seed: int = 1) -> Likelihood:
    """Build the likelihood of single shifts in turn at each point, each with a delay (n,), s."""
    bench, model = world()
    scatter = np.random.default_rng(seed).normal(size=delays.size)
    times = 0.2 + 0.01 * scatter + delays
    cells = []
    for k, cell in enumerate(bench.cells):
        readings = []
        for place in range(k, delays.size, len(bench.cells)):
            readings.append(Reading(place, cell.point, 1, times[place], True, place=float(place)))
        cells.append(Cell(cell.point, tuple(readings)))
    bench = replace(bench, cells=tuple(cells))
    return Likelihood(bench, observe(bench, model), model, USUAL)


def test_order_finds_shifts_that_alternate_and_no_drift() -> None:
    count = SHIFTS * 6
    places = np.arange(count)
    alternation = (places + places // 6) % 2  # at each point, and from point to point
    p_values = [order_p(_series(np.zeros(count), seed)) for seed in range(60)]
    assert kstest(p_values, "uniform").pvalue > 0.003
    # A valve that hangs in every other shift, and force that fades at once.
    assert order_p(_series(0.02 * alternation)) < 0.001
    assert order_p(_series(0.03 * (places > count / 3))) > 0.5
    bench, model = world()
    assert np.isnan(order_p(Likelihood(bench, observe(bench, model), model, USUAL)))


def test_best_direction_is_exact_and_finds_a_smooth_gap() -> None:
    bench, model = world()
    likelihood = Likelihood(bench, observe(bench, model), model, USUAL)
    p = model.predict(NONE, np.zeros((1, 0))).select(np.zeros(SETS, dtype=int))
    amplitude = np.full(SETS, 0.05)
    points = likelihood.measured_points
    columns = likelihood.all_common_errors(p, amplitude)[0, points]
    variance = p.sd[:, points] ** 2 / 5.0
    generator = np.random.default_rng(5)
    residual = generator.normal(size=(SETS, columns.shape[1])) @ columns.T
    residual = residual + np.sqrt(variance) * generator.normal(size=variance.shape)
    nothing = np.zeros(SETS)
    terms = Terms(nothing, nothing[:, None], residual, variance)
    assert kstest(best_direction_p(likelihood, p, terms, amplitude), "uniform").pvalue > 0.003
    slow = terms._replace(residual=residual + 0.5 * p.mean[:, points])
    assert np.median(best_direction_p(likelihood, p, slow, amplitude)) < 0.05
