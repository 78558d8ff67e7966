"""Noncentrality of made-up truths under a made-up model, against closed forms."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import norm

from dogshape.diagnosis.bench.stand_file import Margin, NominalErrors
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import Observations
from dogshape.diagnosis.prediction.model import LateDelay, Prediction
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.validation.blind.data import Expected
from dogshape.validation.blind.yardstick import Yardstick, power_of, rivals_of, seen_as

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
    passing_times, kurtosis = np.full(CELLS, 0.3), np.zeros(CELLS)
    late_delay = LateDelay(np.full(CELLS, 0.3), np.full(CELLS, 0.1))

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
        nothing, one = 0.0 * mean, np.ones_like(mean)
        parts = mean + delay, SD * one, nothing, nothing, nothing, 1e-3 * one, one, delay + nothing
        return Prediction(*parts, one, nothing, SD * one, nothing, nothing)


def _stick(mean: Array | float = BASE, discrepancy: float = 1e-9, n: float = N) -> Yardstick:
    """A truth with expected means; single shifts are not known."""
    nothing, count = np.zeros(CELLS), np.full(CELLS, n)
    seen = Observations(
        count, nothing + BASE, nothing + SD**2, nothing, nothing, nothing > 0.0,
        count, nothing, SPEEDS.ravel(), FORCES.ravel(), None, (),
    )  # fmt: skip
    bench: Any = SimpleNamespace(
        measured=(), errors=NominalErrors(), margin=Margin(), clock_step=0.0
    )
    model: Any = _Model()
    likelihood = Likelihood(bench, seen, model, replace(USUAL, discrepancy=discrepancy))
    sd = np.full(CELLS, SD)
    return Yardstick(likelihood, Expected(nothing + mean, sd), Expected(nothing + BASE, sd))


#: Of ln of a spread, its degrees of freedom, and the variance of a mean by Student's distribution.
ERROR = USUAL.spread_share**2 + np.log1p(USUAL.spread_error * BASE / SD) ** 2
FREEDOM = 0.5 / ERROR + 1.0
VARIANCE = SD**2 / N * FREEDOM / (FREEDOM - 2.0) + (0.01 * BASE) ** 2


def test_a_gap_of_one_sign_leaves_its_squares() -> None:
    (found,) = _stick(BASE + 0.02).squares((), np.zeros((1, 0)))
    assert found == pytest.approx(CELLS * 0.02**2 / VARIANCE, rel=1e-6)
    assert _stick().squares((), np.zeros((1, 0)))[0] == pytest.approx(0.0, abs=1e-12)


def test_a_discrepancy_takes_part_of_a_smooth_gap() -> None:
    """A gap that all points share, of which a share of the variance is common to all."""
    stick = _stick(BASE + 0.02, discrepancy=0.05)
    (found,) = stick.squares((), np.zeros((1, 0)))
    smooth = 0.05 * BASE * stick.likelihood.discrepancy_root
    whole = VARIANCE * np.eye(CELLS) + smooth @ smooth.T
    gap = np.full(CELLS, 0.02)
    assert found == pytest.approx(gap @ np.linalg.solve(whole, gap), rel=1e-6)


def test_spreads_count_where_single_shifts_are_known() -> None:
    stick = _stick(n=1001.0)
    wide = replace(stick.truth, sd=4.0 * stick.truth.sd)
    seen = replace(stick.likelihood.observed, freedom=np.full(CELLS, 1000.0))
    stick = replace(stick, truth=wide, likelihood=replace(stick.likelihood, observed=seen))
    (found,) = stick.squares((), np.zeros((1, 0)))
    deviate = norm.isf(f_distribution.sf(16.0, 1000.0, FREEDOM))
    assert found == pytest.approx(CELLS * deviate**2, rel=1e-4)


def test_a_rival_of_the_same_change_leaves_nothing() -> None:
    left = _stick(BASE + 0.02).left(rivals_of("single", ["delay"], EFFECTS)[:-1])
    assert set(left) == {(), ("scale",), ("tilt",)}
    assert left["scale",] < 1e-3  # the constant times scale as a dead time adds
    assert left["tilt",] == pytest.approx(left[()], rel=0.1)
    tilted = _stick(BASE * (1.0 + 0.2 * TILT)).left([("delay",), ("scale",), ("tilt",)])
    assert tilted["tilt",] < 1e-3
    assert min(tilted["delay",], tilted["scale",]) > 38.0


def test_data_show_the_part_of_a_truth_that_leaves_something() -> None:
    stick = _stick(BASE * (1.0 + 0.2 * TILT) + 0.0002)
    assert seen_as(stick, ("delay", "tilt"), {}) == [("tilt",)]
    assert seen_as(_stick(BASE + 0.0002), ("delay",), {}) == [()]
    assert seen_as(_stick(BASE + 0.02), ("delay",), {}) == [("delay",)]


def test_an_observer_shows_no_gap_by_many_shifts_and_never_a_large_one() -> None:
    assert power_of(_stick(discrepancy=0.02, n=200.0)) > 0.95
    far = _stick(discrepancy=0.02, n=200.0)
    far = replace(far, plain=replace(far.plain, mean=far.plain.mean * 1.1))
    assert power_of(far) < 0.05
    near = [_stick(discrepancy=0.05, n=n) for n in (3.0, 200.0)]
    near = [replace(one, plain=replace(one.plain, mean=one.plain.mean * 1.035)) for one in near]
    few, many = map(power_of, near)
    assert few < many
