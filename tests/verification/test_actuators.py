"""Actuators against closed forms, and their shifts in both engines."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dogshape.bench.bench_data import Bench, Reading, gather
from dogshape.diagnosis.prediction.building import untried_effects
from dogshape.sim import kernel
from dogshape.sim.effects import load
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError
from dogshape.sim.kernel_layout import (
    ACTUATOR_LEVEL,
    ACTUATOR_NUMBERS,
    AMBIENT_PA,
    REFERENCE_PA,
    empty_record,
)
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import (
    COMMAND_RISE_S,
    EXAMPLES,
    Actuator,
    Cam,
    Hydraulic,
    Motor,
    Pneumatic,
    Solenoid,
    Spring,
)
from dogshape.sim.shift.clutch import ENGINES, Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, HeldActuator, Outcome
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.planar import touch_time
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, RPM, from_si

FAR_GAP = 90e-3  #: axial gap that no ring here closes, m
HEAVY = 1000.0  #: mass of a ring that stays where it is, kg
LIGHT = 0.01  #: mass of a ring that an actuator does not feel, kg
EFFECTS = load()


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def _profile(actuator: Actuator, **changes: float) -> ForceProfile:
    return ForceProfile(actuator.full_force, COMMAND_RISE_S, **changes)


def _free(
    clutch: Clutch,
    engine: str,
    actuator: Actuator,
    *,
    until: float,
    mass: float = 0.3,
    profile: ForceProfile | None = None,
    **mechanism: float,
) -> Engagement:
    """Push a ring that never meets the other for a time in s."""
    pushed = replace(
        clutch,
        dog=replace(clutch.dog, axial_gap=FAR_GAP),
        rings=replace(clutch.rings, mass=mass),
        actuator=actuator,
        mechanism=Mechanism(**mechanism),
        timeout=until,
    )
    fine = pushed.with_engine(engine).refined()
    result = engage(fine, OperatingPoint(RPM, profile or _profile(actuator)), 0.0)
    assert result.outcome is Outcome.TIMED_OUT
    assert np.abs(result.trace.contact_force).max() < 0.02 * actuator.full_force
    return result


def _close(values: Array, exact: Array | float, scale: float) -> None:
    """Require 1 % of a scale."""
    assert values == pytest.approx(exact, rel=0.0, abs=0.01 * scale)


def test_a_ring_on_a_spring_swings(clutch: Clutch, engine: str) -> None:
    """x = F/c (1 - cos wt) and the force F cos wt, up to where the spring is relaxed."""
    spring = Spring(preload=300.0, rate=2e4)
    swing = math.sqrt(spring.rate / 0.3)
    trace = _free(clutch, engine, spring, until=0.5 * math.pi / swing).trace
    reach = spring.reach(300.0)
    _close(trace.displacement, reach * (1.0 - np.cos(swing * trace.time)), reach)
    _close(trace.shift_force, 300.0 * np.cos(swing * trace.time), 300.0)
    later = _free(clutch, engine, spring, until=3.0 / swing).trace
    assert later.shift_force[-1] == 0.0
    assert later.axial_speed[-1] == pytest.approx(reach * swing, rel=1e-3)


def test_a_stiff_cam_prescribes_the_travel(clutch: Clutch, engine: str) -> None:
    cam = Cam(
        stroke=8e-3,
        ramp=60 * DEG,
        drum_speed=250 * RPM,
        stiffness=1e9,
        force_limit=9e4,
        dwell=15 * DEG,
    )
    trace = _free(clutch, engine, cam, until=0.06).trace
    share = np.clip((trace.time - 0.01) / 0.04, 0.0, 1.0)
    _close(trace.displacement, 8e-3 * share**2 * (3.0 - 2.0 * share), 8e-3)
    assert trace.displacement[-1] == pytest.approx(8e-3, rel=1e-3)


def test_a_cam_pushes_with_its_limit_at_most(clutch: Clutch) -> None:
    cam = replace(EXAMPLES["cam"], drum_speed=1e4 * RPM)
    trace = _free(clutch, "planar", cam, until=0.006).trace
    assert np.abs(trace.shift_force).max() == pytest.approx(cam.full_force)
    limited = (trace.time > 1e-3) & (trace.time < 2e-3)
    start, *_, end = np.flatnonzero(limited)
    gain = trace.axial_speed[end] - trace.axial_speed[start]
    time = trace.time[end] - trace.time[start]
    assert gain == pytest.approx(cam.full_force / 0.3 * time, rel=1e-3)


def test_a_motor_runs_up_with_its_time_constant(clutch: Clutch, engine: str) -> None:
    """v = v0 (1 - exp(-t/tau)) with tau = m v0/F of rotor and ring; then the no-load speed."""
    motor = Motor(
        stall_torque=0.5,
        no_load_speed=600 * RPM,
        torque_limit=0.5,
        inertia=1e-4,
        gear_ratio=1.0,
        lead=5e-3,
        stiffness=5e6,
    )
    top_speed = 600 / 60 * 5e-3
    mass = 1e-4 * motor.ratio**2 + LIGHT
    lag = mass * top_speed / motor.full_force
    trace = _free(clutch, engine, motor, until=7.0 * lag, mass=LIGHT).trace
    _close(trace.axial_speed, top_speed * (1.0 - np.exp(-trace.time / lag)), top_speed)
    assert trace.axial_speed[-1] == pytest.approx(top_speed, rel=2e-3)


def test_a_torque_limit_bounds_the_acceleration(clutch: Clutch) -> None:
    motor = Motor(
        stall_torque=10.0,
        no_load_speed=6000 * RPM,
        torque_limit=0.2,
        inertia=1e-4,
        gear_ratio=2.0,
        lead=5e-3,
        stiffness=5e6,
    )
    assert motor.full_force == pytest.approx(0.2 * motor.ratio)
    trace = _free(clutch, "planar", motor, until=0.05).trace
    mass = 1e-4 * motor.ratio**2 + 0.3
    travel = 0.5 * motor.full_force / mass * trace.time**2
    _close(trace.displacement, travel, travel[-1])


def test_a_closed_cylinder_fills_linearly_while_the_flow_is_choked(
    clutch: Clutch, engine: str
) -> None:
    """(p - p0) V = C p_n p_s t, isothermal, up to the critical ratio (ISO 6358-1)."""
    cylinder = Pneumatic(
        supply=8e5, area=1e-4, dead_volume=1e-4, conductance=2e-9, critical_ratio=0.4
    )
    supply = AMBIENT_PA + 8e5
    time = (0.4 * supply - AMBIENT_PA) * 1e-4 / (2e-9 * REFERENCE_PA * supply)
    trace = _free(clutch, engine, cylinder, until=time, mass=HEAVY).trace
    rise = 2e-9 * REFERENCE_PA * supply * trace.time / 1e-4
    _close(trace.shift_force, 1e-4 * rise, 1e-4 * rise[-1])


def test_air_flow_is_the_ellipse_of_the_standard() -> None:
    ratios = np.linspace(0.0, 0.999, 100)
    flow = [kernel.air_flow(ratio, 0.3) for ratio in ratios]
    exact = np.sqrt(1.0 - (np.maximum(ratios - 0.3, 0.0) / 0.7) ** 2)
    assert flow == pytest.approx(exact, rel=1e-12)
    assert kernel.air_flow(1.0, 0.3) == 0.0


def test_an_oil_cylinder_moves_with_the_flow_of_its_orifice(clutch: Clutch, engine: str) -> None:
    """v = Q/A with Q by the root of the drop, of which a damper takes a share."""
    cylinder = Hydraulic(
        supply=20e5, area=2.5e-4, dead_volume=5e-6, flow=3.0 / 60e3, drop=5e5, bulk_modulus=1.4e9
    )
    flow = 3.0 / 60e3 * math.sqrt(20e5 / 5e5)
    idle = _free(clutch, engine, cylinder, until=0.02, mass=LIGHT)
    assert idle.trace.axial_speed[-1] == pytest.approx(flow / 2.5e-4, rel=0.01)
    loaded = _free(clutch, engine, cylinder, until=0.02, mass=LIGHT, damping=800.0)
    # (v A/Q)^2 = 1 - d v/(A p)
    a, b = (2.5e-4 / flow) ** 2, 800.0 / (2.5e-4 * 20e5)
    speed = (math.sqrt(b * b + 4.0 * a) - b) / (2.0 * a)
    assert speed < 0.8 * flow / 2.5e-4
    assert loaded.trace.axial_speed[-1] == pytest.approx(speed, rel=0.01)


def test_the_current_of_a_blocked_solenoid_rises_with_its_time_constant(
    clutch: Clutch, engine: str
) -> None:
    """i = U/R (1 - exp(-t R/L)), and the force from it less the spring."""
    solenoid = Solenoid(
        start_force=60.0,
        end_force=180.0,
        stroke=3e-3,
        voltage=12.0,
        resistance=2.1,
        inductance=9e-3,
        return_preload=25.0,
    )
    result = _free(clutch, engine, solenoid, until=0.02, mass=HEAVY)
    trace = result.trace
    current = 1.0 - np.exp(-trace.time * 2.1 / 9e-3)
    level = result.run.states[:, ACTUATOR_LEVEL]
    _close(level, current, 1.0)
    _close(trace.shift_force, np.maximum(60.0 * current**2 - 25.0, 0.0), 60.0)


def test_the_closing_armature_lowers_the_current(clutch: Clutch) -> None:
    """Flux L i of a fast armature stays: the current falls with the inductance's rise."""
    solenoid = replace(EXAMPLES["solenoid"], resistance=1e-3, voltage=0.1)
    numbers = _numbers(solenoid, solenoid.full_force)
    speed = 10.0

    def rates(time: float, state: Array) -> list[float]:
        return list(kernel.actuator_rates(time, speed * time, speed, *state.tolist(), numbers))

    end = 0.9 * solenoid.stroke
    flux = solve_ivp(rates, (0.0, end / speed), [0.0, 0.5], rtol=1e-9, atol=1e-12)
    open_gap = solenoid.residual_gap + solenoid.stroke
    assert flux.y[1, -1] == pytest.approx(0.5 * (open_gap - end) / open_gap, rel=1e-3)


def _numbers(actuator: Actuator, force: float, **changes: float) -> Any:
    numbers = empty_record(ACTUATOR_NUMBERS)
    actuator.write(numbers, ForceProfile(force, COMMAND_RISE_S, **changes), 0.3)
    return numbers


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_force_of_a_point_is_the_largest_static_one(kind: str) -> None:
    """A fork that stands, where the force is largest, feels the force that was asked for."""
    actuator = EXAMPLES[kind]
    for share in (0.6, 1.0):
        force = share * actuator.full_force
        numbers = _numbers(actuator, force)
        travel = actuator.reach(force) if kind == "solenoid" else 0.0
        fork = (travel, 0.0)

        def rates(time: float, state: Array, fork: Any = fork, numbers: Any = numbers) -> Any:
            return kernel.actuator_rates(time, *fork, *state.tolist(), numbers)

        start = [0.0, actuator.initial_level(force)]
        states = solve_ivp(rates, (0.0, 1.0), start, method="LSODA", rtol=1e-8, atol=1e-10).y
        found = kernel.actuator_force(1.0, *fork, *states[:, -1], numbers)
        assert found == pytest.approx(force, rel=1e-3)


@pytest.mark.parametrize("kind", EXAMPLES)
def test_delay_shifts_and_loss_scales(clutch: Clutch, kind: str) -> None:
    actuator = EXAMPLES[kind]
    own = replace(clutch.with_engine("planar"), actuator=actuator)
    profile = _profile(actuator)
    plain, late = (
        engage(own, OperatingPoint(50 * RPM, replace(profile, delay=delay)), 3 * DEG)
        for delay in (0.0, 0.02)
    )
    assert plain.outcome is Outcome.ENGAGED
    assert plain.shift_time is not None
    assert late.shift_time == pytest.approx(plain.shift_time + 0.02, abs=1e-12)
    lossy = _numbers(actuator, profile.force, loss=0.25 * profile.force)
    place = (1.0, 1e-3, 0.0, 1.1e-3, 0.9)
    whole = kernel.actuator_force(*place, _numbers(actuator, profile.force))
    assert kernel.actuator_force(*place, lossy) == pytest.approx(0.75 * whole)


#: Values of the effects of an actuator, all of which make a shift later.
LATER = {
    "actuation_delay": {"delay_s": 0.03},
    "actuation_lag": {"lag_s": 0.02},
    "force_loss": {"loss_N": 90.0},
    "force_scale": {"force_factor": 0.7},
    "force_rise": {"rise_factor": 2.0},
    "sleeve_friction": {"friction_N": 150.0},
    "viscous_damping": {"damping_Ns_m": 400.0},
}


def _travel_time(setting: Setting) -> float:
    """Time from the command until a ring that meets no dog has made the travel, s."""
    clutch = setting.clutch
    free = replace(clutch, dog=replace(clutch.dog, axial_gap=clutch.shift_travel))
    return touch_time(free, setting.point.profile) + setting.delay


@pytest.mark.parametrize("kind", EXAMPLES)
def test_effects_make_shifts_of_each_kind_later_or_are_refused(clutch: Clutch, kind: str) -> None:
    """A delay by itself; a lag where the kind has no course of its own; no kind has a rise.

    Contact hides the sense: a later ring may meet a slot in place of a dog. So the ring flies free,
    against friction and oil, as cam, spindle and oil move a ring without resistance at any force.
    """
    actuator = EXAMPLES[kind]
    if isinstance(actuator, Cam):
        actuator = replace(actuator, drum_speed=1000 * RPM)  # so that the limit of its force acts
    loaded = Mechanism(friction=100.0, damping=200.0)
    own = replace(clutch.with_engine("planar"), actuator=actuator, mechanism=loaded)
    setting = Setting(own, OperatingPoint(50 * RPM, _profile(actuator)))
    reading = Reading(2, setting.point, 1, 0.1, engaged=True)
    bench = Bench(name=kind, source="", clutch=own, cells=gather([reading]))
    untried = untried_effects(bench, EFFECTS)
    expected = {"force_rise"}
    if actuator.own_course:
        expected.add("actuation_lag")
        assert untried["actuation_lag"] == (
            f"the {kind} actuator has a course of its own, {actuator.own_course}"
        )
        with pytest.raises(InputError, match=r"mechanism\.lag_s is 0\.02 s, but the"):
            EFFECTS["actuation_lag"].apply(setting, LATER["actuation_lag"])
    assert set(untried) == expected
    assert untried["force_rise"] == f"the {kind} actuator has no rise time that it could scale"
    plain = _travel_time(setting)
    assert plain < 0.2
    for name, values in LATER.items():
        if name in untried:
            continue
        later = _travel_time(EFFECTS[name].apply(setting, values))
        if name == "actuation_delay":
            assert later == pytest.approx(plain + 0.03, abs=1e-12)
        else:
            assert later > plain + 2e-5, name


def test_a_wide_valve_gives_pressure_times_area_at_once(clutch: Clutch) -> None:
    cylinder = Pneumatic(supply=6e5, area=8e-4, dead_volume=1e-4, conductance=1e-6)
    at_once = _profile(cylinder)
    assert at_once.force == pytest.approx(480.0)
    point = OperatingPoint(50 * RPM, at_once)
    times = []
    for actuator in (None, cylinder):
        own = replace(clutch.with_engine("planar"), actuator=actuator)
        times.append(engage(own, point, 3 * DEG).shift_time)
    assert times[0] is not None
    assert times[1] == pytest.approx(times[0], rel=0.01)


@pytest.mark.parametrize("kind", ["pneumatic", "hydraulic", "solenoid"])
def test_a_logged_channel_gives_the_force_of_the_shift(clutch: Clutch, kind: str) -> None:
    """Pressure or current of a simulated shift, over its travel."""
    actuator = EXAMPLES[kind]
    own = replace(clutch.with_engine("planar"), actuator=actuator)
    share = 0.8
    force = share * actuator.full_force
    result = engage(own, OperatingPoint(50 * RPM, ForceProfile(force, COMMAND_RISE_S)), 3 * DEG)
    level = result.run.states[:, ACTUATOR_LEVEL]
    values = level * 12.0 / 2.1  # A
    if kind == "pneumatic":
        values = level * (AMBIENT_PA + actuator.logged_level(force)) - AMBIENT_PA
    elif kind == "hydraulic":
        values = level * actuator.logged_level(force)
    logged = actuator.logged_force(values, result.trace.displacement)
    pushing = result.trace.shift_force > 1.0
    assert pushing.any()
    _close(logged[pushing], result.trace.shift_force[pushing], 0.01 * force)


@pytest.mark.parametrize(
    ("kind", "key", "value", "force"),
    [
        ("pneumatic", "supply_bar", 6.0, 6e5 * 12.5e-4 - 50.0),
        ("hydraulic", "supply_bar", 15.0, 15e5 * 2.5e-4 - 50.0),
        ("solenoid", "voltage_V", 9.0, 450.0 * (9.0 / 12.0) ** 2 - 25.0),
        ("solenoid", "current_A", 4.0, 450.0 * (4.0 * 2.1 / 12.0) ** 2 - 25.0),
    ],
)
def test_a_set_value_gives_its_static_force(
    kind: str, key: str, value: float, force: float
) -> None:
    actuator = EXAMPLES[kind]
    assert actuator.set_force(key, value) == pytest.approx(force)
    if key != "voltage_V":
        assert from_si(actuator.logged_key, actuator.logged_level(force)) == pytest.approx(value)
    with pytest.raises(InputError, match=f"{key} is {10.0 * value:g} .* exceed the"):
        actuator.set_force(key, 10.0 * value)
    with pytest.raises(InputError, match=f"{key} is 0.01 .* it leaves"):
        actuator.set_force(key, 0.01)


def test_a_lag_of_first_order_delays_a_spring(clutch: Clutch, engine: str) -> None:
    """F = F0 (1 - exp(-t/tau)) of a soft spring, and the speed that it gives."""
    spring = Spring(preload=300.0, rate=0.0)
    trace = _free(clutch, engine, spring, until=0.02, profile=_profile(spring, lag=0.01)).trace
    _close(trace.shift_force, 300.0 * (1.0 - np.exp(-trace.time / 0.01)), 300.0)
    gain = trace.time - 0.01 * (1.0 - np.exp(-trace.time / 0.01))
    _close(trace.axial_speed, 1000.0 * gain, 1000.0 * gain[-1])


def test_friction_holds_the_ring_until_the_pressure_is_up(clutch: Clutch) -> None:
    """Release at R = A (p - p0), choked."""
    cylinder = Pneumatic(supply=8e5, area=5e-4, dead_volume=1e-4, conductance=2e-9)
    own = replace(
        clutch.with_engine("planar"), actuator=cylinder, mechanism=Mechanism(friction=80.0)
    )
    result = engage(own, OperatingPoint(50 * RPM, _profile(cylinder)), 3 * DEG)
    supply = AMBIENT_PA + 8e5
    release = 80.0 / 5e-4 * 1e-4 / (2e-9 * REFERENCE_PA * supply)
    moving = result.run.times[result.run.states[:, 1] > 0.0]
    assert moving[0] == pytest.approx(release, rel=0.01)
    assert result.outcome is Outcome.ENGAGED


@pytest.mark.parametrize("mechanism", [{}, {"compliance": 1e-5}], ids=["ring", "linkage"])
@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_held_ring_is_let_go_as_the_whole_motion_says(
    clutch: Clutch, monkeypatch: pytest.MonkeyPatch, kind: str, mechanism: dict[str, float]
) -> None:
    """The actuator's own states until friction gives way, against one run of all."""
    actuator = EXAMPLES[kind]
    held = replace(
        clutch,
        dog=replace(clutch.dog, axial_gap=FAR_GAP),
        actuator=actuator,
        mechanism=Mechanism(friction=60.0, **mechanism),
        timeout=0.04,
    ).with_engine("planar")
    point = OperatingPoint(50 * RPM, _profile(actuator))
    split = engage(held, point, 0.0).trace
    level = actuator.initial_level(actuator.full_force)
    at_once = HeldActuator(*np.zeros((4, 1)), np.array([level]))
    monkeypatch.setattr("dogshape.sim.shift.conclusion.release", lambda *_: at_once)
    whole = engage(held, point, 0.0).trace
    assert split.displacement[-1] > 1e-3
    for name in ("displacement", "actuator_displacement"):
        assert getattr(split, name)[-1] == pytest.approx(getattr(whole, name)[-1], rel=0.01)


@pytest.mark.parametrize(
    ("kind", "engine"),
    [("spring", "planar"), ("pneumatic", "planar"), ("motor", "planar"), ("motor", "drake")],
)
def test_flat_dogs_that_meet_are_blocked(clutch: Clutch, kind: str, engine: str) -> None:
    """Once the actuator's force is up, long before the time-out."""
    flat = replace(clutch.dog, chamfer=0.0)
    own = replace(clutch, dog=flat, actuator=EXAMPLES[kind], timeout=3.0).with_engine(engine)
    result = engage(own, OperatingPoint(0.5 * RPM, _profile(EXAMPLES[kind])), 1 * DEG)
    assert result.outcome is Outcome.BLOCKED
    assert result.run.times[-1] < 2.5


@pytest.mark.parametrize("kind", EXAMPLES)
def test_shifts_follow_drake(clutch: Clutch, kind: str) -> None:
    """With friction and a linkage: within 0.1 % of the shift time."""
    mechanism = Mechanism(added_mass=0.3, compliance=3e-7, friction=20.0)
    own = replace(clutch, actuator=EXAMPLES[kind], mechanism=mechanism)
    point = OperatingPoint(50 * RPM, _profile(EXAMPLES[kind]))
    times = [engage(own.with_engine(name), point, 3 * DEG).shift_time for name in ENGINES]
    assert times[0] is not None
    assert times[1] == pytest.approx(times[0], rel=1e-3)
