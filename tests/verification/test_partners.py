"""What the weaker effect of a pair makes, where it is known exactly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from dogshape.sim.bundled import bundled_root
from dogshape.validation.blind.mujoco_shift import Draw, Engine
from dogshape.validation.blind.pair_visibility import ANGLES, added_by, beside, even_means
from dogshape.validation.blind.stand import read_points, read_stand
from dogshape.validation.blind.true_effects import truth_of
from dogshape.validation.second_engine import engine_available
from tests.conftest import needed

BASE = bundled_root() / "bench" / "mq200_adams"
FREE = [[0.1, 0.2, 0.3, 0.4]]
ERROR = float(np.std(FREE[0], ddof=1)) / math.sqrt(10)


def test_a_dead_time_adds_itself_to_every_mean() -> None:
    needed(engine_available(), "mujoco")
    stand, points = read_stand(BASE), read_points(BASE)[16:17]
    case: dict[str, Any] = {
        "parameters": {
            "actuation_delay": {"delay_s": 0.004},
            "force_scale": {"force_factor": 0.6},
        },
        "times_s": [[0.1] * 10],
    }
    added = added_by(stand, points, case["parameters"])
    found = {name: beside(one, case, {"reference_s": FREE}) for name, one in added.items()}
    assert min(found, key=lambda name: found[name]) == "actuation_delay"
    assert found["actuation_delay"] == pytest.approx(0.004 / ERROR, rel=1e-6)


def test_angles_count_as_often_as_the_truth_draws_them() -> None:
    """Hardly any preference is none; a strong one is somewhere between least and most."""
    needed(engine_available(), "mujoco")
    stand, points = read_stand(BASE), read_points(BASE)[:1]
    turns = (np.arange(ANGLES) + 0.5) / ANGLES
    engine = Engine(stand)
    times = np.array([engine.shift(points[0], Draw(t * stand.pitch)).time for t in turns], float)
    weak = {"concentration": 1e-9, "centre_pitch": 0.3}
    (mean,) = even_means(stand, points, truth_of({"relative_angle": weak}, {}))
    assert mean == pytest.approx(times.mean(), rel=1e-6)
    strong = {"concentration": 10.0, "centre_pitch": float(turns[4])}
    (near,) = even_means(stand, points, truth_of({"relative_angle": strong}, {}))
    assert times[2:7].min() - 1e-3 < near < times[2:7].max() + 1e-3
    assert abs(near - times[4]) < abs(mean - times[4]) + 1e-3
