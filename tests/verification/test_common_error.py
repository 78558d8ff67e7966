"""Errors that cells have in common, and late shifts, against direct sums and draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from dogshape.diagnosis.likelihood.cell_likelihood import CellPredictions, Rules, timed
from dogshape.diagnosis.likelihood.common_error import (
    Slopes,
    common_errors,
    log_common,
    shared_errors,
)
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.prediction.outliers import bulk, outlier_counts, outlier_statistics
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM
from tests.toy import bench_of, points_of

SLIPS = np.array([5.0, 5.0, 25.0, 249.0]) * RPM
MEANS = np.array([0.15, 0.12, 0.09, 0.05])


def test_normal_cells_have_the_density_of_a_joint_normal() -> None:
    common = common_errors(SLIPS, MEANS, 0.05)
    generator = np.random.default_rng(3)
    sd = np.array([0.004, 0.01, 0.002, 0.001])
    gaps = generator.normal(0.0, 0.01, (6, 4))
    alone = norm.logpdf(gaps, 0.0, sd).sum(axis=1)
    slopes = Slopes(gaps / sd**2, np.broadcast_to(sd**-2.0, gaps.shape))
    joint = generator.normal(0.0, 0.003, (6, 4))
    found = alone + log_common(slopes, shared_errors(common, joint))
    for row, own, value in zip(gaps, joint, found, strict=True):
        whole = np.diag(sd**2) + common @ common.T + np.outer(own, own)
        assert value == pytest.approx(multivariate_normal(cov=whole).logpdf(row), abs=1e-9)


def test_cells_of_a_mismatch_err_alike_and_others_the_less_the_farther() -> None:
    common = common_errors(SLIPS, MEANS, 0.05)
    covariance = common @ common.T / np.outer(MEANS, MEANS)
    assert np.diag(covariance) == pytest.approx(0.05**2)
    assert covariance[0, 1] == pytest.approx(0.05**2)
    assert covariance[0, 1] > covariance[0, 2] > covariance[0, 3] > 0.0


def _said(late: float, behind: float, wide: float) -> CellPredictions:
    times = norm.ppf((np.arange(24) + 0.5) / 24, 0.05, 0.005)[None]
    one = np.ones(1)
    plain = Prediction.plain(times, one, 0.0 * one, 0.02 * one)
    parts = {"outlier_share": late * one, "behind": behind * one, "behind_sd": wide * one}
    return CellPredictions.of([Prediction(**{**vars(plain), **parts})], Rules(0.0, 1e-5))


def _with_mean(mean: float, n: int):  # type: ignore[no-untyped-def]
    bench = bench_of({}, np.random.default_rng(0), points=points_of()[20:21], shifts=n)
    seen = observe(bench)
    return type(seen)(**{**vars(seen), "mean": np.array([mean])})


def test_the_density_of_a_mean_is_that_of_drawn_shifts_with_late_ones() -> None:
    late, behind, wide, n = 0.05, 0.12, 0.03, 10
    generator = np.random.default_rng(1)
    draws = generator.normal(0.05, 0.005, (200_000, n))
    rare = generator.random(draws.shape) < late
    draws += rare * generator.normal(behind, wide, draws.shape)
    edges = np.linspace(0.04, 0.1, 25)
    counted = np.histogram(draws.mean(axis=1), edges)[0] / len(draws)
    said = _said(late, behind, wide)
    fine = np.linspace(0.04, 0.1, 24 * 20 + 1)
    density = np.exp([timed(_with_mean(mean, n), said).log[0, 0] for mean in fine])
    steps = 0.5 * (density[1:] + density[:-1]) * np.diff(fine)
    assert steps.reshape(24, 20).sum(axis=1) == pytest.approx(counted, abs=0.012)
    assert steps.sum() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("mean", [0.043, 0.05, 0.055, 0.062, 0.1])
def test_slopes_are_those_of_the_density(mean: float) -> None:
    said, step = _said(0.05, 0.12, 0.03), 1e-6
    here = timed(_with_mean(mean, 10), said)
    ahead, back = (timed(_with_mean(mean + s, 10), said).log[0, 0] for s in (step, -step))
    # What is foretold later has the slope of what is seen earlier.
    assert here.first[0, 0] == pytest.approx(-(ahead - back) / (2.0 * step), rel=1e-4, abs=1e-2)
    assert here.second[0, 0] >= 0.0


def test_common_errors_make_nothing_likelier_than_the_best_offsets_would() -> None:
    said = _said(0.05, 0.12, 0.03)
    means = np.linspace(0.03, 0.2, 60)
    cells = [timed(_with_mean(mean, 10), said) for mean in means]
    best = max(cell.log[0, 0] for cell in cells)
    for size in (1e-3, 0.01, 0.1, 1.0):
        for cell in cells:
            gain = log_common(cell.slopes, np.full((1, 1, 1), size))[0]
            assert cell.log[0, 0] + gain <= best + 1.0


def test_late_shifts_are_found_with_their_share_and_delay() -> None:
    generator = np.random.default_rng(2)
    times: Array = generator.normal(0.05, 0.005, (10, 3, 64))
    rare = generator.random(times.shape) < np.array([0.0, 0.04, 0.1])[:, None]
    times = times + rare * generator.normal(0.12, 0.03, times.shape)
    times[0, 0, :4] = np.inf
    times[1, 0, 0] = np.nan
    soon = bulk(times)
    found = outlier_statistics([(times, soon)])
    assert found.share == pytest.approx([0.0, 0.04, 0.1], abs=0.02)
    assert np.isnan(found.mean[0])
    assert found.mean[1:] == pytest.approx(0.12, abs=0.02)
    assert found.sd[1:] == pytest.approx(0.03, abs=0.012)
    flagged = np.isfinite(times) & np.isnan(soon)
    assert (flagged == (rare & np.isfinite(times))).mean() > 0.98
    assert outlier_counts(times, soon)[1][0, 0] == 60


def test_a_wide_spread_has_no_late_shifts() -> None:
    times = np.linspace(0.05, 0.45, 24)
    assert outlier_counts(times, bulk(times))[0] == 0.0
