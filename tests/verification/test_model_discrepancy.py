"""Discrepancy of the simulation, and late shifts, against direct sums and draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from dogshape.diagnosis.likelihood.cell_likelihood import timed
from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import (
    Discrepancy,
    Slopes,
    discrepancy_prior,
    marginals,
    posterior_draws,
)
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import PredictionSummary
from dogshape.diagnosis.likelihood.signature import Metric, metric_of, squared
from dogshape.diagnosis.prediction.outliers import bulk, outlier_counts, outlier_statistics
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import Rules, Settings
from dogshape.diagnosis.terms import Array
from dogshape.sim.units import RPM
from tests.declared import Declared, problem_of
from tests.toy import bench_of, points_of

SLIPS = np.array([5.0, 5.0, 25.0, 249.0]) * RPM
FORCES = np.array([235.2, 641.5, 235.2, 315.0])
MEANS = np.array([0.15, 0.12, 0.09, 0.05])


def _prior(scale: float = 0.05) -> Discrepancy:
    return discrepancy_prior(SLIPS, FORCES, MEANS, Rules(discrepancy=scale))


def _members(prior: Discrepancy) -> list[tuple[float, Array]]:
    """Return prior probability and covariance of each amplitude and shape."""
    found = []
    for root, chances in zip(prior.roots, prior.prior, strict=True):
        for chance, size in zip(chances, prior.amplitudes, strict=True):
            found.append((chance, size**2 * root @ root.T))
    return found


def test_rows_that_were_never_measured_change_nothing() -> None:
    slips, means = np.append(SLIPS, SLIPS), np.append(MEANS, MEANS)
    forces = np.append(FORCES, np.full(4, 5000.0))
    measured = np.arange(8) < 4
    found = discrepancy_prior(slips, forces, means, Rules(), measured).of(measured)
    assert found.covariance == pytest.approx(
        discrepancy_prior(SLIPS, FORCES, MEANS, Rules()).covariance
    )


def test_forces_that_hardly_differ_are_off_alike() -> None:
    def apart(*forces: float) -> float:
        """Return the deviation of the difference of the first two, over the mean time."""
        alike = np.full(len(forces), SLIPS[2]), np.array(forces), np.ones(len(forces))
        covariance = discrepancy_prior(*alike, Rules()).covariance
        return float(np.sqrt(covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1]))

    assert apart(300.0, 303.0) < 0.1 * apart(300.0, 600.0)
    assert apart(300.0, 303.0) < 0.005
    assert apart(300.0, 400.0) == pytest.approx(apart(300.0, 600.0))


@pytest.mark.parametrize("own", [0.0, 0.003])
def test_normal_cells_have_the_density_of_a_mixture_of_joint_normals(own: float) -> None:
    generator, prior = np.random.default_rng(3), _prior()
    sd = np.array([0.004, 0.01, 0.002, 0.001])
    gaps = generator.normal(0.0, 0.01, (6, 4))
    alone = norm.logpdf(gaps, 0.0, sd).sum(axis=1)
    slopes = Slopes(gaps / sd**2, np.broadcast_to(sd**-2.0, gaps.shape))
    joint = generator.normal(0.0, 1.0, (6, 4)) * own
    found = alone + marginals(slopes, prior, joint).log
    for row, mine, value in zip(gaps, joint, found, strict=True):
        whole = np.diag(sd**2) + np.outer(mine, mine)
        density = sum(c * multivariate_normal(cov=whole + k).pdf(row) for c, k in _members(prior))
        assert value == pytest.approx(np.log(density), abs=1e-8)


def test_the_discrepancy_given_the_data_is_that_of_joint_normals() -> None:
    prior, sd = _prior(), np.array([0.004, 0.01, 0.002, 0.001])
    gaps = np.array([0.012, 0.01, 0.006, 0.003])
    slopes = Slopes(np.tile(gaps / sd**2, (40_000, 1)), np.tile(sd**-2.0, (40_000, 1)))
    generator = np.random.default_rng(1)
    drawn, amplitudes = posterior_draws(slopes, prior, np.zeros((40_000, 4)), generator)
    weights, means, squares = [], [], []
    for chance, kernel in _members(prior):
        whole = kernel + np.diag(sd**2)
        weights.append(chance * multivariate_normal(cov=whole).pdf(gaps))
        gain = kernel @ np.linalg.inv(whole)
        means.append(gain @ gaps)
        squares.append(means[-1] ** 2 + np.diag(kernel - gain @ kernel))
    share = np.array(weights) / np.sum(weights)
    assert drawn.mean(axis=0) == pytest.approx(share @ means, rel=0.03)
    assert (drawn**2).mean(axis=0) == pytest.approx(share @ squares, rel=0.05)
    assert amplitudes.mean() == pytest.approx(share @ np.tile(prior.amplitudes, 2), rel=0.03)


def test_cells_of_a_mismatch_err_alike_and_others_the_less_the_farther() -> None:
    prior = _prior()
    covariance = prior.covariance / np.outer(MEANS, MEANS)
    sizes = np.sqrt(np.diag(covariance))
    assert prior.prior.sum() == pytest.approx(1.0)
    # The nodes stand for a half-normal amplitude: its root mean square is its scale.
    assert np.sqrt(prior.prior.sum(axis=0) @ prior.amplitudes**2) == pytest.approx(0.05, rel=0.1)
    alike = covariance / np.outer(sizes, sizes)
    assert 0.0 < alike[0, 1] < 1.0
    assert alike[0, 2] > alike[0, 3]


def test_without_a_scale_nothing_changes() -> None:
    assert _prior(0.0).absent
    slopes = Slopes(np.ones((3, 4)), np.ones((3, 4)))
    assert marginals(slopes, _prior(0.0), np.zeros((3, 4))).log == pytest.approx(0.0, abs=1e-12)


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


def test_a_discrepancy_makes_nothing_likelier_than_the_best_offsets_would() -> None:
    said = _said(0.05, 0.12, 0.03)
    means = np.linspace(0.03, 0.2, 60)
    cells = [timed(_with_mean(mean, 10), said) for mean in means]
    best = max(cell.log[0, 0] for cell in cells)
    for size in (1e-3, 0.01, 0.1, 1.0):
        prior = Discrepancy((np.full((1, 1), size),), np.ones(1), np.ones((1, 1)))
        for cell in cells:
            gain = marginals(cell.slopes, prior, np.zeros((1, 1))).log[0]
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


def _metric(
    scale: float, shapes: tuple[tuple[float, float, float, float], ...] | None = None
) -> tuple[Metric, PredictionSummary, Array]:
    """Return the metric of a bench with means of ten shifts, its baseline, and what cells err."""
    points = points_of((235.2, 641.5))
    toy = Declared(points)
    problem = problem_of(toy, bench_of({}, np.random.default_rng(2), points=points, shifts=50))
    rules = Rules(discrepancy=scale)
    rules = rules if shapes is None else replace(rules, discrepancy_shapes=shapes)
    problem = replace(problem, settings=Settings(likelihood=rules))
    baseline = problem.summary((), np.zeros((1, 0)))
    metric = metric_of(problem.seen, baseline, problem.discrepancy)
    return metric, baseline, problem.discrepancy.covariance


def test_distances_of_signatures_are_those_of_generalised_least_squares() -> None:
    metric, baseline, common = _metric(0.05)
    gaps = np.random.default_rng(4).normal(0.0, 0.01, baseline.core.shape)
    moved = replace(baseline, core=baseline.core + gaps)
    whole = np.diag(metric.core**2) + common
    expected = float(gaps[0] @ np.linalg.solve(whole, gaps[0]))
    assert squared(metric.of(moved), metric.of(baseline))[0, 0] == pytest.approx(expected)
    assert metric.precision == pytest.approx(np.diag(np.linalg.inv(whole)))


def test_a_one_sided_offset_is_as_far_as_its_own_size_and_that_of_the_discrepancy() -> None:
    """Of one common direction the distance d becomes d / (1 + k d), k the ratio of variances."""
    one_sided = ((1.0, 0.0, 0.0, 1.0),)
    sure, baseline, _ = _metric(1e-9, one_sided)
    unsure, _, common = _metric(0.05, one_sided)
    offset = replace(baseline, core=1.05 * baseline.core)
    alone, both = (
        float(squared(metric.of(offset), metric.of(baseline))[0, 0]) for metric in (sure, unsure)
    )
    assert alone == pytest.approx(float((((0.05 * baseline.core) / sure.core) ** 2).sum()))
    ratio = float(common[0, 0] / (0.05 * baseline.mean[0, 0]) ** 2)
    assert both == pytest.approx(alone / (1.0 + ratio * alone), rel=1e-4)
