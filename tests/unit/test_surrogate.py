"""The surrogate: fit on a known function, validation, storage, and asking it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim.errors import DataError, InputError
from surrogate.dataset import Dataset
from surrogate.model import fit
from surrogate.query import ask
from surrogate.store import load, save
from surrogate.validation import validate

NAMES = ("chamfer_deg", "height_mm", "count")
LOW, HIGH = np.array([0.0, 2.0, 6.0]), np.array([20.0, 6.0, 30.0])


def _truth(x: np.ndarray) -> np.ndarray:
    u = (x - LOW) / (HIGH - LOW)
    return 0.06 * np.exp(0.5 * (u[:, 0] - 0.6) ** 2 + 0.3 * u[:, 1] + 0.2 * np.sin(2 * u[:, 2]))


def _data(n: int, noise: float, seed: int = 0) -> Dataset:
    rng = np.random.default_rng(seed)
    x = LOW + rng.random((n, 3)) * (HIGH - LOW)
    time = _truth(x) * (1 + noise * rng.standard_normal(n))
    return Dataset(NAMES, LOW, HIGH, x, time, noise * time, "physics")


def test_predicts_a_smooth_function_and_covers_it() -> None:
    surrogate = fit(_data(50, noise=0.01))
    x = _data(400, noise=0.01, seed=1).x
    prediction = surrogate.predict(x)
    error = prediction.time / _truth(x) - 1
    assert np.sqrt((error**2).mean()) < 0.015
    inside = (prediction.low <= _truth(x)) & (_truth(x) <= prediction.high)
    assert 0.85 <= inside.mean() <= 1.0
    assert (prediction.low < prediction.time).all()


def test_draws_follow_the_posterior() -> None:
    surrogate = fit(_data(30, noise=0.02))
    x = _data(12, noise=0.0, seed=2).x
    rng = np.random.default_rng(0)
    logs = np.log([surrogate.sample(x, rng) for _ in range(2000)])
    prediction = surrogate.predict(x)
    assert logs.mean(axis=0) == pytest.approx(np.log(prediction.time), abs=0.01)
    assert logs.std(axis=0) == pytest.approx(prediction.log_sd, rel=0.1)


def test_validation_tells_signal_from_noise() -> None:
    good = validate(_data(50, noise=0.01))
    rng = np.random.default_rng(3)
    pure = _data(50, noise=0.01)
    noise = 0.07 * np.exp(0.1 * rng.standard_normal(50))
    bad = validate(Dataset(NAMES, LOW, HIGH, pure.x, noise, 0.1 * noise, "physics"))
    assert good.q2 > 0.95
    assert 0.85 <= good.coverage_95 <= 1.0
    assert bad.q2 < 0.3
    assert good.n == 50


def test_interval_widens_with_the_distance_to_the_data() -> None:
    surrogate = fit(_data(30, noise=0.01))
    near = surrogate.data.x[:1]
    far = np.array([[40.0, 12.0, 60.0]])
    assert surrogate.predict(far).log_sd[0] > 2 * surrogate.predict(near).log_sd[0]


def test_too_few_designs_are_refused() -> None:
    with pytest.raises(InputError, match="has 9 simulated designs"):
        fit(_data(9, noise=0.01))


def test_stored_and_read_back_predicts_the_same(tmp_path: Path) -> None:
    data = _data(30, noise=0.01)
    surrogate, figures = fit(data), validate(data)
    path = tmp_path / "surrogate.json"
    save(path, surrogate, figures)
    again, figures_again = load(path)
    x = _data(20, noise=0.01, seed=9).x
    assert again.predict(x).time == pytest.approx(surrogate.predict(x).time, rel=1e-9)
    assert again.predict(x).low == pytest.approx(surrogate.predict(x).low, rel=1e-9)
    assert figures_again == figures
    table = data.frame()
    assert list(table.columns) == [*NAMES, "expected_shift_time_s", "standard_error_s"]
    assert len(table) == 30


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    data = _data(20, noise=0.01)
    path = tmp_path / "surrogate.json"
    save(path, fit(data), validate(data))
    content = json.loads(path.read_text())
    for change, words in (
        ({"format": 7}, "has format 7"),
        ({"time_s": [0.1] * 20}, "was changed"),
        ({"theta": None}, "is incomplete"),
    ):
        path.write_text(json.dumps({**content, **change}))
        with pytest.raises(DataError, match=words):
            load(path)
    path.write_text("{")
    with pytest.raises(DataError, match="is not a surrogate file"):
        load(path)
    with pytest.raises(DataError, match="there is no surrogate at"):
        load(tmp_path / "none.json")


def test_asking_warns_outside_the_data_and_refuses_other_physics() -> None:
    surrogate = fit(_data(30, noise=0.01))
    inside = {"chamfer_deg": 10.0, "height_mm": 4.0, "count": 18.0}
    answer = ask(surrogate, inside, "physics")
    assert answer.in_range
    assert answer.low < answer.time < answer.high
    outside = ask(surrogate, {**inside, "chamfer_deg": 35.0}, "physics")
    assert not outside.in_range
    assert "chamfer_deg = 35 is outside" in outside.warnings[0]
    with pytest.raises(InputError, match="other physics"):
        ask(surrogate, inside, "another")
