"""The surrogate: fit on a known function, validation, storage, and asking it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.bench.texts import TextTable
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.train.training_rows import with_rows
from dogshape.predictions import _design_values
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.statistics.shift_records import quantity_of
from dogshape.surrogate.dataset import Dataset, Grid, Mix, grid_of
from dogshape.surrogate.model import Surrogate, coordinates, fit, shape_of
from dogshape.surrogate.process import Effort
from dogshape.surrogate.query import ask, compare_physics, faces_hold, in_range
from dogshape.surrogate.store import Stored, load, save, validate

NAMES = ("chamfer_deg", "height_mm", "count")
LOW, HIGH = np.array([0.0, 2.0, 6.0]), np.array([20.0, 6.0, 30.0])
PHYSICS = {
    "contact_set": "made_up", "static_friction": 0.12, "dynamic_friction": 0.1,
    "traction_deg": 12.0, "braking_deg": 22.0, "outer_diameter_mm": 52.0, "inner_diameter_mm": 44.0,
}  # fmt: skip
GRID = np.array([[m, f] for m in (5.0, 25.0, 100.0) for f in (250.0, 600.0)])
MIX = Mix(GRID, np.array([0.1, 0.1, 0.2, 0.2, 0.2, 0.2]), retry=1.2)
FIRST, THIRD = (Mix(GRID[k : k + 1], np.ones(1), 1.2) for k in (0, 2))
QUICK = Effort(designs=60, steps=25)


def truth(x: Array, points: Array) -> Array:
    """A smooth time over designs (n, 3) and operating points (n, 2), s."""
    u = (x - LOW) / (HIGH - LOW)
    shape = 0.5 * (u[:, 0] - 0.6) ** 2 + 0.3 * u[:, 1] + 0.2 * np.sin(2 * u[:, 2])
    slow = np.log(points[:, 0] / 25.0)
    return 0.06 * np.exp(shape - 0.1 * slow * (1 + u[:, 0]) - 0.2 * np.log(points[:, 1] / 400.0))


def make_data(designs: int, noise: float = 0.01, seed: int = 0, losing: float = 0.0) -> Dataset:
    """Designs with a known time at all of the grid; a share ``losing`` of shifts do not engage."""
    rng = np.random.default_rng(seed)
    x, size = LOW + rng.random((designs, 3)) * (HIGH - LOW), len(GRID)
    x[:, 2] = np.round(x[:, 2])
    means = truth(np.repeat(x, size, axis=0), np.tile(GRID, (designs, 1))).reshape(-1, size)
    means = means * np.exp(noise * rng.standard_normal(means.shape))
    engaged = rng.binomial(8, 1.0 - losing, means.shape).astype(float)
    grid = Grid(x, means, noise * means, 0.3 * means, engaged, np.full(means.shape, 8.0))
    return Dataset(NAMES, LOW, HIGH, PHYSICS, {"drake": "1"}, MIX, grid)


def exact_time(x: Array, mix: Mix = MIX) -> float:
    """The true expected time of one design."""
    return float(mix.weights @ truth(np.tile(x, (len(mix.points), 1)), mix.points))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """A surrogate of the known function, 60 designs."""
    return fit(make_data(60), QUICK)


@pytest.fixture(scope="module")
def stored(surrogate: Surrogate) -> Stored:
    """The same with its figures."""
    return Stored(surrogate, validate(surrogate, make_data(20, seed=5)))


@pytest.mark.parametrize("mix", [MIX, replace(MIX, weights=np.full(6, 1.0 / 6.0)), THIRD])
def test_predicts_expected_times_and_covers_them(surrogate: Surrogate, mix: Mix) -> None:
    x = make_data(40, seed=1).grid.x
    time, error = surrogate.predict(x, mix)
    truths = np.array([exact_time(row, mix) for row in x])
    assert np.sqrt(((time / truths - 1) ** 2).mean()) < 0.01
    assert (np.abs(time - truths) < 2.2 * error).mean() >= 0.85
    expected = surrogate.expect(x[0], mix)
    assert (expected.time, expected.error) == pytest.approx((time[0], error[0]), rel=1e-4)
    assert expected.low < expected.time < expected.high
    assert surrogate.predict_medians(x, mix) == pytest.approx(time, rel=1e-3)


def test_other_operating_points_are_interpolated_with_wider_intervals(surrogate: Surrogate) -> None:
    x = make_data(30, seed=2).grid.x
    between = Mix(np.array([[12.0, 400.0]]), np.ones(1), 1.2)
    time, error = surrogate.predict(x, between)
    truths = np.array([exact_time(row, between) for row in x])
    assert np.corrcoef(time, truths)[0, 1] > 0.99
    assert time == pytest.approx(truths, rel=0.1)
    assert (np.abs(time - truths) < 1.96 * error).mean() >= 0.9
    assert error.mean() > 3.0 * surrogate.predict(x, FIRST)[1].mean()


def test_validation_tells_signal_from_noise(surrogate: Surrogate) -> None:
    data = make_data(24)
    held_out = validate(fit(data, QUICK))
    assert (held_out.n, held_out.source) == (24, "held out")
    assert held_out.q2 > 0.9
    referenced = validate(surrogate, make_data(40, 0.001, seed=8))
    assert (referenced.n, referenced.source) == (40, "references")
    assert referenced.q2 > 0.99
    assert referenced.q2_points > 0.98
    assert min(referenced.coverage_95, referenced.coverage_points) >= 0.85
    level = 0.07 * np.exp(0.1 * np.random.default_rng(3).standard_normal((24, 1)))
    noise = replace(data, grid=replace(data.grid, means=np.tile(level, len(GRID))))
    assert validate(fit(noise, QUICK)).q2 < 0.3


def test_a_grid_has_the_designs_with_every_point() -> None:
    data = make_data(6, seed=4)
    rows = data.frame()[[*NAMES, "mismatch_rpm", "force_N", "mean_s", "standard_error_s", "sd_s",
                         "engaged", "shifts"]].to_numpy()  # fmt: skip
    rows = np.column_stack([rows, np.ones(len(rows))])
    grid = grid_of(np.concatenate([rows, rows]), MIX)  # a row counts once
    assert len(grid.x) == 6
    order = np.lexsort(data.grid.x.T[::-1])
    for name in ("x", "means", "errors", "sds", "engaged", "shifts"):
        assert getattr(grid, name) == pytest.approx(getattr(data.grid, name)[order])
    assert len(grid_of(rows[1:], MIX).x) == 5
    second_rows = rows.copy()
    second_rows[:, -1], second_rows[:, 5], second_rows[:, 8:10] = (
        2.0,
        2.0 * rows[:, 5],
        3.0 * rows[:, 8:10],
    )
    pooled = grid_of(np.concatenate([rows, second_rows]), MIX)
    assert pooled.means == pytest.approx(1.75 * grid.means)
    assert pooled.shifts == pytest.approx(4.0 * grid.shifts)
    hanging_rows = rows.copy()
    hanging_rows[0, 5:8], hanging_rows[0, 8] = np.nan, 0.0
    assert np.isnan(grid_of(hanging_rows, MIX).means).sum() == 1


def test_share_stays_between_nought_and_one_and_costs_retries() -> None:
    all_engage = fit(make_data(30), QUICK)
    some_lose = fit(make_data(30, losing=0.2), QUICK)
    x = np.array([10.0, 4.0, 18.0])
    assert all_engage.expect(x, MIX).engaged == pytest.approx(1.0, abs=0.01)
    losing = some_lose.expect(x, MIX)
    assert losing.engaged == pytest.approx(0.8, abs=0.1)
    cost = losing.time - some_lose.expect(x, replace(MIX, retry=0.0)).time
    assert cost == pytest.approx(0.25 * MIX.retry, rel=0.4)
    distant = np.array([[500.0, 90.0, 900.0]])
    assert 0.0 < some_lose.predict_engaged(distant, MIX).min() < 1.0


def test_too_few_designs_are_refused() -> None:
    with pytest.raises(InputError, match=r"9 designs engage.*at least 10.*mix_shifts"):
        fit(make_data(9))


def test_stored_and_read_back_predicts_the_same(stored: Stored, tmp_path: Path) -> None:
    path = tmp_path / "surrogate.json"
    save(path, stored)
    loaded = load(path)
    x = make_data(5, seed=9).grid.x
    for written, read_back in zip(
        stored.surrogate.predict(x), loaded.surrogate.predict(x), strict=True
    ):
        assert read_back == pytest.approx(written, rel=1e-3)
    assert loaded.validation == stored.validation
    table = loaded.surrogate.data.frame()
    assert list(table.columns)[:5] == [*NAMES, "mismatch_rpm", "force_N"]
    assert table["contact_set"].unique().tolist() == ["made_up"]
    assert len(table) == 360


def test_damaged_files_are_refused(stored: Stored, tmp_path: Path) -> None:
    path = tmp_path / "surrogate.json"
    save(path, stored)
    text = path.read_text()
    content = json.loads(text)
    for change, words in (
        ({"format": 7}, "has format 7.* or a newer one"),
        ({"format": 1}, "has format 1.*fit the surrogate again"),
        ({"points": content["points"][1:]}, "was changed or damaged"),
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
    data, physics = surrogate.data, {**PHYSICS, "static_friction": friction}
    data = replace(data, grid=data.grid.subset(data.grid.x[:, 0] > 7.0), physics=physics)
    model = replace(surrogate, data=data)
    asked = {"chamfer_deg": chamfer, "height_mm": 4.0, "count": 18.0}
    answer = ask(model, asked, MIX, data.physics)
    assert (answer.expected is None) == holds
    assert answer.refusal.startswith("faces hold: no estimate") == holds
    assert bool(in_range(model, np.array([list(asked.values())]))[0]) <= (not holds)


def test_a_back_that_holds_has_no_estimate_either() -> None:
    physics, known = {"static_friction": 0.12}, np.array([[8.0, 9.0], [12.0, 14.0]])
    names = ("chamfer_deg", "chamfer_back_deg")
    data: Any = SimpleNamespace(variables=names, grid=SimpleNamespace(x=known), physics=physics)
    asked = np.array([[10.0, 10.0], [10.0, 5.0], [5.0, 10.0], [8.0, 9.0]])
    assert faces_hold(data, asked).tolist() == [False, True, True, False]


def test_the_coordinates_of_the_shape_are_those_of_the_dog() -> None:
    keys = {"dog.crest": 0.4, "dog.chamfer_back_deg": 12.0, "dog.backlash_mm": 0.3}
    ridge = {**keys, "variables.chamfer_back_deg": [4.0, 25.0]}
    base_names = ("entry_play", "tip_width", "edge_drop")
    for overrides, names in (({}, base_names), (ridge, (*base_names, "back_drop"))):
        study = load_study("mq200_paper", overrides)
        data = with_rows(study, np.zeros((0, len(study.variables) + 8)))
        coordinates = shape_of(data, study.rows([study.prototype]))
        dog_values = [1e3 * getattr(study.clutch.dog, name) for name in names]
        assert coordinates[0] == pytest.approx(dog_values, rel=1e-9)


def test_coordinates_of_unlike_rings_are_those_of_both_dogs_and_the_pair() -> None:
    keys = {"output_dog.crest": 0.4, "output_dog.chamfer_back_deg": 12.0}
    ranges = {"height_mm": [2.5, 4.5], "chamfer_deg": [4.0, 16.0], "backlash_mm": [0.0, 0.5]}
    searched = {f"variables.output_dog.{key}": ends for key, ends in ranges.items()}
    study = load_study("mq200_paper", keys | searched)
    data = with_rows(study, np.zeros((0, len(study.variables) + 8)))
    params = {**study.prototype, "output_dog_height_mm": 3.0, "output_dog_backlash_mm": 0.4}
    shape = shape_of(data, study.rows([params]))[0]
    pair = study.clutch_with(params).pair
    names = ("tip_width", "edge_drop")
    sliding = [1e3 * getattr(pair.sliding, name) for name in ("entry_play", *names)]
    output = [1e3 * getattr(pair.output, name) for name in (*names, "back_drop")]
    assert shape[:3] == pytest.approx(sliding, rel=1e-9)
    assert shape[4:7] == pytest.approx(output, rel=1e-9)
    assert shape[7:] == pytest.approx([1e3 * pair.depth, 1e3 * pair.entry_play], rel=1e-9)
    designs = study.rows([study.prototype, params])
    known: Any = SimpleNamespace(x=designs)
    columns = coordinates(replace(data, grid=known), designs)
    ridges = 4  # angles of the sliding dog and the chamfer of the output dog
    assert columns.shape == (2, len(study.variables) + ridges + len(shape))


def test_a_study_of_equal_rings_is_a_design_of_unlike_ones() -> None:
    """Its output dog follows the sliding one, also in a table of designs."""
    searched = {"variables.output_dog.height_mm": [2.5, 4.5]}
    study, equal = load_study("mq200_paper", searched), load_study("mq200_paper")
    data = with_rows(study, np.zeros((0, len(study.variables) + 8)))
    assert not compare_physics(data, equal.physics)
    assert quantity_of(equal.prototype, "output_dog_height_mm") == 3.7
    table = TextTable(Path("designs"), ("height_mm",), ((2, ("3.0",)), (3, ("4.0",))))
    x = _design_values(table, data.variables, equal.prototype)
    assert x[:, data.variables.index("output_dog_height_mm")].tolist() == [3.0, 4.0]
    x = _design_values(table, data.variables, study.prototype)
    assert x[:, data.variables.index("output_dog_height_mm")].tolist() == [3.7, 3.7]
