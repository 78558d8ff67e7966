"""Likelihood of the diagnosis against second computations: dense covariances, sums, integrals."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from dogshape.bench.bench_data import Bench, Cell, Reading
from dogshape.diagnosis.likelihood.likelihood import (
    NODES,
    WEIGHTS,
    Likelihood,
    SpreadDensity,
    integrate_common_errors,
)
from dogshape.diagnosis.likelihood.observed import Observations, observe
from dogshape.diagnosis.prediction.model import Model, Prediction
from dogshape.diagnosis.prediction.moments import LOG_MEAN
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, Array
from tests.analytic import small_model

DATA = np.concatenate([np.linspace(-0.6, 0.0, 75, endpoint=False), np.linspace(0.0, 1.4, 450)])


@cache
def world() -> tuple[Bench, Model]:
    """Build six points with single shifts, and their predictions."""
    bench, model = small_model()
    cells = tuple(
        Cell(cell.point, (Reading(k + 2, cell.point, 5, 0.1, True),))
        for k, cell in enumerate(bench.cells)
    )
    return replace(bench, cells=cells), model


def seen_at(count: float, mean: float, *, hidden: bool, point: int = 2) -> Observations:
    """Observe nothing but a mean of ``count`` shifts at one operating point."""
    bench, model = world()
    plain, empty = observe(bench, model), np.zeros(model.cell_count)
    counts = empty.copy()
    counts[point] = count
    nothing = dict.fromkeys(("freedom", "late_count", "engaged_count", "failed_count"), empty)
    means, late = np.full(model.cell_count, mean), np.full(model.cell_count, hidden)
    return replace(plain, count=counts, mean=means, hides_late=late, **nothing)


def likelihood_of(seen: Observations) -> Likelihood:
    """Build the likelihood of observations."""
    bench, model = world()
    return Likelihood(bench, seen, model, USUAL)


def dense(variance: Array, columns: Array) -> Array:
    """Compute the covariance of independent errors and those in common, (c, c)."""
    return np.asarray(np.diag(variance) + columns @ columns.T)


def test_errors_in_common_integrated_equal_the_dense_density() -> None:
    rng = np.random.default_rng(1)
    residual, basis, fixed = (rng.normal(size=s) for s in ((4, 6), (4, 6, 3), (4, 6, 2)))
    variance = rng.uniform(0.2, 2.0, (4, 6))
    log, nodes = integrate_common_errors(residual, variance, basis, fixed, 0.7)
    for row in range(4):
        exact = [
            stats.multivariate_normal(
                np.zeros(6), dense(variance[row], np.hstack([0.7 * s * basis[row], fixed[row]]))
            ).logpdf(residual[row])
            + np.log(w)
            for s, w in zip(NODES, WEIGHTS, strict=True)
        ]
        assert nodes[row] == pytest.approx(exact, rel=1e-9)
        assert log[row] == pytest.approx(logsumexp(exact), rel=1e-9)
    assert WEIGHTS.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("count", "hidden"), [(5.0, False), (5.0, True), (3.0, True)])
@pytest.mark.parametrize("late", [0.01, 0.3])
def test_the_density_of_a_mean_integrates_to_one(count: float, late: float, hidden: bool) -> None:
    """Late shifts within the mean and odd means included; the share of odd means comes on top."""
    _, model = world()
    p = model.predict(NONE, np.zeros((1, 0)))
    p = replace(p, late_share=np.full_like(p.late_share, late))
    logs = [
        likelihood_of(seen_at(count, y, hidden=hidden)).terms(p).log_likelihood[0]
        for y in DATA.tolist()
    ]
    alone = 1.0
    if not hidden:  # none of the shifts that are seen one by one is late
        known = USUAL.late_known
        alone = stats.betabinom(int(count), known * late, known * (1.0 - late)).pmf(0)
    assert np.trapezoid(np.exp(logs), DATA) == pytest.approx(alone, rel=0.01)


def test_a_ratio_of_variances_has_the_density_of_f() -> None:
    ratio = np.array([0.2, 1.0, 3.0])
    exact = stats.f(7.0, 4.5).logpdf(ratio) + np.log(ratio)  # of the logarithm
    density = SpreadDensity.of(np.array(7.0), np.array(4.5))
    assert density.log(ratio) == pytest.approx(exact, rel=1e-9)


def test_an_error_of_interpolation_makes_a_spread_as_likely_too_large_as_too_small() -> None:
    p, log = world()[1].predict(NONE, np.zeros((1, 0))), {}
    seen = seen_at(12.0, 0.1, hidden=False)
    for blur, factor in itertools.product((0.0, 1.4), (0.1, 10.0)):
        of = likelihood_of(replace(seen, freedom=seen.count, variance=(factor * p.sd[0]) ** 2))
        one = replace(p, log_sd_error=np.full_like(p.log_sd_error, blur)).select(
            (slice(None), of.measured_points)
        )
        options = len(of._option_list.late_share)
        log[blur, factor] = of._log_spread(one, np.tile(one.sd**2, (options, 1, 1)))[0, 0, 0]
    exact = stats.norm(0.0, 2.8).logpdf(2.0 * np.log(10.0))  # of the logarithm
    assert [log[1.4, 0.1], log[1.4, 10.0]] == pytest.approx([exact, exact], abs=0.9)
    assert exact > max(log[0.0, 0.1], log[0.0, 10.0]) + 2.0


def test_numbers_engaged_are_beta_binomial() -> None:
    seen = seen_at(5.0, 0.1, hidden=False)
    engaged, failed = np.array([3.0, 0, 0, 9, 0, 0]), np.array([2.0, 0, 0, 1, 0, 0])
    seen = replace(seen, engaged_count=engaged, failed_count=failed)
    _, model = world()
    p = model.predict(NONE, np.zeros((1, 0)))
    p = replace(p, engaged_share=np.full_like(p.engaged_share, 0.8))
    known = USUAL.late_known
    exact = [stats.betabinom(n, known * 0.8, known * 0.2).logpmf(k) for n, k in ((5, 3), (10, 9))]
    # Between the shares of its table the log probability errs by less than a thousandth.
    assert likelihood_of(seen).log_engaged(p)[0] == pytest.approx(sum(exact), abs=1e-3)


def test_drawn_errors_in_common_have_the_exact_mean_and_covariance() -> None:
    bench, model = world()
    seen = replace(observe(bench, model), hides_late=np.zeros(model.cell_count, dtype=bool))
    seen = replace(seen, freedom=np.zeros(model.cell_count))
    plain = model.predict(NONE, np.zeros((1, 0)))
    seen = replace(seen, mean=plain.mean[0] * np.linspace(1.0, 1.1, model.cell_count))
    # The scale of the force stands for a nuisance: its change of the time is of closed form.
    contact = replace(model, nuisances={"force_scale": model.effects["force_scale"]})
    settings = replace(USUAL, nuisance={"force_scale": 1.1})
    likelihood = Likelihood(bench, seen, contact, settings)
    p = Prediction.concatenate([plain] * 4000)
    amplitude, offset, nuisance, deviates = likelihood.draw_common_errors(
        p, np.random.default_rng(4)
    )
    found = likelihood.terms(plain)
    weights = np.exp(found.log_by_amplitude[0] - logsumexp(found.log_by_amplitude[0]))
    means, covariances, own = list[Array](), list[Array](), list[Array]()
    known = plain.mean[0][:, None] * likelihood.nuisance_errors
    for size in NODES:
        columns = np.hstack(
            [
                USUAL.discrepancy * size * plain.mean[0][:, None] * likelihood.discrepancy_root,
                likelihood.common_errors(plain)[0],
            ]
        )
        signal = columns @ columns.T
        inverse = np.linalg.inv(signal + np.diag(found.variance[0]))
        gain = signal @ inverse
        own.append(known @ known.T @ inverse @ found.residual[0])
        means.append(gain @ found.residual[0])
        covariances.append(signal - gain @ signal)
    mean = np.einsum("k,kc->c", weights, means)
    spread = np.array(means) - mean
    covariance = np.einsum("k,kcd->cd", weights, covariances)
    covariance = covariance + np.einsum("k,kc,kd->cd", weights, spread, spread)
    sd = np.sqrt(np.diag(covariance))
    assert abs(offset.mean(axis=0) - mean).max() < 4.0 * (sd / 4000**0.5).max()
    size = np.outer(sd, sd)
    assert np.cov(offset.T) / size == pytest.approx(covariance / size, abs=0.08)
    part = np.einsum("k,kc->c", weights, own)
    assert abs(part).max() > 1e-4
    assert abs(nuisance.mean(axis=0) - part).max() < 4.0 * (sd / 4000**0.5).max()
    assert amplitude.mean() == pytest.approx(USUAL.discrepancy * weights @ NODES, rel=0.05)
    # Components are orthogonal, so a projection gives the coefficients back.
    errors = likelihood.errors_by_nuisance["force_scale"]
    inverse_columns = np.linalg.pinv(errors.columns).T
    coefficients = nuisance / plain.mean @ inverse_columns
    assert deviates[:, 0] == pytest.approx(errors.deviate(coefficients), abs=1e-9)
    # The changes of the time by known deviates give these deviates.
    exact = np.linspace(-3.0, 3.0, 13)
    moments = model.changes("force_scale", 1.1 ** exact[:, None]).moments
    found_deviates = errors.deviate(moments[..., LOG_MEAN] @ inverse_columns)
    assert found_deviates == pytest.approx(exact, abs=0.1)
