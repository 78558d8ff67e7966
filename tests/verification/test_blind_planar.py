"""Truths of the compiled engine: mechanisms as those of the effects, a contact of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from dogshape.bench.bench_data import load_bench, setting_of
from dogshape.bench.stand_file import BenchRecord
from dogshape.sim.effects import load
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.data import mask_late, moments
from dogshape.validation.blind.mujoco_shift import Draw
from dogshape.validation.blind.planar_shift import PlanarEngine
from dogshape.validation.blind.stand import Point, Truth, read_stand
from dogshape.validation.blind.true_effects import truth_of

BENCH = bundled_root() / "bench" / "mq200_adams"
STAND = read_stand(BENCH)
POINT = Point(50.0 * np.pi / 30.0, 469.0, 0.1766)
ANGLES = np.linspace(0.02, 0.38, 4)
EFFECTS = {
    "actuation_delay": {"delay_s": 0.08},
    "actuation_lag": {"lag_s": 0.05},
    "axial_gap": {"gap_offset_mm": 0.3},
    "chamfer_angle": {"chamfer_offset_deg": 1.5},
    "contact_friction": {"static_friction": 0.2, "dynamic_friction": 0.1},
    "detent_force": {"detent_N": 80.0, "position_mm": 0.8},
    "drag_torque": {"drag_Nm": 1.0},
    "force_loss": {"loss_N": 60.0},
    "force_rise": {"rise_factor": 1.6},
    "force_scale": {"force_factor": 0.7},
    "free_play": {"free_play_mm": 0.5},
    "linkage_compliance": {"compliance_mm_kN": 4.0, "mass_behind_kg": 1.2},
    "mismatch_speed": {"offset_rpm": 2.0, "mismatch_factor": 0.9},
    "moving_mass": {"added_mass_kg": 1.5},
    "reversed_mismatch": {},
    "sleeve_friction": {"friction_N": 60.0},
    "sliding_inertia": {"inertia_factor": 3.0},
    "spline_friction": {"spline_friction": 0.15},
    "viscous_damping": {"damping_Ns_m": 300.0},
}


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_with_the_same_contact_each_effect_is_that_of_the_simulation(name: str) -> None:
    values = EFFECTS[name]
    engine = PlanarEngine(STAND, truth_of({name: values}, {}))
    bench = load_bench(BENCH)
    cells = [k for k, c in enumerate(bench.cells) if abs(c.point.profile.force - 469.0) < 1.0]
    place = next(k for k in cells if abs(bench.cells[k].point.mismatch - POINT.mismatch) < 1e-6)
    bench = replace(bench, record=BenchRecord(displacement_at="actuator"))
    plain = replace(setting_of(bench), point=bench.cells[place].point)
    setting = load(None)[name].apply(plain, values)
    plant = PlanarClutch(setting.clutch.with_engine("planar"))
    for angle in ANGLES:
        found = engage(plant, setting.point, float(angle))
        linked = name in {"linkage_compliance", "free_play"}
        time = found.actuator_time if linked else found.shift_time
        mine = engine.shift(POINT, Draw(float(angle))).time
        assert time is not None
        assert mine == pytest.approx(time + setting.delay, rel=2e-3)


def test_motion_begins_with_the_flight_of_a_free_mass() -> None:
    """Until the first touch the ring has gone twice the integral of F / m, after the dead time."""
    late = {"delay": 0.03, "draw": 0.01}
    engine, draw = PlanarEngine(STAND, Truth(delay=late["delay"])), Draw(0.1, late=late["draw"])
    shift, plain = engine.shift(POINT, draw, keep=True), engine.shift(POINT, draw)
    assert plain.motion is None
    assert shift.motion is not None
    assert shift.time == plain.time
    times, sensor, ring, sliding, output, _ = shift.motion.T
    flying = (ring < STAND.gap) & (times < 0.2)
    profile, fine = ForceProfile(POINT.force, POINT.rise), np.linspace(0.0, 0.1, 20001)
    speed = cumulative_simpson([profile.at(t) / STAND.mass for t in fine], x=fine, initial=0.0)
    flown = cumulative_simpson(speed, x=fine, initial=0.0)
    for way in (0.2 * STAND.gap, 0.8 * STAND.gap):
        exact = np.interp(way, flown, fine) + sum(late.values())
        assert np.interp(way, ring[flying], times[flying]) == pytest.approx(exact, abs=2e-4)
    assert np.array_equal(sensor, ring)
    assert output[0] - sliding[0] == pytest.approx(POINT.mismatch)


def test_angles_count_as_often_as_the_truth_draws_them() -> None:
    """Weights over even angles; of late shifts none."""
    times = np.array([[0.10, 0.11, 0.12, 0.13, 0.14, 0.5]])
    soon = mask_late(times, np.array([0.2]))
    assert np.isnan(soon[0, 5])
    assert np.isfinite(soon[0, :5]).all()
    weights = np.array([1.0, 1.0, 2.0, 0.0, 0.0, 9.0])
    found = moments(soon, weights, delay_sd=0.01)
    assert found.mean[0] == pytest.approx(0.1125)
    inner = (0.0125**2 + 0.0025**2 + 2.0 * 0.0075**2) / 4.0
    assert found.sd[0] == pytest.approx((inner + 0.01**2) ** 0.5)
