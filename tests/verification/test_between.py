"""What both engines differ by: found again where it is known, and added to what is foretold."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.sim.bundled import bundled_root
from dogshape.validation.blind.engine_gap import Moved, engines_apart
from dogshape.validation.blind.mujoco_shift import Draw, Engine
from dogshape.validation.blind.stand import Point, read_stand
from dogshape.validation.second_engine import engine_available
from tests.conftest import needed
from tests.flying import FlightOnly
from tests.made_up import few_cells


def test_a_known_difference_is_found_whatever_is_late() -> None:
    needed(engine_available(), "mujoco")
    stand = read_stand(bundled_root() / "bench" / "mq200_adams")
    settings = settings_of(few_cells(load_bench("mq200_adams"), [(50, 469.0), (249, 641.5)]))
    angles = (np.arange(6) + 0.5) / 6 * stand.pitch
    engine, rows = Engine(stand), []
    for setting in settings:
        profile = setting.point.profile
        point = Point(setting.point.mismatch, profile.force, profile.rise)
        rows.append([engine.shift(point, Draw(float(a))).time for a in angles])
    base = np.array(rows, dtype=float) + np.array([[0.002], [-0.001]])
    base[0, 0] += 0.3  # a late shift
    base[1, 1] = np.inf  # never engaged
    bank = SimpleNamespace(
        settings=settings,
        angles=np.array([angles, angles]),
        baseline=base,
    )
    assert engines_apart(stand, bank) == pytest.approx([-0.002, 0.001], abs=1e-12)


def test_times_are_moved_and_nothing_else() -> None:
    bare, values = FlightOnly(), np.array([[0.01], [0.02]])
    moved = Moved(bare, (0.0, -0.004, -1.0))
    for cell, offset in ((0, 0.0), (1, -0.004)):
        one, other = (e.at(("moving_mass",), values, cell) for e in (bare, moved))
        assert other.times == pytest.approx(one.times + offset)
        assert (other.error == one.error).all()
        assert (other.engaged == one.engaged).all()
    assert (moved.at(("moving_mass",), values, 2).times > 0.0).all()
