"""Density of single shifts whose times have two modes, or look like outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm
from scipy.stats import t as student

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.inference.unknown import offsets_of_cells
from dogshape.diagnosis.likelihood.cell_likelihood import log_times, timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.mean_density import (
    MeanDensity,
    log_outliers,
    log_sphere,
    time_scores,
)
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


def _many(samples: Array) -> Observed:
    """Observe samples (m, n), each as an operating point of its own."""
    found = [_seen(sample) for sample in samples]
    every = {}
    for name, value in vars(found[0]).items():
        if isinstance(value, np.ndarray) and name != "divided":
            every[name] = np.concatenate([getattr(one, name) for one in found])
    for name in ("singles", "outlier_times"):
        every[name] = tuple(getattr(one, name)[0] for one in found)
    return replace(found[0], **every)


def _said(times: Array, rules: Rules, late: float = 1e-9) -> CellPredictions:
    return CellPredictions.of([_prediction(times, late)], rules)


def _prediction(times: Array, late: float = 1e-9) -> Prediction:
    one = np.ones(1)
    whole = Prediction.plain(np.sort(times)[None], one, 1e-9 * one, 0.0 * one)
    return replace(whole, outlier_share=late * one, behind=one, behind_sd=one)


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


@pytest.mark.parametrize("late", [0.004, 0.2, 0.4])
def test_the_density_of_one_single_shift_adds_up_to_one(late: float) -> None:
    """It may be late unseen, as a mean of one."""
    grid = np.linspace(-8.0, 14.0, 4401)
    said = _said(np.linspace(0.1, 0.12, QUANTILES), SURE, late)
    log = np.concatenate([log_times(_seen(np.array([t])), said)[0] for t in grid])
    assert np.trapezoid(np.exp(log), grid) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("n", [3, 6, 8])
def test_densities_of_all_that_can_be_seen_add_up_to_one(share: float, n: int) -> None:
    """Integrated by importance sampling: from both modes, each shift by itself, or one normal."""
    generator, times = np.random.default_rng(n), _two_modes(share)
    rules = replace(SURE, spread_share=0.05)
    modes = modes_of(np.sort(times)[None], 1e-4)
    shares, means, widths = modes.share[0], modes.mean[0], 1.2 * modes.sd[0]
    middle, wide, count = times.mean(), 1.2 * times.std(), 4000
    place = (generator.random((count, n)) > shares[0]).astype(int)
    apart = means[place] + widths[place] * generator.standard_t(5.0, (count, n))
    whole = middle + wide * generator.standard_t(5.0, (count, n))
    samples = np.where(generator.random((count, 1)) < 0.5, apart, whole)
    each = [
        s * student.pdf((samples - m) / w, 5.0) / w
        for s, m, w in zip(shares, means, widths, strict=True)
    ]
    drawn = 0.5 * np.sum(each, axis=0).prod(axis=1)
    drawn += 0.5 * (student.pdf((samples - middle) / wide, 5.0) / wide).prod(axis=1)
    seen = _many(samples)
    said = CellPredictions.of([_prediction(times)] * count, rules)
    ratios = np.exp(log_times(seen, said)[:, 0] - log_sphere(seen)) / drawn
    error = ratios.std() / np.sqrt(count)
    assert error < 0.06
    # A normal law of ln s and normal modes are approximations.
    assert ratios.mean() == pytest.approx(1.0, abs=0.04 + 3.0 * error)


def test_slow_shifts_move_with_the_offset() -> None:
    """The density at an offset is that of a prediction which is moved by it."""
    sample = np.array([0.395, 0.398, 0.4, 0.401, 0.402, 0.405, 0.6])
    times = _two_modes(0.8) + 0.34
    times = np.where(times > 0.5, times + 0.06, times)
    seen, said = _seen(sample), _said(times, Rules(odd_share=0.0))
    density, late = MeanDensity.of(seen, said), log_outliers(seen, said)[0, 0]
    for offset in (-0.02, 0.01, 0.03):
        moved = np.full((1, 1), offset)
        at = density.at(moved)[0][0, 0] + late
        assert at == pytest.approx(timed(seen, said.moved(moved)).log[0, 0], abs=1e-3)


def test_unknown_counts_narrow_modes_as_a_fine_grid_does() -> None:
    sample = np.array([0.058, 0.059, 0.06, 0.061])
    seen, said = _seen(sample), _said(_two_modes(0.5), Rules())
    (found,) = offsets_of_cells(seen, said)
    assert found is not None
    grid = np.linspace(-1.0, 1.0, 40_001)[None]
    plain = replace(said, missed=np.zeros_like(said.missed))
    logs = timed(seen, plain.moved(grid)).log[0] + np.log(grid[0, 1] - grid[0, 0])
    weights = np.exp(logs - logs.max())
    mean = float(weights @ grid[0] / weights.sum())
    assert found.log_size == pytest.approx(logs.max() + np.log(weights.sum()), abs=1e-3)
    assert found.mean == pytest.approx(mean, abs=1e-4)
