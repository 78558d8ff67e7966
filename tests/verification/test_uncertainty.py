"""Uncertain factors and numbers of the mix: unbiased, and errors that say how far they are off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import (
    ShiftResult,
    even_phases,
    time_quantile,
    variance_of_mean,
)
from dogshape.sim.statistics.uncertainty import NEEDS, Distribution, Uncertainty, Variant
from dogshape.sim.units import RPM

Array = NDArray[np.float64]
TIMEOUT, RETRACTION = 1.0, 0.2
LOG = np.log(1.5) ** 2  #: square of sigma of a lognormal with a factor of 1.5
MOMENTS: list[tuple[dict[str, Any], float, float]] = [
    ({"distribution": "uniform", "low": -20.0, "high": 40.0}, 10.0, 60.0 / 12**0.5),
    # Mean m e^(s2/2), variance mean2 (e^s2 - 1).
    ({"distribution": "lognormal", "median": 50.0, "factor": 1.5},
     50.0 * np.exp(LOG / 2), 50.0 * np.exp(LOG / 2) * np.expm1(LOG) ** 0.5),
    # Kotz and van Dorp: mean (a + b + c)/3, variance (a2 + b2 + c2 - ab - ac - bc)/18.
    ({"distribution": "triangular", "low": 0.8, "mode": 1.0, "high": 1.5}, 1.1, (0.39 / 18) ** 0.5),
    # A normal cut at its mean: mean mu + sigma sqrt(2/pi), sd sigma sqrt(1 - 2/pi).
    ({"distribution": "normal", "mean": 0.0, "sd": 3.0, "low": 0.0},
     3.0 * (2.0 / np.pi) ** 0.5, 3.0 * (1.0 - 2.0 / np.pi) ** 0.5),
]  # fmt: skip


@pytest.mark.parametrize(("given", "mean", "sd"), MOMENTS)
def test_distributions_have_the_moments_of_their_closed_forms(
    given: dict[str, Any], mean: float, sd: float
) -> None:
    one = Distribution.model_validate(given).checked("key")
    values = one.at((np.arange(20_000) + 0.5) / 20_000)
    assert values.mean() == pytest.approx(mean, rel=1e-3)
    assert values.std() == pytest.approx(sd, rel=3e-3)
    low, high = one.bounds
    assert low <= values.min() < values.max() <= high
    assert (np.diff(values) > 0.0).all()
    assert one.distribution in NEEDS


def _unsure() -> tuple[Setup, Uncertainty]:
    study = load_study("mq200_robust")
    assert study.uncertainty is not None
    return study, study.uncertainty


def test_a_known_mean_is_hit_and_its_error_is_told() -> None:
    """A slope with a jump whose place and height follow the factors.

    Its mean by a dense grid over the angle and half a million draws of the factors.
    """

    def time(phase: float, v: Variant) -> float:
        late = phase < 0.5 * v.friction
        return 0.05 / v.force + 0.06 * phase * v.friction**2 + (0.03 * v.inertia if late else 0.0)

    study, unsure = _unsure()
    shares = np.random.default_rng(0).random((500_000, 3))
    f, p, j = (d.at(u) for (_, d), u in zip(unsure.distributions, shares.T, strict=True))
    exact = float((0.05 / p + 0.03 * f**2 + 0.015 * f * j).mean())
    for count in (6, 12, 24):
        found = []
        for seed in range(400):
            variants = unsure.variants(study.points[0], count, seed, 0)
            phases = even_phases(count, seed, 0).tolist()
            times = np.array([time(p, v) for p, v in zip(phases, variants, strict=True)])
            found.append((times.mean(), variance_of_mean(times)))
        means, variances = np.array(found).T
        assert means.mean() == pytest.approx(exact, abs=4.0 * means.std() / 20.0)
        assert 0.8 <= variances.mean() ** 0.5 / means.std(ddof=1) <= 1.3


def _shifts(times: Array) -> list[ShiftResult]:
    return [
        ShiftResult(Outcome.ENGAGED, float(t))
        if t < TIMEOUT
        else ShiftResult(Outcome.BLOCKED, None)
        for t in times
    ]


@pytest.mark.parametrize("share", [0.5, 0.9, 0.95])
def test_quantile_of_scattered_times(share: float) -> None:
    """Exponential times at twelve points: quantile -ln(1 - q), coverage 95 % or little less."""
    found = []
    for seed in range(300):
        rng = np.random.default_rng([seed, 1])
        shifts = [_shifts(0.02 + 0.03 * rng.exponential(size=8)) for _ in range(12)]
        one = time_quantile([1.0] * 12, shifts, share, TIMEOUT, RETRACTION)
        found.append((one.value, one.standard_error))
    values, errors = np.array(found).T
    exact = 0.02 - 0.03 * np.log1p(-share)
    assert values.mean() == pytest.approx(exact, abs=0.5 * values.std())
    assert 0.8 <= np.sqrt((errors**2).mean()) / values.std() <= 1.3
    assert np.mean(np.abs(values - exact) < 1.96 * errors) > 0.85


def test_quantile_counts_retries_as_a_drawn_experiment_does() -> None:
    """A fifth does not engage at one of two points: times by so many drawn shifts."""
    times = np.linspace(0.04, 0.08, 40)
    shifts = [_shifts(times), _shifts(np.where(np.arange(40) % 5 == 0, 2.0, times))]
    rng = np.random.default_rng(3)
    good = np.delete(times, np.arange(0, 40, 5))
    failures = rng.geometric(0.8, 200_000) - 1
    drawn = rng.choice(good, 200_000) + failures * (TIMEOUT + RETRACTION)
    both = np.concatenate([rng.choice(times, 200_000), drawn])
    for share in (0.5, 0.85, 0.95, 0.99):
        found = time_quantile([1.0, 1.0], shifts, share, TIMEOUT, RETRACTION)
        assert found.value == pytest.approx(np.quantile(both, share), abs=2e-3)
    assert found.value > TIMEOUT + RETRACTION


def test_a_variant_scales_what_it_says() -> None:
    study, unsure = _unsure()
    point = next(p for p in study.points if p.profile.force == 469.0)
    variant = Variant(1.2, 1.1, 0.9, 0.15, ())
    drawn = variant.clutch(study.clutch)
    assert drawn.contact.static_friction == pytest.approx(1.2 * 0.12)
    assert drawn.contact.dynamic_friction == pytest.approx(1.2 * 0.10)
    assert drawn.rings.output_inertia == pytest.approx(0.9 * 0.6048)
    assert replace(drawn, contact=study.clutch.contact, rings=study.clutch.rings) == study.clutch
    assert variant.point(point).profile.force == pytest.approx(515.9)
    for one in unsure.variants(point, 8, 1, 0):
        forces, rises = study.file.actuation.force_N, study.file.actuation.rise_s
        assert one.rise == pytest.approx(np.interp(469.0 * one.force, forces, rises))
    slow = OperatingPoint(50 * RPM, replace(point.profile, rise=0.4))
    assert {one.rise for one in unsure.variants(slow, 8, 1, 0)} == {0.4}
