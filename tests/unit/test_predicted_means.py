"""Means predicted from all other points, and densities of a joint posterior, by closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.reading import gather
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.joint_posterior import (
    density,
    held,
    joint_posterior,
    window_of,
)
from dogshape.diagnosis.inference.predicted_means import SHARES, predicted_means
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.likelihood.time_parts import outlier_delay
from dogshape.diagnosis.prediction.hypotheses import NONE, spaces_for
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import Hypothesis
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of((235.2, 641.5))
EFFECT = {name: EFFECTS[name] for name in ("actuation_delay", "moving_mass")}
PAIR = ("actuation_delay", "moving_mass")
SURE = replace(USUAL, likelihood=replace(USUAL.likelihood, discrepancy=0.0))


def _fitted(bench: Bench, hypothesis: Hypothesis, settings: Settings) -> tuple[Problem, Scored]:
    problem = Problem(observe(bench), Toy(POINTS), settings, bench.mismatch_sense)
    (space,) = spaces_for([hypothesis], EFFECT, setting_of(bench))
    return problem, evidence(problem, space)


def _bench(seed: int, values: dict[str, float], shifts: int = 30) -> Bench:
    generator = np.random.default_rng(seed)
    return bench_of(values, generator, shifts=shifts, points=POINTS)


def test_without_parameters_and_discrepancy_it_is_the_density_of_a_mean() -> None:
    """Normal parts by the number of late shifts, whose distribution function is known."""
    problem, one = _fitted(_bench(1, {}), NONE, SURE)
    found = predicted_means(problem, one)
    predicted = problem.predictions(NONE, np.zeros((1, 0)))
    late, wide = outlier_delay(problem.seen, predicted)
    for cell in (0, 5, 13):
        n = problem.seen.shifts[cell]
        number = np.arange(n + 1)
        chances = binom.pmf(number, n, predicted.outlier_share[cell, 0])
        middle = predicted.mean[cell, 0] + number * late[cell, 0] / n
        square = predicted.sd[cell, 0] ** 2 / n + predicted.error[cell, 0] ** 2
        sd = np.sqrt(square + number * (wide[cell, 0] / n) ** 2)
        below = [(chances * norm.cdf(q, middle, sd)).sum() for q in found.quantiles[cell]]
        # Of 2000 draws a share is known to 0.011 at the middle.
        assert below == pytest.approx(SHARES, abs=0.034)
        seen = (chances * norm.cdf(problem.seen.time[cell], middle, sd)).sum()
        assert found.below[cell] == pytest.approx(seen, abs=0.034)


def test_intervals_hold_as_many_as_they_say() -> None:
    """Of data that the hypothesis made, with no more error than is declared."""
    inside = []
    for seed in range(4):
        problem, one = _fitted(_bench(seed, {"delay_s": 0.08}), ("actuation_delay",), USUAL)
        inside.append(predicted_means(problem, one).inside)
    # Declared errors are larger than the toy's, which has none: more than 90 % may be inside.
    assert np.mean(inside) > 0.85


def test_a_point_does_not_predict_itself() -> None:
    """A mean that is moved lies outside, and moves its own interval not at all."""
    bench = _bench(3, {"delay_s": 0.08})
    moved = [
        replace(r, time=r.time + 0.06) if r.point == POINTS[4] and r.time else r
        for r in bench.readings
    ]
    found, other = (
        predicted_means(*_fitted(one, ("actuation_delay",), SURE))
        for one in (bench, replace(bench, cells=gather(moved)))
    )
    assert found.inside[4]
    assert not other.inside[4]
    assert other.quantiles[4] == pytest.approx(found.quantiles[4], abs=0.5e-3)


def test_record_has_the_points_with_a_time() -> None:
    problem, one = _fitted(_bench(1, {"delay_s": 0.08}), ("actuation_delay",), USUAL)
    found = predicted_means(problem, one)
    record = found.as_dict([(1.0, 2.0)] * len(POINTS))
    assert record["of"] == len(record["cells"]) == len(POINTS)
    assert record["within_90"] == int(found.inside.sum())
    assert all(np.diff(cell["quantiles_s"]).min() >= 0.0 for cell in record["cells"])


def test_draws_have_the_posterior_mean_and_an_amplitude() -> None:
    for hypothesis in (("actuation_delay",), PAIR):
        _, one = _fitted(_bench(2, {"delay_s": 0.08}), hypothesis, USUAL)
        drawn = joint_posterior(one)
        mean = one.weights() @ one.rows.shares
        spread = np.sqrt(one.weights() @ (one.rows.shares - mean) ** 2)
        assert np.abs(drawn.shares.mean(axis=0) - mean) == pytest.approx(0.0 * mean, abs=0.01)
        assert drawn.shares.std(axis=0) == pytest.approx(spread, rel=0.15)
        assert drawn.amplitude is not None
        assert 0.0 < np.median(drawn.amplitude) < 0.1
    _, sure = _fitted(_bench(2, {"delay_s": 0.08}), PAIR, SURE)
    assert joint_posterior(sure).amplitude is None


def test_density_is_one_in_all_and_flat_for_even_draws() -> None:
    grid = np.linspace(0.0, 1.0, 201)
    even = (np.arange(600) + 0.5) / 600
    flat = density(even, grid, 600.0)
    # Mirrored at the ends, so that nothing is lost there.
    assert flat == pytest.approx(np.ones(201), abs=0.02)
    normal = norm.ppf(even, 0.4, 0.05)
    assert np.trapezoid(density(normal, grid, 600.0), grid) == pytest.approx(1.0, abs=1e-3)


def test_region_of_a_normal_is_its_ellipse() -> None:
    """Its area is pi chi2 root det, of the draws' covariance with that of the kernels."""
    generator = np.random.default_rng(1)
    matrix = np.array([[4.0, 3.0], [3.0, 4.0]]) * 1e-4
    x, y = generator.multivariate_normal([0.5, 0.4], matrix, 4000).T
    grids = np.linspace(0.4, 0.6, 161), np.linspace(0.3, 0.5, 161)
    mass = held(x, y, grids, 4000.0)
    size = (1.0 + 4000.0 ** (-1.0 / 3.0)) * np.sqrt(np.linalg.det(matrix))
    cell = (0.2 / 160.0) ** 2
    for share in (0.5, 0.9):
        area = (mass < share).sum() * cell
        assert area == pytest.approx(np.pi * chi2.ppf(share, 2) * size, rel=0.06)


def test_a_window_shows_the_draws_within_the_prior() -> None:
    low, high = window_of(np.random.default_rng(1).normal(0.5, 0.01, 600))
    assert 0.4 < low < 0.47
    assert 0.53 < high < 0.6
    assert window_of(np.linspace(0.0, 1.0, 50)) == (0.0, 1.0)
