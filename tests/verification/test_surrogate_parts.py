"""Parts of the surrogate against closed forms and second methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.sim.elementwise import Array
from dogshape.surrogate.covariance import (
    Covariance,
    Term,
    distance,
    first_parameters,
    matern,
    wendland,
)
from dogshape.surrogate.model import TERMS, Share, fit, fit_share
from dogshape.surrogate.process import Effort, Process, fit_process
from tests.unit.test_surrogate import MIX, QUICK, exact_time, make_data


def draw_designs(count: int, seed: int = 1) -> Array:
    """Designs of five coordinates."""
    return np.random.default_rng(seed).random((count, 5))


def covariance(seed: int = 0) -> Covariance:
    """A covariance with drawn parameters."""
    theta, bounds = first_parameters(TERMS, 5)
    theta_drawn = theta + 0.3 * np.random.default_rng(seed).standard_normal(len(theta))
    return Covariance(TERMS, 5, np.clip(theta_drawn, *bounds.T))


def test_slopes_of_the_covariance_are_its_differences() -> None:
    model, inputs = covariance(), 0.1 * draw_designs(7)
    total, slopes = model.slopes(inputs)
    assert total == pytest.approx(model.between(inputs, inputs), rel=1e-12)
    for k in range(len(model.theta)):
        step = np.eye(len(model.theta))[k] * 1e-6
        high, low = (replace(model, theta=model.theta + s) for s in (step, -step))
        difference = (high.between(inputs, inputs) - low.between(inputs, inputs)) / 2e-6
        assert slopes[k] == pytest.approx(difference, rel=1e-5, abs=1e-9)


def test_matern_is_that_of_scikit_learn() -> None:
    a, b = draw_designs(20), draw_designs(30, seed=2)
    scales = np.array([0.3, 0.5, 1.0, 2.0, 0.7])
    correlation = matern(distance(a / scales, b / scales))
    assert correlation == pytest.approx(Matern(scales, nu=2.5)(a, b), abs=1e-12)


def density(coordinates: int, functions_for: int) -> Array:
    """Spectral density of Wendland's function over coordinates, times its frequency's power.

    By Bochner it is positive wherever the function is positive definite.
    """
    nodes, weights = np.polynomial.legendre.leggauss(1000)
    distances, order = 0.5 * (nodes + 1.0), 0.5 * coordinates
    radial = 0.5 * weights * wendland(distances, functions_for) * distances**order
    frequencies = np.linspace(1.0, 80.0, 400)
    transform: Array = jv(order - 1.0, np.outer(frequencies, distances)) @ radial
    return transform


@pytest.mark.parametrize("coordinates", [1, 5, 9, 10, 14, 20])
def test_wendland_is_positive_definite_over_its_coordinates(coordinates: int) -> None:
    assert density(coordinates, coordinates).min() > 0.0


def smooth_process(noise: float) -> Process:
    """A process of one smooth term with parameters that are known."""
    inputs = draw_designs(40)[:, :3]
    targets = np.column_stack([np.sin(4 * inputs[:, 0]) + inputs[:, 1], inputs[:, 2]])
    theta, still = np.log([0.4, 0.5, 0.8, 1.2]), Effort(steps=0)
    return fit_process((Term(),), inputs, targets, np.array([noise]), start=theta, effort=still)


def test_the_process_is_that_of_scikit_learn() -> None:
    """The same posterior, mean and covariance, of the first of two targets."""
    process, points = smooth_process(0.01), draw_designs(15, seed=2)[:, :3]
    level, scale = process.level[0], process.scale[0]
    mean, joint = process.predict_jointly(points)
    kernel = ConstantKernel(0.4) * Matern([0.5, 0.8, 1.2], nu=2.5)
    regressor = GaussianProcessRegressor(kernel, alpha=process.noise, optimizer=None)
    regressor.fit(process.inputs, (process.targets[:, 0] - level) / scale)
    expected, spread = regressor.predict(points, return_cov=True)
    assert mean == pytest.approx(expected * scale + level, abs=1e-9)
    assert joint == pytest.approx(spread * scale**2, abs=1e-9)
    means, variance = process.predict(points)
    assert means[:, 0] == pytest.approx(mean)
    assert variance[:, 0] == pytest.approx(np.diag(joint))


def test_a_design_left_out_is_predicted_from_the_others() -> None:
    process = smooth_process(0.01)
    mean, variance = process.leave_one_out()
    for k in (0, 7, 39):
        mask = np.arange(40) != k
        reduced = replace(
            process, inputs=process.inputs[mask], targets=process.targets[mask],
            noise=process.noise[mask],
        )  # fmt: skip
        prediction, uncertainty = reduced.predict(process.inputs[k : k + 1])
        assert mean[k] == pytest.approx(prediction[0])
        assert variance[k] == pytest.approx(uncertainty[0])


def test_the_fit_finds_the_likeliest_parameters() -> None:
    """Scikit-learn's likelihood of a smooth term has its optimum where the fit ends."""
    inputs = draw_designs(60)[:, :2]
    targets = np.sin(5 * inputs[:, :1]) + np.cos(7 * inputs[:, 1:])
    process = fit_process((Term(),), inputs, targets, np.array([1e-4]))
    variance, *scales = np.exp(process.covariance.theta)
    kernel = ConstantKernel(variance, (1e-6, 100.0)) * Matern(scales, (0.2, 30.0), nu=2.5)
    scaled = ((targets - process.level) / process.scale)[:, 0]
    regressor = GaussianProcessRegressor(kernel, alpha=process.noise).fit(inputs, scaled)
    likelihood = regressor.log_marginal_likelihood(kernel.theta)
    assert likelihood == pytest.approx(regressor.log_marginal_likelihood_value_, abs=0.05)


def test_share_follows_the_counts_where_they_are() -> None:
    rng = np.random.default_rng(0)
    designs, points = rng.random((300, 1)), np.array([[0.5, 0.5], [0.2, 0.7]])
    truth = np.tile(np.where(designs < 0.5, 0.95, 0.2), 2)
    engaged, shifts = rng.binomial(8, truth).astype(float), np.full((300, 2), 8.0)
    share = fit_share(designs, points, engaged, shifts)
    assert share.length < 0.5
    shares = share.predict(np.array([[0.1], [0.9]]), points)[0]
    assert shares[:, 0] == pytest.approx([0.95, 0.2], abs=0.08)


def test_share_of_one_count_is_the_beta_mean() -> None:
    origin = np.zeros((1, 2))
    single = Share(origin, origin, np.array([[6.0]]), np.array([[8.0]]), 0.3, 2.0)
    share, variance = single.predict(origin, origin)
    prior = 6.5 / 9.0
    a, b = 6.0 + 2.0 * prior, 2.0 + 2.0 * (1.0 - prior)
    assert share[0, 0] == pytest.approx(a / (a + b))
    assert variance[0, 0] == pytest.approx(a * b / ((a + b) ** 2 * (a + b + 1.0)))


def test_noise_does_not_draw_times_down() -> None:
    """Lucky designs with small standard errors must not outweigh the others."""
    data = make_data(60, noise=0.0)
    shifts = np.random.default_rng(4).gamma(4.0, 0.25, (*data.grid.means.shape, 8))  # skewed
    means = data.grid.means * shifts.mean(axis=2)
    errors = means * shifts.std(axis=2, ddof=1) / shifts.mean(axis=2) / 8**0.5
    model = fit(replace(data, grid=replace(data.grid, means=means, errors=errors)), QUICK)
    ratios = model.predict(data.grid.x, replace(MIX, retry=0.0))[0] / [
        exact_time(x) for x in data.grid.x
    ]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.035)  # 3 s.e.
