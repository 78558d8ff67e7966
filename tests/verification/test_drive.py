"""Speed of both shafts and torques on them, in both engines, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.effects import load
from dogshape.sim.errors import InputError
from dogshape.sim.kernel_layout import (
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
)
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import ENGINES, Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.drive import Drive, SpeedControl, TorqueCourse, impulses
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.statistics.shift_records import clutch_record, content_key
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point

EFFECTS = load()
NEAR, FAR = 0.01, 0.6048  #: inertias of sliding and output ring of the prototype, kg m2
REDUCED = NEAR * FAR / (NEAR + FAR)


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def _free(
    clutch: Clutch, engine: str, time: float, mismatch_rpm: float, drive: Drive, **mechanism: float
) -> Engagement:
    """Let both rings turn for ``time`` s with dogs too far apart to meet."""
    apart = replace(clutch, dog=replace(clutch.dog, axial_gap=90e-3), timeout=time)
    driven = replace(apart, mechanism=Mechanism(**mechanism), drive=drive)
    point = OperatingPoint(mismatch_rpm * RPM, ForceProfile(1.0, 0.1))
    result = engage(driven.with_engine(engine), point, 0.0)
    assert result.outcome is Outcome.TIMED_OUT
    assert np.abs(result.trace.tangential_force).max() < 1e-3
    if result.loads.input_torque_peak is None:  # a shaft stores some
        first, last = result.run.states[[0, -1]]
        given = 0.5 * NEAR * (last[SLIDING_SPEED] - first[SLIDING_SPEED]) ** 2
        given += 0.5 * FAR * (last[OUTPUT_SPEED] - first[OUTPUT_SPEED]) ** 2
        assert result.loads.energy_dissipated == pytest.approx(0.0, abs=2e-3 + 1e-4 * given)
    return result


@pytest.mark.parametrize(("side", "mismatch_rpm", "sense"), [
    ("sliding", 50.0, -1.0), ("sliding", -50.0, -1.0), ("output", 50.0, 1.0),
])  # fmt: skip
def test_drag_on_a_turning_ring_moves_the_mismatch_linearly(
    clutch: Clutch, engine: str, side: Any, mismatch_rpm: float, sense: float
) -> None:
    """w' = -+ M/J1: before an upshift with the engine at the ring, down and through zero."""
    drive = Drive(shaft_speed=2000 * RPM, engine_side=side)
    trace = _free(clutch, engine, 0.05, mismatch_rpm, drive, drag_torque=2.0).trace
    exact = mismatch_rpm * RPM + sense * 2.0 / NEAR * trace.time
    assert trace.relative_speed == pytest.approx(exact, rel=1e-6, abs=1e-6)
    assert np.sign(trace.sliding_speed[0]) == sense
    wheels = trace.output_speed if side == "sliding" else trace.sliding_speed
    assert wheels[0] == pytest.approx(sense * 2000 * RPM)
    faster = np.abs(trace.sliding_speed) - np.abs(trace.output_speed)
    assert faster[0] * (1.0 if side == "sliding" else -1.0) * mismatch_rpm > 0.0


def test_shafts_that_turn_freely_shift_as_shafts_that_stand(clutch: Clutch, point: Point) -> None:
    """A common speed changes nothing where no torque depends on it."""
    still = clutch.with_engine("planar")
    turning = replace(still, drive=Drive(shaft_speed=2000 * RPM))
    times = [
        [engage(own, point(149, 469.0), angle * DEG).shift_time for angle in range(0, 24, 4)]
        for own in (still, turning)
    ]
    assert times[1] == pytest.approx(times[0], rel=2e-3)


def test_torques_over_time_give_their_integral(clutch: Clutch, engine: str) -> None:
    """J w of either ring follows the integral of a piecewise linear torque, as the engine turns."""
    times, near, far = (0.01, 0.02, 0.04), (0.0, 3.0, -1.0), (2.0, 2.0, 8.0)
    drive = Drive(shaft_speed=1000 * RPM, sliding_torque=near, output_torque=far, times=times)
    result = _free(clutch, engine, 0.06, 25.0, drive)
    trace = result.trace
    fine = np.linspace(0.0, 0.06, 600_001)
    for torques, speed, inertia in (
        (near, trace.sliding_speed, NEAR), (far, trace.output_speed, FAR),
    ):  # fmt: skip
        sums = np.cumsum(np.interp(fine, times, torques)) * fine[1]
        exact = speed[0] - np.interp(trace.time, fine, sums) / inertia
        assert speed == pytest.approx(exact, rel=1e-6)
    given = impulses(np.array([0.02, 0.06]), result.run.torques)
    assert given[0] == pytest.approx([-0.015, -0.015], abs=1e-12)
    assert given[1] == pytest.approx([-0.04, -0.3], rel=1e-9)


def test_oil_of_a_pack_slows_the_ring_exponentially(clutch: Clutch, engine: str) -> None:
    """w - w_p falls as exp(-d t/J1)."""
    drive = Drive(shaft_speed=2000 * RPM, pack_viscous=0.3, pack_speed=900 * RPM)
    trace = _free(clutch, engine, 0.08, 50.0, drive).trace
    partner = -900 * RPM
    exact = partner + (trace.sliding_speed[0] - partner) * np.exp(-0.3 / NEAR * trace.time)
    assert trace.sliding_speed == pytest.approx(exact, rel=2e-4)
    assert trace.output_speed == pytest.approx(np.full(exact.shape, -2000 * RPM))


def test_friction_of_a_pack_takes_the_ring_to_its_partner_and_holds_it(
    clutch: Clutch, engine: str
) -> None:
    """w' = M/J towards the partner; on the output side where the engine is there."""
    drive = Drive(
        shaft_speed=2000 * RPM, engine_side="output", pack_torque=400.0, pack_speed=1500 * RPM
    )
    trace = _free(clutch, engine, 0.1, 0.0, drive).trace
    start = (2000 - 1500) * RPM * FAR / 400.0
    falling = trace.time < 0.9 * start
    exact = 2000 * RPM - 400.0 / FAR * trace.time[falling]
    assert trace.output_speed[falling] == pytest.approx(exact, rel=1e-5)
    assert trace.output_speed[-1] == pytest.approx(1500 * RPM, abs=5e-3)
    assert trace.sliding_speed == pytest.approx(np.full(len(trace.time), 2000 * RPM))


def test_a_synchroniser_keeps_the_momentum_and_ends_the_mismatch(
    clutch: Clutch, engine: str
) -> None:
    """J1 w1 + J2 w2 stays; the mismatch is gone after J_red dw/M, and does not come back."""
    drive = Drive(shaft_speed=2000 * RPM, synchroniser=5.0)
    trace = _free(clutch, engine, 0.08, 249.0, drive).trace
    momentum = NEAR * trace.sliding_speed + FAR * trace.output_speed
    assert momentum == pytest.approx(np.full(len(momentum), momentum[0]), rel=1e-12)
    end = REDUCED * 249 * RPM / 5.0
    braking = trace.time < 0.98 * end
    exact = 249 * RPM * (1.0 - trace.time[braking] / end)
    assert trace.relative_speed[braking] == pytest.approx(exact, rel=1e-2)
    crossed = float(np.interp(-1.0, -trace.relative_speed, trace.time))
    assert crossed == pytest.approx(end * (1.0 - 1.0 / (249 * RPM)), rel=1e-3)
    assert np.abs(trace.relative_speed[trace.time > 1.02 * end]).max() < 0.01


CONTROL = SpeedControl(
    set_point=10 * RPM, proportional=0.8, integral=30.0, limit=1e3, dead_time=0.0, cycle=2e-3
)


def test_a_control_approaches_the_continuous_one_as_its_cycle_falls(clutch: Clutch) -> None:
    """J1 e'' + kp e' + ki e = 0: the error of the speed falls with the cycle, order one."""
    start, ratio, natural = -40 * RPM, 0.8 / NEAR, 30.0 / NEAR
    swing = np.roots([1.0, ratio, natural]).astype(complex)
    # e(0) = e0 and e'(0) = -kp/J e0
    weights = np.linalg.solve([[1.0, 1.0], swing], np.array([start, -ratio * start]))
    deviations = []
    for cycle in (2e-3, 1e-3, 5e-4):
        drive = Drive(shaft_speed=3000 * RPM, control=replace(CONTROL, cycle=cycle))
        trace = _free(clutch, "planar", 0.06, 50.0, drive).trace
        exact = (weights @ np.exp(np.outer(swing, trace.time))).real
        deviations.append(np.abs(10 * RPM - trace.relative_speed - exact).max())
    assert deviations[0] < 0.1 * abs(start)
    for coarse, fine in pairwise(deviations):
        assert 1.6 < coarse / fine < 2.4


@pytest.mark.parametrize("side", ["sliding", "output"])
def test_a_control_with_dead_time_follows_its_recursion(
    clutch: Clutch, engine: str, side: Any
) -> None:
    """Measure, sum, limit, wait and hold, cycle by cycle, to the last digits."""
    control = replace(CONTROL, dead_time=3e-3, limit=2.0)
    if side == "output":
        control = replace(control, proportional=48.0, integral=1800.0, limit=120.0)
    inertia = NEAR if side == "sliding" else FAR
    drive = Drive(shaft_speed=3000 * RPM, engine_side=side, control=control)
    trace = _free(clutch, engine, 0.05, 50.0, drive).trace
    step, total, commands, speeds = 1e-3, 0.0, [], [50 * RPM]
    for k in range(50):
        if k % 2 == 0:
            error = 10 * RPM - speeds[-1]
            total += control.integral * 2e-3 * error
            total = min(max(total, -control.limit), control.limit)
            wanted = control.proportional * error + total
            commands.append(min(max(wanted, -control.limit), control.limit))
        due = (k - 3) // 2
        torque = commands[due] if due >= 0 else 0.0
        speeds.append(speeds[-1] + step * torque / inertia)
    assert max(map(abs, commands)) == control.limit
    exact = np.interp(trace.time, np.arange(51) * step, speeds)
    assert trace.relative_speed == pytest.approx(exact, abs=1e-6)


def test_a_control_to_no_mismatch_slows_faces_that_slide(clutch: Clutch) -> None:
    """They creep at F r tan(slope - arctan mu) (J1 + J2)/J2 over the gain; integrals hold.

    Faces out of parallel touch at their inner ends (``sim.shift.slide``).
    """
    slope, gain, force = 20.0 * DEG, 1.0, 235.0
    dog = replace(clutch.dog, chamfer=slope, axial_gap=1e-5)
    steep = replace(clutch.with_engine("planar"), dog=dog, timeout=0.3)
    point = OperatingPoint(0.0, ForceProfile(force, 1e-3))
    torque = force * dog.inner_radius
    torque *= math.tan(slope - math.atan(clutch.contact.dynamic_friction))
    creep = torque * (NEAR + FAR) / FAR / gain
    speeds = []
    for integral in (0.0, 20.0):
        control = SpeedControl(proportional=gain, integral=integral, cycle=1e-3)
        trace = engage(replace(steep, drive=Drive(control=control)), point, 0.0).trace
        sliding = (trace.time > 0.05) & (trace.time < 0.07)
        speeds.append(np.abs(trace.relative_speed[sliding]).mean())
    assert speeds[0] == pytest.approx(creep, rel=0.03)
    assert speeds[1] < 0.6 * creep


def test_a_drive_turns_what_is_behind_a_shaft(clutch: Clutch, engine: str) -> None:
    """The torque acts on the rest of a side; the whole side gets its momentum."""
    shaft = {"ring_inertia": 0.0005, "input_stiffness": 15e3,
             "wheel_inertia": 0.008, "output_stiffness": 2e3}  # fmt: skip
    drive = Drive(shaft_speed=1000 * RPM, sliding_torque=(20.0,), output_torque=(50.0,))
    states = _free(clutch, engine, 0.01, 50.0, drive, **shaft).run.states
    sides = (
        (SLIDING_SPEED, INPUT_SIDE_SPEED, 0.0005, NEAR, 20.0),
        (OUTPUT_SPEED, OUTPUT_SIDE_SPEED, 0.008, FAR, 50.0),
    )
    for ring, rest, near, whole, torque in sides:
        speeds = (near * states[:, ring] + (whole - near) * states[:, rest]) / whole
        assert speeds[-1] - speeds[0] == pytest.approx(-torque * 0.01 / whole, rel=1e-6)
    assert states[-1, INPUT_SIDE_ANGLE] < states[-1, SLIDING_ANGLE]
    assert states[-1, OUTPUT_SIDE_ANGLE] < states[-1, OUTPUT_ANGLE]


DRIVES = {
    "drag": Drive(shaft_speed=2000 * RPM),
    "torque": Drive(2000 * RPM, sliding_torque=(0.0, 6.0), times=(0.02, 0.05)),
    "synchroniser": Drive(2000 * RPM, synchroniser=2.0, output_torque=(-30.0,)),
    "pack": Drive(2000 * RPM, engine_side="output", pack_torque=3.0, pack_viscous=0.02),
    "control": Drive(
        2000 * RPM, control=SpeedControl(20 * RPM, 0.5, 10.0, 15.0, dead_time=4e-3, cycle=5e-3)
    ),
}


@pytest.mark.parametrize("name", DRIVES)
def test_the_compiled_engine_agrees_with_drake(clutch: Clutch, point: Point, name: str) -> None:
    """Six angles: same outcome, face contacts, times within 0.5 %, energy within 2 %."""
    mechanism = Mechanism(drag_torque=0.3, spline_friction=0.1)
    driven = replace(clutch, mechanism=mechanism, drive=DRIVES[name], timeout=0.4)
    for k in range(6):
        pair = [
            engage(driven.with_engine(engine), point(60, 469.0), (k + 0.3) / 6 * 24 * DEG)
            for engine in ENGINES
        ]
        assert pair[0].outcome is pair[1].outcome
        assert pair[0].events.face_contacts == pair[1].events.face_contacts
        if pair[0].outcome is Outcome.ENGAGED:
            assert pair[0].shift_time == pytest.approx(pair[1].shift_time, rel=5e-3)
        lost = [one.loads.energy_dissipated for one in pair]
        assert lost[0] == pytest.approx(lost[1], rel=0.02, abs=0.01)


@pytest.mark.parametrize(("drive", "outcome"), [
    (Drive(2000 * RPM), Outcome.BLOCKED),
    (Drive(2000 * RPM, sliding_torque=(0.05,)), Outcome.BLOCKED),
    (Drive(2000 * RPM, sliding_torque=(0.0, 0.7), times=(0.3, 0.4)), Outcome.BLOCKED),
    (Drive(2000 * RPM, sliding_torque=(2.0,)), Outcome.ENGAGED),
    (Drive(2000 * RPM, sliding_torque=(-2.0,)), Outcome.ENGAGED),
    (Drive(2000 * RPM, output_torque=(-100.0,)), Outcome.ENGAGED),
    (Drive(2000 * RPM, sliding_torque=(0.0, 2.0), times=(0.5, 0.6)), Outcome.ENGAGED),
    (Drive(2000 * RPM, pack_torque=2.0, pack_speed=3500 * RPM), Outcome.ENGAGED),
    (Drive(2000 * RPM, pack_torque=0.05, pack_speed=3500 * RPM), Outcome.BLOCKED),
    (Drive(2000 * RPM, control=SpeedControl(30 * RPM, 0.05, 1.0, 20.0)), Outcome.ENGAGED),
    (Drive(2000 * RPM, control=SpeedControl(0.0, 0.05, 0.1, 20.0)), Outcome.BLOCKED),
    (Drive(2000 * RPM, control=SpeedControl(300 * RPM, 0.05, 1.0, 0.05)), Outcome.BLOCKED),
], ids=["none", "held", "held late", "forward", "backward", "output", "late", "pack", "weak pack",
        "control", "control at rest", "control at its limit"])  # fmt: skip
def test_held_faces_are_freed_by_more_than_their_friction(
    clutch: Clutch, point: Point, drive: Drive, outcome: Outcome
) -> None:
    """Flat faces hold mu F r = 1.1 N m: less ends the shift early as blocked, more engages."""
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=0.0), drive=drive)
    result = engage(flat.with_engine("planar"), point(5, 469.0), 1.0 * DEG)
    assert result.outcome is outcome
    if outcome is Outcome.BLOCKED:
        assert result.run.times[-1] < 0.7 * flat.timeout
    elif drive.times:
        # Friction is exceeded where the torque has reached 1.1 of 2 N m.
        assert result.phases[1].end > 0.555


@pytest.mark.parametrize(("torque", "outcome"), [
    (0.0, Outcome.BLOCKED), (0.5, Outcome.BLOCKED), (3.0, Outcome.ENGAGED),
    (-3.0, Outcome.ENGAGED),
])  # fmt: skip
@pytest.mark.parametrize("engine", ENGINES)
def test_a_strike_that_takes_all_speed_goes_on_with_torque(
    engine: str, torque: float, outcome: Outcome
) -> None:
    """A flank strike ends the mismatch dog on dog; torque beyond 0.66 N m and drag frees it."""
    settings = ("uncertain=", "dog.traction_deg=8.8", "dog.braking_deg=9.8", "dog.height_mm=3.2")
    rigid = ("mechanism.ring_inertia_kgm2=0", "mechanism.input_stiffness_Nm_rad=0")
    study = load_study("motorcycle", [*settings, *rigid])
    drive = Drive(3000 * RPM, sliding_torque=(0.0, torque), times=(0.15, 0.16))
    clutch = replace(study.clutch, drive=drive).with_engine(engine)
    profile = next(p.profile for p in study.points if p.mismatch == pytest.approx(500 * RPM))
    result = engage(clutch, OperatingPoint(500 * RPM, profile), 3.3 * DEG)
    trace = result.trace
    standing = np.interp(0.1, trace.time, trace.relative_speed)
    assert abs(standing) * clutch.dog.mean_radius < 1e-3
    assert np.interp(0.1, trace.time, trace.displacement) < 1.2e-3
    assert result.outcome is outcome


def test_no_drive_is_no_part_of_a_record(clutch: Clutch) -> None:
    """Shifts without a drive keep their keys; a drive has its own."""
    record = clutch_record(clutch)
    assert record["initial_speed_rpm"] == 0.0
    assert not any(key.startswith("drive") for key in record)
    drives = [*DRIVES.values(), replace(DRIVES["drag"], engine_side="output")]
    keys = {content_key(clutch_record(replace(clutch, drive=drive))) for drive in drives}
    assert len(keys) == len(drives)
    assert content_key(record) not in keys


def test_a_bench_whose_ring_turns_is_braked_by_drag(clutch: Clutch, point: Point) -> None:
    """The effect of drag is that of the law; reversed, both shafts turn the other way."""
    apart = replace(clutch, dog=replace(clutch.dog, axial_gap=90e-3), timeout=0.03)
    bench = replace(apart.with_engine("planar"), drive=Drive(shaft_speed=800 * RPM))
    setting = Setting(bench, point(60, 235.2))
    dragged = EFFECTS["drag_torque"].apply(setting, {"drag_Nm": 1.5})
    reversed_one = EFFECTS["reversed_mismatch"].apply(dragged, {})
    for own, sign in ((dragged, 1.0), (reversed_one, -1.0)):
        trace = engage(own.clutch, own.point, 0.0).trace
        exact = sign * (60 * RPM - 1.5 / NEAR * trace.time)
        assert trace.relative_speed == pytest.approx(exact, rel=1e-6, abs=1e-6)
    standing = replace(dragged, clutch=replace(dragged.clutch, drive=Drive()))
    speeds = engage(standing.clutch, standing.point, 0.0).trace.relative_speed
    assert speeds == pytest.approx(np.full(len(speeds), 60 * RPM))


@pytest.mark.parametrize(("fault", "words"), [
    ({"sliding_torque": (1.0, 2.0)}, "drive.sliding_torque_Nm has 2"),
    ({"sliding_torque": (1.0, 2.0), "times": (0.2, 0.1)}, "later than the one before"),
    ({"pack_speed": 10.0}, "drive.pack_speed_rpm is 95.493"),
    ({"engine_side": "wheels"}, "drive.engine_side is 'wheels'"),
    ({"shaft_speed": -1.0}, "drive.shaft_speed_rpm is -9.549"),
    ({"output_torque": (1e9,)}, "drive.output_torque_Nm is 1e+09"),
])  # fmt: skip
def test_a_drive_that_cannot_be_is_refused(fault: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        Drive(**fault)
    assert words in str(refused.value)


def test_a_control_without_a_gain_is_refused() -> None:
    with pytest.raises(InputError, match="needs a gain"):
        SpeedControl()


def test_a_course_is_settled_where_no_torque_may_change() -> None:
    """After the last knot of a table, and where an integral has no error to sum."""
    table = TorqueCourse(Drive(sliding_torque=(0.0, 1.0), times=(0.1, 0.3)), 1.0)
    assert [table.settled(time) for time in (0.0, 0.2, 0.3)] == [False, False, True]
    control = SpeedControl(set_point=0.0, proportional=1.0, integral=1.0, limit=10.0)
    course = TorqueCourse(Drive(control=control), 1.0)
    course.piece(0.0, 5.0)
    assert not course.settled(0.0)
    course.piece(0.01, 1e-3)
    assert course.settled(0.01)
    assert math.isclose(course.control_torque, -0.001 - 0.01 * 5.001)
