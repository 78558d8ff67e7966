"""The surrogate: fit on a known function, validation, storage, and asking it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.train.training import validate
from dogshape.sim.errors import DataError, InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, Mix, reference_of
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.learning import Effort, fit
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import ask, in_range
from dogshape.surrogate.store import Stored, load, save

NAMES = ("chamfer_deg", "height_mm", "count")
LOW, HIGH = np.array([0.0, 2.0, 6.0]), np.array([20.0, 6.0, 30.0])
PHYSICS = {"contact_set": "made_up", "static_friction": 0.12, "dynamic_friction": 0.1}
GRID = np.array([[m, f] for m in (5.0, 25.0, 100.0) for f in (250.0, 600.0)])
MIX = Mix(GRID, np.array([0.1, 0.1, 0.2, 0.2, 0.2, 0.2]), retry=1.2)
QUICK = Effort(rows=200, steps=25)


def truth(x: Array, points: Array) -> Array:
    """A smooth time over designs (n, 3) and operating points (n, 2), s."""
    u = (x - LOW) / (HIGH - LOW)
    shape = 0.5 * (u[:, 0] - 0.6) ** 2 + 0.3 * u[:, 1] + 0.2 * np.sin(2 * u[:, 2])
    slow = np.log(points[:, 0] / 25.0)
    return 0.06 * np.exp(shape - 0.1 * slow * (1 + u[:, 0]) - 0.2 * np.log(points[:, 1] / 400.0))


def made(
    designs: int, noise: float = 0.01, seed: int = 0, *, grid: bool = False, losing: float = 0.0
) -> Dataset:
    """Rows of a known time: some points a design, or all of the grid; ``losing`` do not engage."""
    rng = np.random.default_rng(seed)
    x = np.repeat(LOW + rng.random((designs, 3)) * (HIGH - LOW), len(GRID) if grid else 4, axis=0)
    count = len(x)
    points = np.tile(GRID, (designs, 1))
    if not grid:
        points = np.column_stack(
            [5.0 * 20.0 ** rng.random(count), 250.0 * 2.4 ** rng.random(count)]
        )
    mean = truth(x, points) * np.exp(noise * rng.standard_normal(count))
    engaged = rng.binomial(8, 1.0 - losing, count)
    columns = (mean, noise * mean, 0.3 * mean, engaged, np.full(count, 8), np.full(count, seed))
    rows = np.column_stack([x, points, *columns])
    return Dataset(NAMES, LOW, HIGH, rows, PHYSICS, {"drake": "1"})


def exact(x: Array, mix: Mix = MIX) -> float:
    """The true expected time of one design."""
    return float(mix.weights @ truth(np.tile(x, (len(mix.points), 1)), mix.points))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """A surrogate of the known function, 60 designs."""
    return fit(made(60), effort=QUICK)


@pytest.fixture(scope="module")
def stored(surrogate: Surrogate) -> Stored:
    """The same with its figures."""
    reference = reference_of(made(20, seed=5, grid=True), MIX)
    return Stored(surrogate, validate(surrogate, MIX, reference))


def test_predicts_expected_times_and_covers_them(surrogate: Surrogate) -> None:
    x = made(40, seed=1).designs
    found = [surrogate.expected(row, MIX) for row in x]
    times = np.array([exact(row) for row in x])
    error = np.array([one.time for one in found]) / times - 1
    assert np.sqrt((error**2).mean()) < 0.01
    inside = [one.low <= time <= one.high for one, time in zip(found, times, strict=True)]
    assert np.mean(inside) >= 0.85


def test_many_designs_at_once_agree_with_one_at_a_time(surrogate: Surrogate) -> None:
    x = made(25, seed=2).designs
    one = [surrogate.expected(row, MIX) for row in x]
    time, error = Over(surrogate, MIX).predict(x)
    assert time == pytest.approx([e.time for e in one], rel=2e-3)
    assert error == pytest.approx([e.error for e in one], rel=0.15)


def test_the_error_of_a_mix_is_that_of_joint_draws(surrogate: Surrogate) -> None:
    """The points of a mix err together: neither independent nor as one."""
    x = np.array([4.0, 5.5, 25.0])
    inputs = surrogate.inputs(np.tile(x, (len(GRID), 1)), GRID)
    mean, covariance = surrogate.times.joint(inputs)
    draws = np.random.default_rng(0).multivariate_normal(mean, covariance, 40_000)
    times = np.exp(draws) @ MIX.weights
    engaging = replace(MIX, retry=0.0)
    expected = surrogate.expected(x, engaging)
    assert expected.time == pytest.approx(times.mean(), rel=1e-3)
    assert expected.error == pytest.approx(times.std(), rel=0.03)
    alone = np.sqrt(np.diag(covariance)) * np.exp(mean) * MIX.weights
    assert np.sqrt((alone**2).sum()) < expected.error < alone.sum()


def test_validation_tells_signal_from_noise(surrogate: Surrogate) -> None:
    data = made(24, grid=True)
    model = fit(data, effort=QUICK)
    good = validate(model, MIX)
    assert good.q2 > 0.9
    assert good.n == 24
    assert good.source == "held out"
    rows = data.rows.copy()
    rows[:, 5] = np.repeat(0.07 * np.exp(0.1 * np.random.default_rng(3).standard_normal(24)), 6)
    noise = replace(data, rows=rows)
    assert validate(fit(noise, effort=QUICK), MIX).q2 < 0.3


def test_references_are_designs_with_every_point() -> None:
    data = made(6, seed=4, grid=True)
    whole = reference_of(data, MIX)
    assert len(whole) == 6
    assert whole.time == pytest.approx([exact(x) for x in whole.x], rel=0.03)
    assert len(reference_of(data.subset(np.arange(1, len(data))), MIX)) == 5


def test_share_stays_between_nought_and_one_and_costs_retries() -> None:
    all_engage = fit(made(30), effort=QUICK)
    some_lose = fit(made(30, losing=0.2), effort=QUICK)
    x = np.array([10.0, 4.0, 18.0])
    assert all_engage.expected(x, MIX).engaged == pytest.approx(1.0, abs=0.01)
    losing = some_lose.expected(x, MIX)
    assert losing.engaged == pytest.approx(0.8, abs=0.1)
    cost = losing.time - some_lose.expected(x, replace(MIX, retry=0.0)).time
    assert cost == pytest.approx(0.25 * MIX.retry, rel=0.4)
    far = some_lose.inputs(np.array([[500.0, 90.0, 900.0]]), np.array([[4000.0, 9.0]]))
    share, variance = some_lose.share.at(far)
    assert 0.0 < share[0] < 1.0
    assert variance[0] > 0.0


def test_interval_widens_with_the_distance_to_the_data(surrogate: Surrogate) -> None:
    near, far = surrogate.data.x[0], np.array([40.0, 12.0, 60.0])
    assert surrogate.expected(far, MIX).error > 3 * surrogate.expected(near, MIX).error
    assert surrogate.distance(np.array([near, far])) == pytest.approx([0.0, 12.0], abs=8.0)


def test_too_few_designs_are_refused() -> None:
    with pytest.raises(InputError, match="has 9 designs with three shifts"):
        fit(made(9))


def test_stored_and_read_back_predicts_the_same(stored: Stored, tmp_path: Path) -> None:
    path = tmp_path / "surrogate.json"
    save(path, stored)
    again = load(path)
    for row in made(5, seed=9).designs:
        assert again.surrogate.expected(row, MIX) == stored.surrogate.expected(row, MIX)
    assert again.validation == stored.validation
    table = again.surrogate.data.frame()
    assert list(table.columns)[:5] == [*NAMES, "mismatch_rpm", "force_N"]
    assert table["contact_set"].unique().tolist() == ["made_up"]
    assert len(table) == 240


def test_damaged_files_are_refused(stored: Stored, tmp_path: Path) -> None:
    path = tmp_path / "surrogate.json"
    save(path, stored)
    text = path.read_text()
    content = json.loads(text)
    for change, words in (
        ({"format": 7}, "has format 7.* or a newer one"),
        ({"format": 1}, "has format 1.*fit the surrogate again"),
        ({"rows": content["rows"][1:]}, "was changed or damaged"),
        ({"share": None}, "was changed or damaged"),
    ):
        path.write_text(json.dumps({**content, **change}))
        with pytest.raises(DataError, match=words):
            load(path)
    for broken in ("{", "[]", text[: len(text) // 2]):
        path.write_text(broken)
        with pytest.raises(DataError, match="is not a surrogate file"):
            load(path)
    with pytest.raises(DataError, match="there is no surrogate at"):
        load(tmp_path / "none.json")


def test_asking_warns_outside_the_data_and_refuses_other_physics(surrogate: Surrogate) -> None:
    inside = {"chamfer_deg": 10.0, "height_mm": 4.0, "count": 18.0}
    answer = ask(surrogate, inside, MIX, PHYSICS)
    assert answer.in_range
    assert answer.expected is not None
    assert answer.expected.low < answer.expected.time < answer.expected.high
    outside = ask(surrogate, {**inside, "chamfer_deg": 35.0}, MIX, PHYSICS)
    assert not outside.in_range
    assert "chamfer_deg = 35 is outside" in outside.warnings[0]
    fast = replace(MIX, points=GRID * [10.0, 1.0])
    assert "mismatch 1000 1/min is outside" in ask(surrogate, inside, fast, PHYSICS).warnings[0]
    with pytest.raises(InputError, match=r"other physics .*: contact_set is x here and made_up"):
        ask(surrogate, inside, MIX, {**PHYSICS, "contact_set": "x"})
    compiled = {**PHYSICS, "engine": "planar", "accuracy": 1e-4}
    assert ask(surrogate, inside, MIX, compiled).expected == answer.expected


@pytest.mark.parametrize(
    ("chamfer", "friction", "holds"),
    [(4.0, 0.12, True), (6.8, 0.12, True), (6.9, 0.12, False), (4.0, 0.05, False)],
)
def test_faces_that_hold_have_no_estimate(
    surrogate: Surrogate, chamfer: float, friction: float, holds: bool
) -> None:
    """The least chamfer that was simulated is 7 degrees, the friction angle of 0.12 is 6.84."""
    rows = surrogate.data.rows[surrogate.data.x[:, 0] > 7.0]
    data = replace(surrogate.data, rows=rows, physics={**PHYSICS, "static_friction": friction})
    model = replace(surrogate, data=data)
    asked = {"chamfer_deg": chamfer, "height_mm": 4.0, "count": 18.0}
    answer = ask(model, asked, MIX, data.physics)
    assert (answer.expected is None) == holds
    assert answer.refusal.startswith("faces hold: no estimate") == holds
    assert bool(in_range(model, np.array([list(asked.values())]))[0]) <= (not holds)


def test_a_simulated_chamfer_has_an_estimate_whatever_the_friction(surrogate: Surrogate) -> None:
    """Faces of a creeping contact law let go below its friction angle, as its rows say."""
    physics = {**PHYSICS, "static_friction": 0.9}
    model = replace(surrogate, data=replace(surrogate.data, physics=physics))
    asked = {"chamfer_deg": 10.0, "height_mm": 4.0, "count": 18.0}
    assert ask(model, asked, MIX, physics).expected is not None


def test_an_interval_is_split_into_retries_and_the_rest(surrogate: Surrogate) -> None:
    x = np.array([10.0, 4.0, 18.0])
    losing = replace(surrogate.share, engaged=surrogate.share.engaged * 0.9)
    found = replace(surrogate, share=losing).expected(x, MIX)
    bare, error = found.without_retries
    engaging = surrogate.expected(x, replace(MIX, retry=0.0))
    assert (bare, error) == pytest.approx((engaging.time, engaging.error))
    assert found.retries > 0.0
    assert np.hypot(error, found.retries_error) == pytest.approx(found.error)
