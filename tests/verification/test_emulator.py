"""Emulator of an effect's changes, and modes of uneven angles, against second methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.emulator import AMPLITUDES, LENGTHS, Emulator, Kernel
from dogshape.diagnosis.prediction.model import _two_modes
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, Array
from tests.verification.test_likelihood import world

NOISE = 0.05
X = np.linspace(0.0, 1.0, 9)[:, None]
NOWHERE = np.zeros((0, 1))


def _fitted(values: Array, plain: Array = NOWHERE, common: float = 1e-9) -> Emulator:
    found = np.append(values, 0.0)[None]
    return Emulator.fitted(X, plain, found, np.array([NOISE]), np.array([common]))


def test_the_process_is_that_of_scikit_learn() -> None:
    """Without neutral values and common errors: mean and error, best of the same amplitudes."""
    values = np.sin(3.0 * X[:, 0]) + NOISE * np.random.default_rng(1).standard_normal(9)
    places = np.array([[0.03], [0.41], [0.77]])
    mine = _fitted(values)
    mean, error, _ = replace(mine, misfit=np.ones((1, 9))).at(places, np.zeros((9, 0)), 1)
    kernels = [
        ConstantKernel((a * NOISE) ** 2, "fixed") * Matern(length, "fixed", nu=1.5)
        for a in AMPLITUDES
        for length in LENGTHS
    ]
    fits = [GaussianProcessRegressor(one, alpha=NOISE**2).fit(X, values) for one in kernels]
    theirs = [one.predict(places, return_std=True) for one in fits]
    near = [
        np.allclose(m, mean[:, 0], atol=1e-9) and np.allclose(s, error[:, 0]) for m, s in theirs
    ]
    assert sum(near) == 1
    best = max(fits, key=lambda one: one.log_marginal_likelihood_value_)
    assert best.kernel_.k2.length_scale == mine.kernel.length
    square = np.empty(9)
    for k in range(9):
        others = np.arange(9) != k
        one = GaussianProcessRegressor(best.kernel_, alpha=NOISE**2).fit(X[others], values[others])
        expected, sd = one.predict(X[[k]], return_std=True)
        square[k] = (values[k] - expected[0]) ** 2 / (sd[0] ** 2 + NOISE**2)
    assert mine.misfit[0] == pytest.approx(np.maximum(square, max(1.0, square.mean())))


def test_a_change_is_zero_and_certain_at_neutral_values() -> None:
    plain = np.array([[0.25]])
    mean, error, _ = _fitted(X[:, 0] - 0.25, plain).at(plain, np.zeros((9, 0)), 1)
    assert abs(mean[0, 0]) < 1e-6
    assert error[0, 0] < 1e-4
    assert Kernel(plain, 0.5).own(plain) == pytest.approx(0.0, abs=1e-6)


def test_one_chaotic_level_does_not_bend_the_others() -> None:
    """A level off by four errors is taken as noise; an interpolation would go through it."""
    line = 0.3 * X[:, 0]
    off = line.copy()
    off[4] += 4.0 * NOISE
    mean, _, _ = _fitted(off, X[:1]).at(X, np.zeros((9, 0)), 1)
    assert abs(mean[:, 0] - line).max() < 1.3 * NOISE


def test_two_modes_have_the_moments_of_all_times() -> None:
    """Times around 50 and 150 ms: the larger mode, its mean and its deviation, by hand."""
    times = np.array([[0.049, 0.150, 0.051, 0.050]])
    share, mean, sd = _two_modes(times, np.array([[[2.0, 1.0, 2.0, 5.0]]]))[:, 0, 0]
    whole = 0.9 * 0.05 + 0.1 * 0.15
    variance = 0.4 * 0.001**2 + 0.9 * (0.05 - whole) ** 2 + 0.1 * (0.15 - whole) ** 2
    assert (share, mean) == pytest.approx((0.1, 0.05 / whole))
    assert sd == pytest.approx((0.4 / 0.9) ** 0.5 * 0.001 / variance**0.5)


def test_shifts_with_and_without_the_rare_mode_have_the_moments_of_all() -> None:
    bench, model = world()
    likelihood = Likelihood(bench, observe(bench, model), model, USUAL)
    p = model.predict(NONE, np.zeros((1, 0)))
    one = np.ones_like(p.mean)
    p = replace(p, minor=0.1 * one, main=-0.2 * p.sd, narrow=0.5 * p.sd)
    q = p.only((slice(None), likelihood.having))
    log, offset, variance = likelihood._modes(q)
    assert log[1] == pytest.approx(likelihood.seen.count[likelihood.having][None] * np.log(0.9))
    shares = np.exp(log)
    assert shares.sum(axis=0) == pytest.approx(1.0)
    assert (shares * offset).sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert (shares * variance).sum(axis=0) == pytest.approx(q.sd**2)
