"""Parts of the surrogate against closed forms and second methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.pipeline.search.guide import TERMS
from dogshape.surrogate.covariance import Array, Covariance, Term, matern, starting, wendland
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.learning import fit
from dogshape.surrogate.model import POINT, ROUGH, SMOOTH, STEPS, Share, Surrogate, fit_share
from dogshape.surrogate.process import Process, known_noise
from tests.unit.test_surrogate import GRID, HIGH, LOW, MIX, QUICK, exact, made

WHOLE = (POINT, SMOOTH, STEPS, ROUGH)


def covariance(terms: tuple[Term, ...], designs: int = 3, seed: int = 0) -> Covariance:
    """A covariance with drawn parameters."""
    theta, bounds = starting(terms, designs, 2)
    moved = theta + 0.3 * np.random.default_rng(seed).standard_normal(len(theta))
    return Covariance(terms, designs, 2, np.clip(moved, *bounds.T))


def places(count: int, seed: int = 1) -> Array:
    """Inputs of three designs' and two points' coordinates."""
    return np.random.default_rng(seed).random((count, 5))


def test_slopes_of_the_covariance_are_its_differences() -> None:
    at, inputs = covariance(WHOLE), places(7)
    whole, slopes = at.slopes(inputs)
    assert whole == pytest.approx(at.between(inputs, inputs), rel=1e-12)
    for k in range(len(at.theta)):
        step = np.eye(len(at.theta))[k] * 1e-6
        high, low = (replace(at, theta=at.theta + s) for s in (step, -step))
        difference = (high.between(inputs, inputs) - low.between(inputs, inputs)) / 2e-6
        assert slopes[:, :, k] == pytest.approx(difference, rel=1e-5, abs=1e-9)


def test_the_covariance_is_symmetric_and_positive() -> None:
    at, inputs = covariance(WHOLE), places(130)
    matrix = at.among(inputs)
    assert matrix == pytest.approx(at.between(inputs, inputs), rel=1e-12)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    assert np.diag(matrix) == pytest.approx(at.variance(inputs), rel=1e-12)


def test_matern_is_that_of_scikit_learn() -> None:
    a, b = places(20), places(30, seed=2)
    scales = np.array([0.3, 0.5, 1.0, 2.0, 0.7])
    assert matern(a / scales, b / scales) == pytest.approx(Matern(scales, nu=2.5)(a, b), abs=1e-12)


def test_wendland_ends_at_one_and_is_positive_definite_over_eight_coordinates() -> None:
    assert wendland(np.array([0.0, 0.5, 1.0, 3.0]), 8) == pytest.approx([1.0, 4.5 / 2**7, 0.0, 0.0])
    places = np.random.default_rng(0).random((200, 8))
    apart = np.sqrt(((places[:, None] - places[None]) ** 2).sum(axis=2))
    for reach in (0.3, 1.0, 3.0):
        correlation = wendland(apart / reach, 8)
        assert (correlation == 0.0).any() == (reach < apart.max())
        assert np.linalg.eigvalsh(correlation).min() > 0.0


def density(coordinates: int, functions_for: int) -> Array:
    """Spectral density of Wendland's function over coordinates, times its frequency's power.

    By Bochner it is positive wherever the function is positive definite.
    """
    nodes, weights = np.polynomial.legendre.leggauss(1000)
    apart, half = 0.5 * (nodes + 1.0), 0.5 * coordinates
    radial = 0.5 * weights * wendland(apart, functions_for) * apart**half
    frequencies = np.linspace(1.0, 80.0, 400)
    found: Array = jv(half - 1.0, np.outer(frequencies, apart)) @ radial
    return found


@pytest.mark.parametrize("coordinates", [1, 5, 9, 10, 14, 20])
def test_wendland_is_positive_definite_over_its_coordinates(coordinates: int) -> None:
    assert density(coordinates, coordinates).min() > 0.0


def test_a_rough_term_over_twenty_coordinates_is_positive_semidefinite() -> None:
    """The function of nine coordinates is not, as its density tells; a free guide's terms are."""
    assert density(20, 9).min() < -1e-9  # rounding: 1e-17
    theta, _ = starting(TERMS, 20, 0)
    designs = np.random.default_rng(0).random((300, 20))
    for spread in (0.02, 0.1, 1.0):  # within the reach of what is rough, and beyond
        found = Covariance(TERMS, 20, 0, theta).among(spread * designs)
        assert np.linalg.eigvalsh(found).min() > -1e-12
        assert found == pytest.approx(found.T)


def test_the_process_is_that_of_scikit_learn() -> None:
    """One smooth term over one factor: the same posterior, mean and covariance."""
    term = Term(design=True, point=False)
    at = Covariance((term,), 3, 2, np.log([0.4, 0.5, 0.8, 1.2]))
    inputs, asked = places(40), places(15, seed=2)
    targets = np.sin(4 * inputs[:, 0]) + inputs[:, 1]
    noise = np.full(40, 0.01)
    mean, joint = Process(at, inputs, targets, noise).joint(asked)
    kernel = ConstantKernel(0.4) * Matern([0.5, 0.8, 1.2], nu=2.5)
    other = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None)
    other.fit(inputs[:, :3], targets - targets.mean())
    expected, spread = other.predict(asked[:, :3], return_cov=True)
    assert mean == pytest.approx(expected + targets.mean(), abs=1e-9)
    assert joint == pytest.approx(spread, abs=1e-9)


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """A surrogate of few designs of the known function."""
    return fit(made(20), effort=QUICK)


def test_known_designs_keep_what_only_they_tell(surrogate: Surrogate) -> None:
    """At known designs, and a step beside, the rough part is that of the whole process."""
    over, known = Over(surrogate, MIX), surrogate.data.designs[:3]
    x = np.concatenate([known, known + 0.02 * (HIGH - LOW), made(2, seed=5).designs])
    shares = over.times(surrogate.known).mean(axis=0) * MIX.weights
    shares /= shares.sum()
    variance = [
        shares @ surrogate.times.joint(surrogate.crossed(row[None, :], GRID))[1] @ shares
        for row in x
    ]
    features = over._features(surrogate.coordinates(x))
    assert over._relative_variance(features) == pytest.approx(variance, rel=1e-5)
    assert surrogate.times.covariance.parts[-1].rough
    assert variance[0] < variance[3] < variance[-1]


def test_share_follows_the_counts_where_they_are() -> None:
    rng = np.random.default_rng(0)
    inputs = rng.random((300, 3))
    truth = np.where(inputs[:, 0] < 0.5, 0.95, 0.2)
    engaged, shifts = rng.binomial(8, truth).astype(float), np.full(300, 8.0)
    share = fit_share(1, inputs, (engaged, shifts), np.arange(300))
    assert share.length < 0.5
    found = share.at(np.array([[0.1, 0.5, 0.5], [0.9, 0.5, 0.5]]))[0]
    assert found == pytest.approx([0.95, 0.2], abs=0.08)
    known, place = inputs[:, :1], np.arange(300)
    nodes = np.array([[0.5, 0.5], [0.2, 0.7]])
    many = share.over(np.array([[0.1], [0.9]]), nodes, known, place)[0]
    assert many[:, 0] == pytest.approx(found, rel=1e-9)


def test_share_of_one_count_is_the_beta_mean() -> None:
    one = Share(1, np.zeros((1, 3)), np.array([6.0]), np.array([8.0]), 0.3, 2.0)
    share, variance = one.at(np.zeros((1, 3)))
    prior = 6.5 / 9.0
    a, b = 6.0 + 2.0 * prior, 2.0 + 2.0 * (1.0 - prior)
    assert share[0] == pytest.approx(a / (a + b))
    assert variance[0] == pytest.approx(a * b / ((a + b) ** 2 * (a + b + 1.0)))


def test_noise_does_not_draw_times_down() -> None:
    """Lucky rows with small standard errors must not outweigh the others."""
    data = made(60, noise=0.0)
    rng = np.random.default_rng(4)
    rows = data.rows.copy()
    shifts = rng.gamma(4.0, 0.25, (len(rows), 8))  # skewed: mean and deviation go together
    rows[:, 5] *= shifts.mean(axis=1)
    rows[:, 6] = rows[:, 5] * shifts.std(axis=1, ddof=1) / shifts.mean(axis=1) / 8**0.5
    skewed = replace(data, rows=rows)
    noise = known_noise(skewed)
    own = (rows[:, 6] / rows[:, 5]) ** 2
    assert noise.std() / noise.mean() < 0.3 * own.std() / own.mean()
    model = fit(skewed, effort=QUICK)
    found = [model.expected(x, replace(MIX, retry=0.0)).time / exact(x) for x in data.designs]
    assert np.mean(found) == pytest.approx(1.0, abs=0.035)  # 3 s.e.


def test_designs_are_scaled_to_their_range(surrogate: Surrogate) -> None:
    where = surrogate.coordinates(np.array([LOW, HIGH]))
    assert where[:, :3] == pytest.approx(np.array([[0.0] * 3, [1.0] * 3]))
    # An angle's ridge ends at the friction coefficient's either side.
    assert where[:, 3] == pytest.approx([np.tanh(-0.1 / 0.04), 1.0], abs=1e-4)
