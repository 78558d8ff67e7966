"""Predicted outcomes: densities, updates and worth in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from dogshape.diagnosis.inference.outcome import Outcome, smoothed
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis

LAG, MASS = ("actuation_lag",), ("moving_mass",)
ODDS, NAMED = 0.15 * 0.5 / 0.85, 0.8


def _normal(means: dict[Hypothesis, float], sd: float = 1.0) -> Outcome:
    """Densities of one value, one of each hypothesis; unknown lies far off."""
    every = means | {UNKNOWN: 1e3}
    one = {h: (np.ones(1), np.array([[m]]), np.array([[[sd**2]]])) for h, m in every.items()}
    return Outcome.of(one, lambda _: False)


def _before(*chances: float) -> np.ndarray:
    return np.array([*chances, 1e-12]) / (sum(chances) + 1e-12)


@pytest.mark.parametrize(("apart", "chance"), [(0.5, 0.5), (2.0, 0.5), (3.0, 0.2), (6.0, 0.7)])
def test_information_and_chances_of_two_normal_densities(apart: float, chance: float) -> None:
    """Mutual information by quadrature; the truth is named where its odds exceed 4 : 1."""
    outcome = _normal({LAG: 0.0, MASS: apart})
    chances = {0.0: chance, apart: 1.0 - chance}

    def gain(y: float) -> float:
        parts = [p * norm.pdf(y, m) for m, p in chances.items()]
        each = [
            part * np.log(part / p / sum(parts))
            for part, p in zip(parts, chances.values(), strict=True)
        ]
        return float(sum(each))

    information = quad(gain, -8.0, apart + 8.0, limit=200)[0]
    # Log odds of y, apart^2/2 - y apart + ln(p/(1 - p)), exceed ln 4 below this point.
    first, second = (
        apart / 2.0 + sign * (np.log(chance / (1.0 - chance)) * sign - np.log(4.0)) / apart
        for sign in (1.0, -1.0)
    )
    right = chance * norm.cdf(first) + (1.0 - chance) * norm.sf(second, apart)
    wrong = chance * norm.sf(second) + (1.0 - chance) * norm.cdf(first, apart)
    found = np.array([outcome.worth(_before(*chances.values()), 0.0, NAMED, k) for k in range(100)])
    mean, error = found.mean(axis=0), 4.0 * found.std(axis=0) / np.sqrt(len(found))
    assert abs(mean - [information, right, wrong]) == pytest.approx(0.0, abs=float(max(error)))
    assert max(error) < 0.02


def test_few_draws_keep_mean_and_covariance_of_many() -> None:
    generator = np.random.default_rng(3)
    draws = generator.normal(size=(48, 2)) @ np.array([[1.0, 0.6], [0.0, 0.5]])
    error = 0.01 * np.eye(2)
    share, mean, covariance = smoothed(draws, np.tile(error, (48, 1, 1)))
    assert share @ mean == pytest.approx(draws.mean(axis=0))
    left = mean - mean.mean(axis=0)
    whole = np.einsum("k,kij->ij", share, covariance) + left.T @ (share[:, None] * left)
    assert whole == pytest.approx(np.cov(draws.T, ddof=0) + error)


def test_densities_are_those_of_a_mixture_and_draws_follow_them() -> None:
    parts = {
        LAG: (np.array([0.25, 0.75]), np.array([[0.0], [4.0]]), np.array([[[1.0]], [[0.25]]])),
        UNKNOWN: (np.ones(1), np.array([[9.0]]), np.array([[[1.0]]])),
    }
    outcome = Outcome.of(parts, lambda _: True)
    assert outcome.read.tolist() == [True, False]
    density = np.exp(outcome.log_density(np.array([[3.0]])))[0]
    assert density[0] == pytest.approx(0.25 * norm.pdf(3.0) + 0.75 * norm.pdf(3.0, 4.0, 0.5))
    drawn = outcome.draw(np.repeat([0, 1], 20000), np.random.default_rng(1))[:, 0]
    assert drawn[:20000].mean() == pytest.approx(3.0, abs=0.06)
    assert drawn[:20000].var() == pytest.approx(0.25 * (1.0 + 9.0) + 0.75 * (0.25 + 1.0), rel=0.06)
    assert drawn[20000:].min() > 4.0


def _reading() -> Outcome:
    """A direct test of the lag: 0.7 of its range, or nothing; unknown nothing, half, or 0.7."""
    small = np.array([[[0.0025]]])
    parts = {
        LAG: (np.ones(1), np.array([[0.7]]), small),
        MASS: (np.ones(1), np.array([[0.0]]), small),
        UNKNOWN: (np.array([0.5, 0.5]), np.array([[0.0], [0.7]]), np.repeat(small, 2, 0)),
    }
    return Outcome.of(parts, {"actuation_lag"}.intersection)


def test_a_negative_reading_does_not_hand_its_probability_to_the_runner_up() -> None:
    """A lag of 0.96 is not found: without imitators the mass would be named."""
    read, before = _reading(), _before(0.96, 0.04)
    log = read.log_density(np.array([[0.0]]))
    assert read.after(before, log, 0.0)[0, 1] > 0.99
    lag, mass, unknown = read.after(before, log, ODDS)[0]
    # Odds: half of the lag's imitator to the mass.
    assert unknown / mass == pytest.approx(0.5 * 0.96 * ODDS / (1.0 + ODDS) / 0.04, rel=1e-4)
    assert (lag, mass) < (1e-6, 0.6)


def test_an_imitator_counts_with_its_hypothesis_until_an_outcome_tells_them_apart() -> None:
    read, before = _reading(), _before(0.7, 0.3)
    same = replace(read, mean=0.0 * read.mean)
    assert same.after(before, same.log_density(np.zeros((1, 1))), ODDS)[0] == pytest.approx(before)
    assert read.after(before, read.log_density(np.array([[0.7]])), ODDS)[0, 0] > 0.9


def test_a_value_that_is_not_shown_does_not_count() -> None:
    """Two values that err together: their difference tells all, the second alone little."""
    whole = np.array([[[1.0, 0.99], [0.99, 1.0]]])
    parts = {
        LAG: (np.ones(1), np.array([[0.0, 0.0]]), whole),
        MASS: (np.ones(1), np.array([[0.0, 1.0]]), whole),
        UNKNOWN: (np.ones(1), np.full((1, 2), 1e3), whole),
    }
    both = Outcome.of(parts, lambda _: False)
    assert both.after(_before(0.5, 0.5), both.log_density(np.array([[3.0, 3.0]])), 0)[0, 0] > 0.999
    second = both.only(np.array([False, True]))
    after = second.after(_before(0.5, 0.5), second.log_density(np.array([[3.0]])), 0.0)[0]
    assert after[1] / after[0] == pytest.approx(np.exp(2.5))
