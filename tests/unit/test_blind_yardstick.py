"""Noncentrality of made-up truths under a made-up model, against closed forms."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import norm

from dogshape.bench.stand_file import NominalErrors, RelativeMargin
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import Observations
from dogshape.diagnosis.prediction.baseline import LateDelay
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.validation.blind.data import Expected
from dogshape.validation.blind.yardstick import Yardstick, power_of, rivals_of, visible_causes

FORCES, SPEEDS = np.meshgrid([200.0, 400.0, 600.0], [1.0, 3.0, 8.0, 20.0])
CELLS = FORCES.size
TILT = np.linspace(-1.0, 1.0, CELLS)
BASE, SD, N = 0.1, 0.01, 10.0
EFFECTS = ("delay", "scale", "tilt")


class _Model:
    """Effects of one share: a dead time to 0.1 s, a scale and a tilt of the times to a half."""

    effects: ClassVar = dict.fromkeys(EFFECTS)
    nuisances: ClassVar[dict[str, Any]] = {}
    reversed_model, cell_count = None, CELLS
    baseline = SimpleNamespace(
        kurtosis=np.zeros(CELLS),
        late_delay=LateDelay(np.full(CELLS, 0.3), np.full(CELLS, 0.1)),
    )

    def space(self, hypothesis: Hypothesis) -> Any:
        return SimpleNamespace(parameters=hypothesis)

    def possible(self, hypothesis: Hypothesis, shares: Array) -> Array:
        return np.ones(len(shares), dtype=bool)

    def predict(self, hypothesis: Hypothesis, shares: Array) -> Prediction:
        delay, mean = np.zeros((len(shares), 1)), np.full((len(shares), CELLS), BASE)
        for name, share in zip(hypothesis, shares.T[..., None], strict=True):
            if name == "delay":
                delay = 0.1 * share
            else:
                mean = mean + BASE * 0.5 * share * (TILT if name == "tilt" else 1.0)
        zeros, ones = 0.0 * mean, np.ones_like(mean)
        fields = mean + delay, SD * ones, zeros, zeros, zeros, 1e-3 * ones, ones, delay + zeros
        return Prediction(*fields, ones, zeros, SD * ones, zeros, zeros)


def _yardstick(mean: Array | float = BASE, discrepancy: float = 1e-9, n: float = N) -> Yardstick:
    """A truth with expected means; single shifts are not known."""
    zeros, count = np.zeros(CELLS), np.full(CELLS, n)
    seen = Observations(
        count, zeros + BASE, zeros + SD**2, zeros, zeros, zeros > 0.0,
        count, zeros, SPEEDS.ravel(), FORCES.ravel(), None, (), None,
    )  # fmt: skip
    bench: Any = SimpleNamespace(
        measured=(), errors=NominalErrors(), margin=RelativeMargin(), clock_step=0.0
    )
    model: Any = _Model()
    likelihood = Likelihood(bench, seen, model, replace(USUAL, discrepancy=discrepancy))
    sd = np.full(CELLS, SD)
    return Yardstick(likelihood, Expected(zeros + mean, sd), Expected(zeros + BASE, sd))


#: Of ln of a spread, its degrees of freedom, and the variance of a mean by Student's distribution.
ERROR = USUAL.spread_share**2 + np.log1p(USUAL.spread_error * BASE / SD) ** 2
FREEDOM = 0.5 / ERROR + 1.0
VARIANCE = SD**2 / N * FREEDOM / (FREEDOM - 2.0) + (0.01 * BASE) ** 2


def test_a_gap_of_one_sign_leaves_its_squares() -> None:
    (noncentrality,) = _yardstick(BASE + 0.02).squares((), np.zeros((1, 0)))
    assert noncentrality == pytest.approx(CELLS * 0.02**2 / VARIANCE, rel=1e-6)
    assert _yardstick().squares((), np.zeros((1, 0)))[0] == pytest.approx(0.0, abs=1e-12)


def test_a_discrepancy_takes_part_of_a_smooth_gap() -> None:
    """A gap that all points share, of which a share of the variance is common to all."""
    yardstick = _yardstick(BASE + 0.02, discrepancy=0.05)
    (noncentrality,) = yardstick.squares((), np.zeros((1, 0)))
    smooth = 0.05 * BASE * yardstick.likelihood.discrepancy_root
    covariance = VARIANCE * np.eye(CELLS) + smooth @ smooth.T
    gap = np.full(CELLS, 0.02)
    assert noncentrality == pytest.approx(gap @ np.linalg.solve(covariance, gap), rel=1e-6)


def test_spreads_count_where_single_shifts_are_known() -> None:
    yardstick = _yardstick(n=1001.0)
    wide_truth = replace(yardstick.truth, sd=4.0 * yardstick.truth.sd)
    seen = replace(yardstick.likelihood.observed, freedom=np.full(CELLS, 1000.0))
    yardstick = replace(
        yardstick, truth=wide_truth, likelihood=replace(yardstick.likelihood, observed=seen)
    )
    (noncentrality,) = yardstick.squares((), np.zeros((1, 0)))
    deviate = norm.isf(f_distribution.sf(16.0, 1000.0, FREEDOM))
    assert noncentrality == pytest.approx(CELLS * deviate**2, rel=1e-4)


def test_a_rival_of_the_same_change_leaves_nothing() -> None:
    noncentrality = _yardstick(BASE + 0.02).noncentralities(
        rivals_of("single", ["delay"], EFFECTS)[:-1]
    )
    assert set(noncentrality) == {(), ("scale",), ("tilt",)}
    assert noncentrality["scale",] < 1e-3  # the constant times scale as a dead time adds
    assert noncentrality["tilt",] == pytest.approx(noncentrality[()], rel=0.1)
    tilted_noncentrality = _yardstick(BASE * (1.0 + 0.2 * TILT)).noncentralities(
        [("delay",), ("scale",), ("tilt",)]
    )
    assert tilted_noncentrality["tilt",] < 1e-3
    assert min(tilted_noncentrality["delay",], tilted_noncentrality["scale",]) > 38.0


def test_data_show_the_part_of_a_truth_that_leaves_something() -> None:
    yardstick = _yardstick(BASE * (1.0 + 0.2 * TILT) + 0.0002)
    assert visible_causes(yardstick, ("delay", "tilt"), {}) == [("tilt",)]
    assert visible_causes(_yardstick(BASE + 0.0002), ("delay",), {}) == [()]
    assert visible_causes(_yardstick(BASE + 0.02), ("delay",), {}) == [("delay",)]


def test_an_observer_shows_no_gap_by_many_shifts_and_never_a_large_one() -> None:
    assert power_of(_yardstick(discrepancy=0.02, n=200.0)) > 0.95
    large_gap = _yardstick(discrepancy=0.02, n=200.0)
    large_gap = replace(
        large_gap, baseline=replace(large_gap.baseline, mean=large_gap.baseline.mean * 1.1)
    )
    assert power_of(large_gap) < 0.05
    small_gaps = [_yardstick(discrepancy=0.05, n=n) for n in (3.0, 200.0)]
    for k, yardstick in enumerate(small_gaps):
        baseline = replace(yardstick.baseline, mean=yardstick.baseline.mean * 1.035)
        small_gaps[k] = replace(yardstick, baseline=baseline)
    low_power, high_power = map(power_of, small_gaps)
    assert low_power < high_power
