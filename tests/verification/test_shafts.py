"""Shafts that give way, play of the spline, and the torque peak of a driveline."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim import kernel
from dogshape.sim.kernel_layout import (
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
    STATE_SIZE,
    STEP_MODE,
    StepLimits,
    shift_model,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.mechanism import SHAFT_DAMPING, STOP_TWIST_RAD, Mechanism, Shaft
from dogshape.sim.shift.planar import NO_LOOK, PlanarClutch
from dogshape.sim.shift.trace import Trace, torque_peak
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.strength.strike import Strike, two_mass_torque
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point, dog_of

RING, WHEEL = 5e-4, 1e-2  #: kg m2
INPUT, OUTPUT = 15e3, 8e3  #: N m/rad
#: Angles and speeds of a side and its ring, by shaft.
SHAFT_COLUMNS = (
    (INPUT_SIDE_ANGLE, SLIDING_ANGLE, INPUT_SIDE_SPEED, SLIDING_SPEED),
    (OUTPUT_SIDE_ANGLE, OUTPUT_ANGLE, OUTPUT_SIDE_SPEED, OUTPUT_SPEED),
)
GIVING = Mechanism(
    ring_inertia=RING, input_stiffness=INPUT, wheel_inertia=WHEEL, output_stiffness=OUTPUT
)
STRIKE = 100.0 * RPM
PLAY = replace(GIVING, backlash=0.2 * DEG)


def _clutch(mechanism: Mechanism, engine: str = "planar") -> Clutch:
    return replace(load_study("mq200_paper").clutch, mechanism=mechanism).with_engine(engine)


def _shift(mechanism: Mechanism, mismatch: float, engine: str = "planar") -> Engagement:
    study = load_study("mq200_paper")
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(469.0))
    return engage(_clutch(mechanism, engine), point, 3.0 * DEG)


def _free(mechanism: Mechanism, start: dict[int, float], until: float) -> np.ndarray:
    """Integrate rings that touch nothing from a state, and return the last one, (12,)."""
    plant = PlanarClutch(_clutch(mechanism))
    state = np.zeros(STATE_SIZE)
    for column, value in start.items():
        state[column] = value
    knots = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    progress = kernel.advance(
        0.0,
        1e-6,
        state,
        look_state=NO_LOOK,
        pause=until,
        timeout=until,
        model=shift_model(plant.clutch.numbers, knots, plant.surfaces, plant.law),
        limits=StepLimits(speed_error=1e-7, place_error=1e-11, max_step=1e-4),
        mode=np.zeros(1, STEP_MODE),
        times=np.empty(200_000),
        states=np.empty((200_000, STATE_SIZE)),
    )
    assert progress.reason == kernel.PAUSED
    return state


@pytest.mark.parametrize(
    ("near", "whole", "stiffness", "columns"),
    [
        (RING, 0.01, INPUT, (SLIDING_ANGLE, INPUT_SIDE_ANGLE)),
        (WHEEL, 0.6048, OUTPUT, (OUTPUT_ANGLE, OUTPUT_SIDE_ANGLE)),
    ],
)
def test_a_twisted_shaft_swings_as_two_inertias_on_a_spring(
    near: float, whole: float, stiffness: float, columns: tuple[int, int]
) -> None:
    """Free damped vibration, Rao section 2.6: the lead after some periods."""
    reduced = near * (whole - near) / whole
    rate = math.sqrt(stiffness / reduced)
    damped = rate * math.sqrt(1.0 - SHAFT_DAMPING**2)
    lead, until = 1e-3, 3.3 * 2.0 * math.pi / rate
    ring, behind = columns
    state = _free(GIVING, {behind: lead}, until)
    swing = math.cos(damped * until) + SHAFT_DAMPING * rate / damped * math.sin(damped * until)
    expected = lead * math.exp(-SHAFT_DAMPING * rate * until) * swing
    assert state[behind] - state[ring] == pytest.approx(expected, abs=1e-3 * lead)
    # The middle of mass stays where it was.
    middle = near * state[ring] + (whole - near) * state[behind]
    assert middle == pytest.approx((whole - near) * lead, rel=1e-6)


def test_flanks_of_a_play_push_and_never_pull() -> None:
    shaft = Shaft(RING, 0.0095, INPUT, 5.0, backlash=2e-3)
    leads = np.array([-3e-3, -1e-3, 0.0, 1e-3, 3e-3])
    torques = shaft.torque(leads, 0.0 * leads)
    assert torques == pytest.approx([-INPUT * 2e-3, 0.0, 0.0, 0.0, INPUT * 2e-3])
    parting = float(shaft.torque(1.1e-3, -100.0))
    assert parting == 0.0
    pressed = float(shaft.torque(1e-3 + STOP_TWIST_RAD, 2.0))
    assert pressed == pytest.approx(INPUT * STOP_TWIST_RAD + 0.5 * 5.0 * 2.0)


@pytest.mark.parametrize("engine", ["planar", "drake"])
@pytest.mark.parametrize("mechanism", [GIVING, PLAY], ids=["tight", "play"])
def test_angular_momentum_stays(mechanism: Mechanism, engine: str) -> None:
    states = _shift(mechanism, 149.0, engine).run.states
    output, sliding, behind, ahead = states[
        :, [OUTPUT_SPEED, SLIDING_SPEED, INPUT_SIDE_SPEED, OUTPUT_SIDE_SPEED]
    ].T
    total = RING * sliding + (0.01 - RING) * behind + WHEEL * output + (0.6048 - WHEEL) * ahead
    assert total == pytest.approx(np.full(len(total), 0.6048 * 149.0 * RPM), rel=1e-9)


@pytest.mark.parametrize("engine", ["planar", "drake"])
def test_stiff_shafts_are_rigid_ones(engine: str) -> None:
    stiff = Mechanism(
        ring_inertia=5e-3, input_stiffness=5e6, wheel_inertia=0.3, output_stiffness=5e6
    )
    rigid, found = (_shift(m, 50.0, engine) for m in (Mechanism(), stiff))
    assert found.shift_time == pytest.approx(rigid.shift_time, rel=1e-3)


@pytest.mark.parametrize("mismatch", [50.0, 149.0, -149.0])
def test_engines_agree_on_shafts(mismatch: float) -> None:
    drake, planar = (_shift(GIVING, mismatch, engine) for engine in ("drake", "planar"))
    assert planar.shift_time == pytest.approx(drake.shift_time, rel=5e-3)
    # Torque still rises where a shift ends, and an engine ends its trace up to a step later.
    times = np.linspace(0.0, min(e.trace.time[-1] for e in (drake, planar)), 10_001)
    for shaft, places in zip(drake.clutch.shafts, SHAFT_COLUMNS, strict=True):
        found = []
        for e in (drake, planar):
            far, near, far_rate, rate = e.run.states[:, places].T
            torque = shaft.torque(far - near, far_rate - rate)
            found.append(np.abs(np.interp(times, e.trace.time, torque)).max())
        assert found[1] == pytest.approx(found[0], rel=0.02)


def _first_strike(mechanism: Mechanism) -> float:
    """Peak torque of the first strike of upright flanks without friction and loss, N m."""
    clutch = load_study("mq200_paper").clutch
    dog = replace(clutch.dog, traction=0.0, chamfer=0.0)
    contact = replace(clutch.contact, dissipation=0.0, static_friction=0.0, dynamic_friction=0.0)
    own = replace(clutch, dog=dog, contact=contact, mechanism=mechanism, timeout=0.05)
    point = OperatingPoint(STRIKE, ForceProfile(469.0, 0.1766))
    found = engage(own.with_engine("planar").refined(), point, 23.0 * DEG)
    torque = np.abs(found.trace.tangential_force) * dog.mean_radius
    struck = torque > 1.0
    begin = int(np.argmax(struck))
    end = begin + int(np.argmin(struck[begin:]))
    assert 2e-3 < found.trace.displacement[begin] < 4e-3  # flank on flank
    return float(torque[begin:end].max())


@pytest.mark.parametrize("side", ["ring", "wheel"])
def test_a_strike_is_that_of_the_closed_form(side: str) -> None:
    """Soft shaft: what stands at the flanks alone; stiff: all of its side; between: a bound.

    The stiffness of the dogs follows from the strike of rigid sides. It is no constant, since
    flanks touch over more of their length the deeper they are pressed: 3 to 4 %.
    """
    whole = {"ring": 0.01, "wheel": 0.6048}
    part = {"ring": 1e-3, "wheel": 2e-3}[side]
    sides = [part if side == name else whole[name] for name in ("ring", "wheel")]
    rigid = _first_strike(Mechanism())
    stiffness = (rigid / STRIKE) ** 2 * 0.6148 / (0.01 * 0.6048)
    alone = two_mass_torque(STRIKE, stiffness, *sides)

    def both(shaft: float) -> tuple[float, float]:
        keys = {"ring": "input_stiffness", "wheel": "output_stiffness"}
        mechanism = Mechanism(**{f"{side}_inertia": part, keys[side]: shaft})
        near, far = (shaft if side == name else None for name in ("ring", "wheel"))
        strike = Strike(sides[0], 0.01, near or 1e9, sides[1], 0.6048, far)
        return _first_strike(mechanism), strike.torque(STRIKE, stiffness)

    assert both(100.0)[0] == pytest.approx(alone, rel=0.04)
    assert alone < 0.5 * rigid
    stiff, closed = both(1e7)
    assert stiff == pytest.approx(closed, rel=0.01)
    for shaft in (1e4, 1e5, 1e6):
        found, closed = both(shaft)
        assert 0.95 * alone < found < 1.02 * closed


def test_dogs_that_wait_for_the_rest_to_cross_its_play_are_not_blocked_yet() -> None:
    """Friction holds faces on faces, but the rest still turns towards the end of its play."""
    study = load_study("mq200_paper")
    clutch = _clutch(replace(PLAY, backlash=20.0 * DEG, drag_torque=0.01))
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=1.0 * DEG))
    point = OperatingPoint(10.0 * RPM, study.actuation.profile(641.5))
    held = engage(flat, point, 0.0)
    assert held.outcome is Outcome.BLOCKED
    assert held.trace.time[-1] > 10.0 * DEG / (10.0 * RPM)
    assert (held.loads.input_torque_peak or 0.0) > 0.1


@pytest.mark.parametrize("engine", ["planar", "drake"])
@pytest.mark.parametrize(
    "mechanism",
    [
        Mechanism(ring_inertia=RING, input_stiffness=INPUT),
        Mechanism(wheel_inertia=5e-3, output_stiffness=OUTPUT),
    ],
    ids=["input", "output"],
)
def test_held_rings_with_one_shaft_are_blocked(mechanism: Mechanism, engine: str) -> None:
    """The side without a shaft is its ring, which the landing has set to another speed."""
    study = load_study("mq200_paper")
    clutch = _clutch(mechanism, engine)
    flat = replace(
        clutch,
        dog=replace(clutch.dog, chamfer=0.0),
        rings=replace(clutch.rings, output_inertia=0.01),
        timeout=1.5,
    )
    point = OperatingPoint(1.5 * RPM, study.actuation.profile(469.0))
    held = engage(flat, point, 1.0 * DEG)
    assert held.outcome is Outcome.BLOCKED
    assert held.trace.time[-1] < 0.5  # of a time-out of 1.5 s
    assert held.trace.output_speed[-1] == pytest.approx(0.75 * RPM, rel=0.05)


def test_keys_of_shafts() -> None:
    keys = [
        "mechanism.ring_inertia_kgm2=5e-4",
        "mechanism.input_stiffness_Nm_rad=15000",
        "mechanism.spline_backlash_deg=0.2",
    ]
    study = load_study("mq200_paper", keys)
    assert study.clutch.shafts[0] == Shaft(
        5e-4, 0.0095, 15e3, pytest.approx(2 * 0.02 * math.sqrt(15e3 * 5e-4 * 0.95)),
        pytest.approx(0.2 * DEG),
    )  # fmt: skip
    assert study.physics_hash != load_study("mq200_paper").physics_hash


STIFFNESS = 320.0  #: N m/rad
CHOSEN = (10.6325, 6.8912, 24.4977, 2.48494, 31)  #: by an earlier search
Series = NDArray[np.float64]


def _trace(clutch: Clutch, time: Series, torque: Series, mismatch: float = 0.0) -> Trace:
    """Make up a trace in which the contact gives a torque (n - 1,) in the steps between times."""
    taken = np.concatenate([[0.0], np.cumsum(torque * np.diff(time))])
    series = {name: np.zeros(time.size) for name in Trace.__dataclass_fields__}
    force = np.concatenate([[0.0], torque]) / clutch.dog.mean_radius
    left = mismatch - taken / clutch.rings.reduced_inertia
    return Trace(**{**series, "time": time, "tangential_force": force, "output_speed": left})


def test_response_is_that_of_the_motion_under_any_torque(clutch: Clutch) -> None:
    rings, draw = clutch.rings, np.random.default_rng(3)
    time = np.concatenate([[0.0], np.cumsum(draw.uniform(1e-3, 8e-3, 30))])
    torque = draw.normal(0.0, 40.0, 30)

    def motion(now: float, state: Series) -> list[float]:
        near, far, twist = map(float, state)
        given = torque[min(int(np.searchsorted(time, now, side="right")) - 1, 29)]
        spring = STIFFNESS * twist
        drive = given / rings.reduced_inertia  # of the mismatch, into the twist's rate
        return [drive - spring / rings.sliding_inertia, spring / rings.output_inertia, near - far]

    state, peak = np.zeros(3), 0.0
    for start, end in pairwise(time):
        run = solve_ivp(motion, (start, end - 1e-12), state, rtol=1e-9, atol=1e-12, max_step=2e-5)
        state, peak = run.y[:, -1], max(peak, float(STIFFNESS * np.abs(run.y[2]).max()))
    rate = math.sqrt(STIFFNESS / rings.reduced_inertia)
    peak = max(peak, STIFFNESS * math.hypot(state[2], (state[0] - state[1]) / rate))
    found = torque_peak(clutch, _trace(clutch, time, torque), STIFFNESS)
    assert found == pytest.approx(peak, rel=1e-5)


def test_mismatch_that_an_early_strike_takes_counts(clutch: Clutch, point: Point) -> None:
    """One strike takes nearly all of 249 1/min and throws the ring back; then it creeps in."""
    hard = replace(clutch, dog=dog_of(clutch.dog, CHOSEN))
    result = engage(hard, point(249, 469.0), 0.55 * hard.dog.pitch_angle)
    peak = torque_peak(hard, result.trace, STIFFNESS)
    all_of_it = 249 * RPM * math.sqrt(STIFFNESS * hard.rings.reduced_inertia)
    assert all_of_it == pytest.approx(46.26, abs=0.01)
    assert result.loads.residual_mismatch is not None
    assert abs(result.loads.residual_mismatch) < 0.2 * 249 * RPM
    assert 0.95 * all_of_it < peak < 1.5 * all_of_it
    assert result.loads.strike_mismatch == pytest.approx(243 * RPM, rel=0.02)
