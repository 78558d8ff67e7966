"""Effects of force, linkage and inertia in both engines, against closed forms and limit cases."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import ENGINES, Clutch
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.mechanism import DAMPING_RATIO, FORK
from dogshape.sim.statistics.blocks import engage
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
def test_the_sliding_inertia_takes_up_the_mismatch(
    setting: Setting, factor: float, shaft: bool
) -> None:
    """Angular momentum of both sides stays, k J1 dw1 = - J2 dw2, whatever the strikes."""
    if shaft:
        setting = setting.with_mechanism(ring_inertia=3e-4, input_stiffness=15e3)
    heavy = EFFECTS["sliding_inertia"].apply(setting, {"inertia_factor": factor})
    trace, rings = _shifted(heavy).trace, setting.clutch.rings
    ring = 3e-4 if shaft else 0.0
    behind = trace.sliding_speed if trace.input_speed is None else trace.input_speed
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
    stiffness, far, near = 1.0 / 20e-6, FORK * MASS + behind, (1.0 - FORK) * MASS
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
