"""Effects and mechanisms of a study in both engines, against closed forms and limit cases."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ive

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.sim.effects import load
from dogshape.sim.kernel_layout import INPUT_SIDE_SPEED
from dogshape.sim.setting import Setting, angle_weights
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import ENGINES, Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.mechanism import DAMPING_RATIO, FORK_MASS_SHARE
from dogshape.sim.statistics.blocks import engage, run_block
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point

EFFECTS = load()
MASS = 0.3  #: kg, of the ring


@pytest.fixture(params=ENGINES)
def setting(request: pytest.FixtureRequest, clutch: Clutch, point: Point) -> Setting:
    """The prototype at 50 1/min and 469 N."""
    return Setting(clutch.with_engine(request.param), point(50, 469.0))


def _shifted(setting: Setting, degrees: float = 15.0) -> Engagement:
    return engage(setting.clutch, setting.point, degrees * DEG)


def _free(setting: Setting) -> Setting:
    """Return the setting with dogs that stand too far apart to meet within 0.03 s."""
    far = setting.with_dog(axial_gap=90e-3)
    return replace(far, clutch=replace(far.clutch, timeout=0.03))


def test_a_force_loss_is_a_smaller_force_of_the_same_rise(setting: Setting) -> None:
    """The shift at a force less by the loss, to the last digit."""
    lossy = EFFECTS["force_loss"].apply(setting, {"loss_N": 69.0})
    less = setting.with_point(profile=ForceProfile(400.0, setting.point.profile.rise))
    assert _shifted(lossy).shift_time == _shifted(less).shift_time
    assert _shifted(lossy).shift_time != _shifted(setting).shift_time


@pytest.mark.parametrize("factor", [0.4, 1.6])
def test_the_rise_factor_stretches_the_cubic_step(setting: Setting, factor: float) -> None:
    """x = (F T2/m)(s4/4 - s5/10), T the rise times its factor."""
    slow = EFFECTS["force_rise"].apply(_free(setting), {"rise_factor": factor})
    rise = factor * setting.point.profile.rise
    trace = _shifted(slow).trace
    s = trace.time / rise
    exact = 469.0 * rise**2 / MASS * (s**4 / 4.0 - s**5 / 10.0)
    flown = exact > 1e-4
    assert flown.sum() > 5
    assert trace.displacement[flown] == pytest.approx(exact[flown], rel=1e-3)


@pytest.mark.parametrize("shaft", [False, True], ids=["rigid", "shaft"])
@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_sliding_inertia_takes_the_mismatch(setting: Setting, factor: float, shaft: bool) -> None:
    """Angular momentum of both sides stays, k J1 dw1 = - J2 dw2, whatever the strikes."""
    if shaft:
        setting = setting.with_mechanism(ring_inertia=3e-4, input_stiffness=15e3)
    heavy = EFFECTS["sliding_inertia"].apply(setting, {"inertia_factor": factor})
    found, rings = _shifted(heavy), setting.clutch.rings
    trace, ring = found.trace, 3e-4 if shaft else 0.0
    behind = found.run.states[:, INPUT_SIDE_SPEED] if shaft else trace.sliding_speed
    gained = ring * trace.sliding_speed + (factor * rings.sliding_inertia - ring) * behind
    lost = rings.output_inertia * (50.0 * RPM - trace.output_speed)
    most = float(np.abs(gained).max())
    assert most > 0.5 * rings.sliding_inertia * 50.0 * RPM
    assert gained == pytest.approx(lost, rel=1e-3, abs=1e-3 * most)


def test_a_linkage_swings_as_two_masses_on_a_spring(setting: Setting) -> None:
    """Response of u = y - x to a step of force, damped frequency included."""
    force, step, behind = 100.0, 1e-4, 0.2
    pushed = _free(setting).with_point(profile=ForceProfile(force, step))
    values = {"compliance_mm_kN": 20.0, "mass_behind_kg": behind}
    trace = _shifted(EFFECTS["linkage_compliance"].apply(pushed, values)).trace
    stiffness, far, near = (
        1.0 / 20e-6,
        FORK_MASS_SHARE * MASS + behind,
        (1.0 - FORK_MASS_SHARE) * MASS,
    )
    rate = math.sqrt(stiffness * (far + near) / (far * near))
    damped = rate * math.sqrt(1.0 - DAMPING_RATIO**2)
    t = np.maximum(trace.time - 0.5 * step, 0.0)
    swing = np.cos(damped * t) + DAMPING_RATIO * rate / damped * np.sin(damped * t)
    exact = force / far / rate**2 * (1.0 - np.exp(-DAMPING_RATIO * rate * t) * swing)
    stretch = trace.actuator_displacement - trace.displacement
    assert stretch == pytest.approx(exact, abs=0.005 * exact.max())
    middle = (far * trace.actuator_displacement + near * trace.displacement) / (far + near)
    assert middle == pytest.approx(0.5 * force / (far + near) * t**2, rel=1e-3, abs=1e-6)


def test_limits_of_a_linkage_are_mass_and_compliance_alone(setting: Setting) -> None:
    linkage, mass = EFFECTS["linkage_compliance"], EFFECTS["moving_mass"]
    heavy = mass.apply(setting, {"added_mass_kg": 0.7})
    rigid = linkage.apply(setting, {"compliance_mm_kN": 0.0, "mass_behind_kg": 0.7})
    assert rigid == heavy
    stiff = linkage.apply(setting, {"compliance_mm_kN": 0.1, "mass_behind_kg": 0.7})
    assert _shifted(stiff).shift_time == pytest.approx(_shifted(heavy).shift_time, rel=5e-3)
    light = linkage.apply(setting, {"compliance_mm_kN": 4.0, "mass_behind_kg": 1e-6})
    alone = setting.with_mechanism(compliance=4e-6)
    assert _shifted(light).shift_time == pytest.approx(_shifted(alone).shift_time, rel=1e-3)


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
    trace = engage(changed.clutch, changed.point, 0.1).trace
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
    trace = engage(springy.clutch, springy.point, 12 * DEG).trace
    when = int(np.argmax(trace.actuator_displacement >= setting.clutch.shift_travel))
    assert trace.time[when - 1] <= row["actuator_time_s"] <= trace.time[when]
    assert row["actuator_time_s"] < row["shift_time_s"]
    rigid = next(run_block(setting.block((12 * DEG,))))
    assert replace(setting, sensor="actuator").time_of(rigid) == rigid["shift_time_s"]


def _study(engine: str = "drake", **mechanism: float) -> Setup:
    keys = {f"mechanism.{key}": value for key, value in mechanism.items()}
    return load_study("mq200_paper", {**keys, "solver.engine": engine})


def _shift(study: Setup, mismatch: float, force: float, angle: float) -> Engagement:
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force))
    return engage(study.clutch, point, angle * DEG)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_dead_time_moves_all_times_by_itself(engine: str) -> None:
    delay, studies = 0.05, (_study(engine), _study(engine, delay_s=0.05))
    plain, late = (_shift(study, 50, 469.0, 10) for study in studies)
    assert plain.shift_time is not None
    assert late.shift_time == plain.shift_time + delay
    assert late.actuator_time == plain.actuator_time + delay
    assert (late.events, late.loads) == (plain.events, plain.loads)
    assert len(late.run.times) == len(plain.run.times)
    assert np.array_equal(late.trace.time, plain.trace.time + delay)
    assert np.array_equal(late.trace.displacement, plain.trace.displacement)
    assert [p.name for p in late.phases] == ["dead time", *(p.name for p in plain.phases)]
    assert late.phases[0].end == late.phases[1].start == delay


FLANK = 12.0 * DEG  #: side angle of the prototype's traction flank
RHO = np.arctan(0.10)  #: angle of friction of the dogs


def _leverage(friction: float) -> float:
    """Return axial over tangential force on the ring while a flank throws it back."""
    spline = load_study("mq200_paper", {"mechanism.spline_friction": 0.1}).clutch
    share = 1.0 - 0.3 * spline.dog.mean_radius**2 / spline.rings.sliding_inertia
    radii = spline.dog.mean_radius / spline.mechanism.spline_radius
    return float(np.tan(FLANK - RHO) - friction * share * radii)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_spline_that_locks_holds_the_ring_in_a_flank_strike(engine: str) -> None:
    """tan(beta - rho) < mu_s (1 - m r^2/J1) r/r_s at 0.1, not at 0.05."""
    assert _leverage(0.05) > 0.0 > _leverage(0.1)
    studies = [_study(engine, spline_friction=friction) for friction in (0.05, 0.1)]
    free, held = (_shift(study, 249, 469.0, 14).events.rebound_travel for study in studies)
    assert free > 3e-3
    assert held < 5e-5
