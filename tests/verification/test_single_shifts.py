"""Density of single shifts whose times have two modes, or look like outliers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.likelihood.cell_likelihood import timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.mean_density import log_sphere, time_scores
from dogshape.diagnosis.likelihood.modes import modes_of
from dogshape.diagnosis.likelihood.observations import Observed, observe
from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array
from tests.toy import bench_of, points_of

SURE = Rules(
    model_error=0.0,
    least_error=0.0,
    spread_share=1e-6,
    spread_error=0.0,
    odd_share=0.0,
    late_share=1e-9,
    late_least=1e-9,
)
QUANTILES = 400


def _bench(samples: Array) -> Bench:
    """Single shifts (cells, n) at as many operating points."""
    points = points_of()
    bench = bench_of({}, np.random.default_rng(1), points=[points[0]])
    (cell,) = bench.cells
    rows = [Reading(k + 2, cell.point, 1, float(t), True) for k, t in enumerate(samples)]
    return type(bench)(**{**vars(bench), "cells": gather(rows)})


def _seen(sample: Array) -> Observed:
    return observe(_bench(sample))


def _said(times: Array, rules: Rules, late: float = 1e-9) -> CellPredictions:
    one = np.ones(1)
    whole = Prediction.plain(np.sort(times)[None], one, 1e-9 * one, 0.0 * one)
    every = {**vars(whole), "outlier_share": late * one, "behind": one, "behind_sd": one}
    return CellPredictions.of([Prediction(**every)], rules)


def _two_modes(share: float) -> Array:
    """Times of which a share is near 60 ms, and the others near 200 ms."""
    places = norm.ppf((np.arange(QUANTILES) + 0.5) / QUANTILES)
    fast = round(share * QUANTILES)
    return np.concatenate([0.06 + 0.003 * places[:fast], 0.2 + 0.01 * places[fast:]])


@pytest.mark.parametrize("seed", range(6))
def test_times_are_divided_where_most_of_their_variance_lies_between(seed: int) -> None:
    generator = np.random.default_rng(seed)
    times = np.sort(generator.gamma(1.0 + seed, size=(3, 25)) + 0.01, axis=-1)
    found = modes_of(times, 1e-9)
    for row, share, mean, sd in zip(times, found.share, found.mean, found.sd, strict=True):
        parts = [(row[:k], row[k:]) for k in range(1, row.size)]
        best = min(parts, key=lambda both: sum(((one - one.mean()) ** 2).sum() for one in both))
        assert share == pytest.approx([one.size / row.size for one in best])
        assert mean == pytest.approx([one.mean() for one in best])
        deviations = [one.std(ddof=1) if one.size > 1 else 1e-9 for one in best]
        assert sd == pytest.approx(deviations, abs=1e-9)


@pytest.mark.parametrize("n", [2, 3, 7, 20])
def test_normal_times_have_one_density_with_or_without_mean_and_deviation(n: int) -> None:
    """The second method is the plain product over all times."""
    generator = np.random.default_rng(n)
    times = 0.1 + 0.01 * generator.standard_normal(n)
    seen = _seen(times)
    freedom, s = n - 1.0, float(np.exp(seen.log_sd[0]))
    ratio = freedom * (s / 0.01) ** 2
    of_spread = chi2.logpdf(ratio, freedom) + np.log(2.0 * ratio)
    of_mean = norm.logpdf(times.mean(), 0.1, 0.01 / np.sqrt(n))
    whole = norm.logpdf(times, 0.1, 0.01).sum()
    assert of_mean + of_spread - log_sphere(seen)[0] == pytest.approx(whole)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
@pytest.mark.parametrize("n", [4, 8])
def test_few_shifts_that_are_all_of_one_mode_are_nothing_special(share: float, n: int) -> None:
    """A normal law of their spread would have 4 to 50 % of all samples below -3."""
    generator = np.random.default_rng(n)
    times = _two_modes(share)
    said, scores = _said(times, Rules(odd_share=0.0)), []
    for _ in range(400):
        seen = _seen(generator.choice(times, n))
        scores.append(time_scores(seen, said, np.zeros((1, 1)))[1][0, 0])
    low = np.mean(np.array(scores) < -3.0)
    assert low < 0.005
    assert np.sqrt(np.mean(np.square(scores))) < 1.3


def test_a_slow_shift_of_a_wide_bulk_is_no_outlier() -> None:
    times = _two_modes(0.8)
    sample = np.array([0.058, 0.059, 0.06, 0.061, 0.062, 0.063, 0.2])
    seen = _seen(sample)
    assert seen.outlier_times[0].tolist() == [0.2]
    zero = np.zeros((1, 1))
    mean, spread, late = (one[0, 0] for one in time_scores(seen, _said(times, Rules()), zero))
    assert late == 0.0
    assert abs(mean) < 1.5
    assert abs(spread) < 1.5
    narrow = 0.06 + 0.002 * norm.ppf((np.arange(QUANTILES) + 0.5) / QUANTILES)
    mean, spread, late = (
        one[0, 0] for one in time_scores(seen, _said(narrow, Rules(), late=0.05), zero)
    )
    assert late == 1.0
    assert abs(mean) < 1.5
    assert abs(spread) < 1.5


def test_both_readings_add_up_to_the_product_over_all_times() -> None:
    """Of normal times the reading without outliers is the whole density, the other nearly none."""
    normal = 0.1 + 0.01 * norm.ppf((np.arange(QUANTILES) + 0.5) / QUANTILES)
    generator = np.random.default_rng(4)
    while True:
        sample = generator.normal(0.1, 0.01, 40)
        if np.isnan(bulk(sample)).any():
            break
    seen = _seen(sample)
    assert seen.divided[0]
    said = _said(normal, SURE)
    ours = timed(seen, said).log[0, 0] - log_sphere(seen)[0]
    # The logarithm of a deviation counts as normal, which at 39 degrees of freedom it nearly is.
    assert ours == pytest.approx(norm.logpdf(sample, 0.1, said.sd[0, 0]).sum(), abs=0.3)
