"""The expected shift time against cases that can be worked out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sim.clutch import OperatingPoint
from sim.engagement import Outcome
from sim.expectation import ShiftResult, expect, expect_point, stratified_phases

Point = Callable[[float, float], OperatingPoint]


def _shifts(*times: float | None) -> list[ShiftResult]:
    return [ShiftResult(Outcome.ENGAGED if t else Outcome.BLOCKED, t) for t in times]


def test_retries_until_it_engages(point: Point) -> None:
    """p = 3/4: a third of a failed attempt on average, each 1.2 s."""
    result = expect_point(point(50, 469.0), _shifts(0.05, 0.06, None, 0.07), 1.0, 0.2)
    assert result.mean_engaged == pytest.approx(0.06)
    assert result.mean == pytest.approx(0.06 + 1.2 / 3)
    assert result.engaged == 0.75


def test_retry_formula_against_a_drawn_experiment(point: Point) -> None:
    rng = np.random.default_rng(5)
    share, total = 0.7, []
    for _ in range(20_000):
        failures = rng.geometric(share) - 1
        total.append(failures * 1.2 + 0.08)
    shifts = _shifts(*[0.08] * 7, *[None] * 3)
    result = expect_point(point(50, 469.0), shifts, 1.0, 0.2)
    assert np.mean(total) == pytest.approx(result.mean, rel=0.03)


def test_failed_integrations_are_left_out(point: Point) -> None:
    failed = ShiftResult(Outcome.DIVERGED, None)
    result = expect_point(point(50, 469.0), [*_shifts(0.05, 0.07), failed], 1.0, 0.2)
    assert (result.n, result.engaged) == (2, 1.0)
    assert result.mean == pytest.approx(0.06)


def test_nothing_engaged_gives_a_lower_bound(point: Point) -> None:
    result = expect_point(point(50, 469.0), _shifts(None, None), 1.0, 0.2)
    assert result.mean_engaged is None
    assert result.mean == pytest.approx(1.0 + 2 * 1.2)
    assert result.engaged == 0.0


def test_strata_hold_one_angle_each_and_depend_on_the_point() -> None:
    phases = stratified_phases(8, seed=3, index=2)
    assert (np.floor(phases * 8) == np.arange(8)).all()
    assert (phases == stratified_phases(8, seed=3, index=2)).all()
    assert (phases != stratified_phases(8, seed=3, index=1)).any()


def test_standard_error_covers_the_scatter_of_stratified_means(point: Point) -> None:
    """Over many draws of a saw-tooth with a jump, the error is no smaller than the scatter."""

    def saw(phase: float) -> float:
        return 0.05 + (0.1 * phase if phase < 0.6 else 0.02)

    means, errors = [], []
    for seed in range(300):
        times = [saw(p) for p in stratified_phases(6, seed, 0)]
        result = expect_point(point(50, 469.0), _shifts(*times), 1.0, 0.2)
        means.append(result.mean)
        errors.append(result.standard_error)
    exact = 0.05 + 0.1 * 0.6**2 / 2 + 0.02 * 0.4
    assert np.mean(means) == pytest.approx(exact, abs=4 * np.std(means) / np.sqrt(300))
    assert np.std(means) <= np.mean(errors) <= 3 * np.std(means)


def test_standard_error_of_a_smooth_time_is_unbiased(point: Point) -> None:
    """Many strata of a triangle wave: root-mean-square error equals the scatter."""
    means, variances = [], []
    for seed in range(400):
        times = [0.05 + 0.1 * abs(p - 0.5) for p in stratified_phases(40, seed, 0)]
        result = expect_point(point(50, 469.0), _shifts(*times), 1.0, 0.2)
        means.append(result.mean)
        variances.append(result.standard_error**2)
    assert np.sqrt(np.mean(variances)) == pytest.approx(np.std(means), rel=0.12)


def test_weights_and_independent_errors(point: Point) -> None:
    a = expect_point(point(50, 469.0), _shifts(0.04, 0.05, 0.06), 1.0, 0.2, stratified=False)
    b = expect_point(point(100, 469.0), _shifts(0.10, 0.12, 0.14), 1.0, 0.2, stratified=False)
    both = expect([a, b])
    assert both.mean == pytest.approx(0.085)
    assert both.standard_error == pytest.approx(0.5 * np.hypot(0.01, 0.02) / np.sqrt(3))
