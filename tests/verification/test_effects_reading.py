"""Effects that change how a shift is driven or read, against what follows without a simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ive

from dogshape.sim.effects import load
from dogshape.sim.setting import Setting, angle_weights
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import run_block
from dogshape.sim.units import DEG, RPM

EFFECTS = load()


@pytest.mark.parametrize(
    ("nominal", "factor", "true"),
    [(10.0, 1.0, 7.0), (-10.0, 1.0, -7.0), (100.0, 0.8, 77.0), (-100.0, 1.2, -117.0)],
)
def test_factor_and_offset_act_on_the_mismatch_either_way(
    setting: Setting, nominal: float, factor: float, true: float
) -> None:
    asked = setting.with_point(mismatch=nominal * RPM)
    values = {"offset_rpm": -3.0, "mismatch_factor": factor}
    changed = EFFECTS["mismatch_speed"].apply(asked, values)
    assert changed.point.mismatch == pytest.approx(true * RPM)
    trace = engage(ClutchPlant(changed.clutch), changed.point, 0.1).trace
    assert trace.relative_speed[0] == pytest.approx(true * RPM)


@pytest.mark.parametrize("concentration", [0.0, 0.5, 4.0])
def test_weights_of_angles_are_von_mises(setting: Setting, concentration: float) -> None:
    """Mean of cos about the centre is I1(k)/I0(k)."""
    values = {"concentration": concentration, "centre_pitch": 0.3}
    changed = EFFECTS["relative_angle"].apply(setting, values)
    turns = (np.arange(64) + 0.37) / 64
    weights = angle_weights(turns, changed.concentration, changed.centre)
    assert weights.mean() == pytest.approx(1.0)
    mean = float((weights * np.cos(2 * np.pi * (turns - 0.3))).mean())
    assert mean == pytest.approx(ive(1, concentration) / ive(0, concentration), abs=1e-9)
    assert changed.block((0.1,)).keys == setting.block((0.1,)).keys


def test_a_sensor_at_the_actuator_reads_its_time(setting: Setting) -> None:
    """Ahead of the ring by force over stiffness, and equal to the ring's without a linkage."""
    values = {"compliance_mm_kN": 4.0, "mass_behind_kg": 0.0}
    springy = EFFECTS["linkage_compliance"].apply(setting, values)
    row = next(run_block(springy.block((12 * DEG,))))
    at_actuator = replace(springy, sensor="actuator")
    assert springy.time_of(row) == row["shift_time_s"]
    assert at_actuator.time_of(row) == row["actuator_time_s"]
    trace = engage(ClutchPlant(springy.clutch), springy.point, 12 * DEG).trace
    when = int(np.argmax(trace.actuator_displacement >= setting.clutch.shift_travel))
    assert trace.time[when - 1] <= row["actuator_time_s"] <= trace.time[when]
    assert row["actuator_time_s"] < row["shift_time_s"]
    rigid = next(run_block(setting.block((12 * DEG,))))
    assert replace(setting, sensor="actuator").time_of(rigid) == rigid["shift_time_s"]
