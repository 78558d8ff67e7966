"""A surrogate that is given the simulated time of a design that its data do not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.surrogate.dataset import Dataset, Mix
from dogshape.surrogate.learning import Effort, condition, fit, fitted
from dogshape.surrogate.mix_times import MixTimes
from dogshape.surrogate.model import Surrogate

POINTS = np.array([[5.0, 300.0], [50.0, 300.0], [149.0, 500.0]])
MIX = Mix(POINTS, np.full(3, 1.0 / 3.0), 1.2)
PHYSICS = {
    "static_friction": 0.12, "dynamic_friction": 0.1, "outer_diameter_mm": 52.0,
    "inner_diameter_mm": 44.0, "traction_deg": 12.0, "braking_deg": 22.0,
}  # fmt: skip
OWN = np.array([10.0, 3.0, 20.0])
FAR = np.array([18.0, 5.0, 14.0])


def rows_of(x: np.ndarray, times: np.ndarray, error: float = 0.003) -> np.ndarray:
    """Rows of designs (k, 3) at all points, with mean times (k, 3), s."""
    count = 3 * len(x)
    means = times.ravel()
    columns = (means, error * means, 0.2 * means, np.full(count, 24.0), np.full(count, 24.0),
               np.ones(count))  # fmt: skip
    return np.column_stack([np.repeat(x, 3, axis=0), np.tile(POINTS, (len(x), 1)), *columns])


def smooth(x: np.ndarray) -> np.ndarray:
    """Times that a process without rough parts fits, (k, 3), s."""
    return (0.05 + 0.002 * x[:, :1] + 0.01 * x[:, 1:2]) * np.array([[1.5, 1.0, 0.8]])


@pytest.fixture(scope="module", params=[False, True], ids=["rows", "own-mix"])
def surrogate(request: pytest.FixtureRequest) -> Surrogate:
    rng = np.random.default_rng(4)
    x = np.array([7.0, 2.0, 12.0]) + rng.random((30, 3)) * np.array([13.0, 4.0, 20.0])
    x[:, 2] = np.round(x[:, 2])
    names = ("chamfer_deg", "height_mm", "count")
    low, high = np.array([5.0, 1.5, 10.0]), np.array([20.0, 6.0, 32.0])
    data = Dataset(names, low, high, rows_of(x, smooth(x)), PHYSICS, {"drake": "1"})
    model = fit(data, effort=Effort(rows=90, steps=20))
    if not request.param:
        return model
    noise = np.full(4, 1e-5)
    own = MixTimes(MIX, data, x, smooth(x), noise, 9)
    return replace(model, own=fitted(own, Effort(rows=30, steps=20)))


@pytest.mark.parametrize("factor", [0.6, 0.8, 1.0, 1.2, 1.7])
def test_the_simulated_design_has_its_time(surrogate: Surrogate, factor: float) -> None:
    times = factor * smooth(OWN[None, :])
    known = condition(surrogate, rows_of(OWN[None, :], times))
    for mix, wanted in ((MIX, times.mean()), (MIX.at(1), times[0, 1])):
        found = known.expected(OWN, mix)
        assert found.without_retries[0] == pytest.approx(wanted, rel=0.03)
        assert found.without_retries[1] < 0.05 * wanted


def test_a_miss_widens_the_intervals_of_other_designs(surrogate: Surrogate) -> None:
    before = surrogate.expected(FAR, MIX).without_retries
    right, missed = (
        condition(surrogate, rows_of(OWN[None, :], factor * smooth(OWN[None, :])))
        .expected(FAR, MIX)
        .without_retries
        for factor in (1.0, 1.4)
    )
    assert right[0] == pytest.approx(before[0], rel=0.02)
    assert right[1] < 0.015 * right[0]
    assert missed[1] > 0.1 * missed[0] > 2.0 * right[1]


def test_a_design_that_engages_nowhere_adds_no_time(surrogate: Surrogate) -> None:
    rows = rows_of(OWN[None, :], smooth(OWN[None, :]))
    rows[:, 5:8], rows[:, 8] = np.nan, 0.0
    known = condition(surrogate, rows)
    found, before = (one.expected(FAR, MIX) for one in (known, surrogate))
    assert found.without_retries[0] == pytest.approx(before.without_retries[0], rel=0.01)
    assert known.expected(OWN, MIX).engaged < before.engaged
