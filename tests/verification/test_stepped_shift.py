"""A shift in communication steps: the same engine as a whole shift, and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study, points_of
from dogshape.sim.errors import EngineError, InputError
from dogshape.sim.kernel_layout import DISPLACEMENT, OUTPUT_SPEED, SLIDING_SPEED
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.drive import Drive
from dogshape.sim.shift.planar import touch_time
from dogshape.sim.shift.stepped_shift import (
    ShiftStart,
    StepLoads,
    StepMotion,
    SteppedShift,
    StepPhase,
    start_of,
)
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, RPM

STEP_S = 1e-4  #: communication step
#: Largest deviations from a whole shift up to the engagement, at steps of ``STEP_S``: the force is
#: held over a step, and impacts move by a part of one.
TRAVEL_TOLERANCE_M = 3e-5
SPEED_TOLERANCE_RAD_S = 0.05
POINTS = [(50, 469.0, 10), (25, 469.0, 4), (25, 469.0, 18), (100, 641.5, 12)]


def _shift(
    settings: dict[str, object], mismatch_rpm: float, force: float, angle_deg: float
) -> tuple[Engagement, OperatingPoint]:
    """Simulate a whole shift of the paper's study."""
    study = load_study("mq200_paper", settings).in_engine("planar")
    (point,) = points_of(study, (mismatch_rpm, force, None))
    return engage(study.clutch, point, angle_deg * DEG), point


def _stepped(
    engagement: Engagement, loads: Callable[[float], StepLoads], step: float = STEP_S
) -> tuple[SteppedShift, list[tuple[float, StepMotion, StepPhase]]]:
    """Repeat a shift in steps to its end; loads are taken in the middle of a step."""
    clutch = engagement.clutch
    start = start_of(clutch, engagement.point.mismatch, engagement.relative_angle)
    shift = SteppedShift(clutch, start)
    motions = []
    while not shift.engaged and shift.time < clutch.timeout:
        count = len(motions)
        shift.advance((count + 1) * step, loads((count + 0.5) * step))
        motions.append((shift.time, shift.motion, shift.phase))
    return shift, motions


@pytest.mark.parametrize(("mismatch_rpm", "force", "angle_deg"), POINTS)
def test_constant_torques_follow_the_drive_step_by_step(
    mismatch_rpm: float, force: float, angle_deg: float
) -> None:
    settings = {"drive.sliding_torque_Nm": [2.0], "drive.output_torque_Nm": [-3.0]}
    engagement, point = _shift(settings, mismatch_rpm, force, angle_deg)
    sense = engagement.clutch.drive.sense
    shift, motions = _stepped(
        engagement, lambda time: StepLoads(float(point.profile.at(time)), 2.0, -3.0)
    )
    assert shift.engagement_time == pytest.approx(engagement.shift_time, abs=STEP_S)
    times, states = engagement.run.times, engagement.run.states
    for time, motion, _ in motions[:-1]:
        state = [np.interp(time, times, column) for column in states.T]
        assert motion.travel == pytest.approx(state[DISPLACEMENT], abs=TRAVEL_TOLERANCE_M)
        sliding_speed = sense * state[SLIDING_SPEED]
        assert motion.sliding_speed == pytest.approx(sliding_speed, abs=SPEED_TOLERANCE_RAD_S)
        output_speed = sense * state[OUTPUT_SPEED]
        assert motion.output_speed == pytest.approx(output_speed, abs=SPEED_TOLERANCE_RAD_S)


@pytest.mark.parametrize("step", [1e-3, 2e-4])
@pytest.mark.parametrize(("mismatch_rpm", "force", "angle_deg"), POINTS)
def test_a_shift_in_steps_takes_the_time_and_phases_of_the_whole(
    mismatch_rpm: float, force: float, angle_deg: float, step: float
) -> None:
    engagement, point = _shift({}, mismatch_rpm, force, angle_deg)
    shift, motions = _stepped(
        engagement, lambda time: StepLoads(float(point.profile.at(time)), 0.0, 0.0), step
    )
    assert shift.engagement_time == pytest.approx(engagement.shift_time, abs=step)
    assert motions[-1][0] == pytest.approx(shift.engagement_time, abs=step)
    assert shift.phase is StepPhase.ENGAGED
    flight = max(time for time, _, phase in motions if phase is StepPhase.FREE_FLY)
    gap_time = touch_time(engagement.clutch, point.profile)
    assert flight == pytest.approx(gap_time, abs=step)
    (seating_start,) = (phase.start for phase in engagement.phases if phase.name == "seating")
    entry = max(time for time, _, phase in motions if phase < StepPhase.SEATING)
    assert entry == pytest.approx(seating_start, abs=2.0 * step)


@pytest.mark.parametrize("settings", [
    {"mechanism.compliance_mm_kN": 2.0, "mechanism.free_play_mm": 0.5},
    {"mechanism.friction_N": 30.0, "mechanism.damping_Ns_m": 20.0},
    {"mechanism.detent_N": 60.0, "mechanism.detent_position_mm": 0.5,
     "mechanism.detent_width_mm": 1.0},
    {"mechanism.ring_inertia_kgm2": 0.002, "mechanism.input_stiffness_Nm_rad": 300.0},
    {"drive.shaft_speed_rpm": 1000.0, "drive.engine_side": "output",
     "drive.pack_viscous_Nms_rad": 0.01},
    {"contact.set": "adams_impact"},
], ids=lambda settings: next(iter(settings)))  # fmt: skip
def test_mechanism_drive_and_contact_act_in_steps(settings: dict[str, object]) -> None:
    engagement, point = _shift(settings, 50, 469.0, 10)
    shift, _ = _stepped(
        engagement, lambda time: StepLoads(float(point.profile.at(time)), 0.0, 0.0), 5e-4
    )
    assert shift.engagement_time == pytest.approx(engagement.shift_time, abs=5e-4)


def test_rings_that_do_not_meet_move_as_free_bodies(clutch: Clutch) -> None:
    """x = F t^2/2m and w = w0 + T t/J, with the engine at either side."""
    apart = replace(clutch.with_engine("planar"), dog=replace(clutch.dog, axial_gap=90e-3))
    for side in ("sliding", "output"):
        driven = replace(apart, drive=Drive(engine_side=side))  # type: ignore[arg-type]
        shift = SteppedShift(driven, ShiftStart(20.0, 15.0, 0.1))
        for count in range(1, 11):
            shift.advance(count * 1e-3, StepLoads(30.0, 2.0, -6.0))
        motion = shift.motion
        assert motion.travel == pytest.approx(30.0 * 0.01**2 / (2.0 * 0.3), rel=1e-9)
        assert motion.sliding_speed == pytest.approx(20.0 + 2.0 * 0.01 / 0.01, rel=1e-12)
        assert motion.output_speed == pytest.approx(15.0 - 6.0 * 0.01 / 0.6048, rel=1e-12)
        assert motion.sliding_angle == pytest.approx(20.0 * 0.01 + 0.5 * 200.0 * 1e-4, rel=1e-9)
        turn = motion.output_angle - motion.sliding_angle
        start = driven.drive.sense * 0.1
        assert driven.drive.sense * motion.relative_angle == pytest.approx(turn, rel=1e-9)
        assert motion.output_angle - start == pytest.approx(0.15 - 6.0 / 0.6048 * 0.5e-4, rel=1e-9)
        assert motion.contact_force == motion.contact_torque == 0.0
        assert shift.phase is StepPhase.FREE_FLY


def test_flat_faces_at_rest_bear_the_shift_force(clutch: Clutch) -> None:
    """The contact force is the shift force, and no torque acts, dog on dog."""
    flat = replace(clutch.with_engine("planar"), dog=replace(clutch.dog, chamfer=0.0))
    shift = SteppedShift(flat, ShiftStart(0.0, 0.0, 0.0))
    for count in range(1, 101):
        shift.advance(count * 1e-3, StepLoads(400.0, 0.0, 0.0))
    assert shift.motion.contact_force == pytest.approx(400.0, rel=1e-3)
    assert shift.motion.contact_torque == pytest.approx(0.0, abs=1e-6)
    assert shift.phase is StepPhase.FACE_CONTACT


def test_engaged_rings_turn_together_and_stay(clutch: Clutch) -> None:
    """The latch holds the ring; the flanks carry T J2/(J1 + J2); the momentum is that of T."""
    shift = SteppedShift(clutch.with_engine("planar"), ShiftStart(0.0, 0.0, 0.2))
    count = 0
    while not shift.engaged:
        count += 1
        shift.advance(count * 1e-3, StepLoads(500.0, 10.0, 0.0))
    first = shift.motion
    first_time = shift.time
    torques = []
    for _ in range(200):
        count += 1
        shift.advance(count * 1e-3, StepLoads(500.0, 10.0, 0.0))
        torques.append(shift.motion.contact_torque)
    last = shift.motion
    gain = 0.01 * (last.sliding_speed - first.sliding_speed)
    gain += 0.6048 * (last.output_speed - first.output_speed)
    assert gain == pytest.approx(10.0 * (shift.time - first_time), rel=1e-9)
    assert last.sliding_speed == pytest.approx(last.output_speed, abs=0.1)
    assert np.mean(torques[100:]) == pytest.approx(-10.0 * 0.6048 / 0.6148, rel=0.02)
    assert last.travel == pytest.approx(first.travel, abs=1e-6)
    assert last.contact_force > 0.0


@pytest.mark.parametrize(("name", "columns"), [("mq200_paper", 6), ("mq200_both", 12)])
def test_shafts_move_on_behind_the_latch(name: str, columns: int) -> None:
    clutch = load_study(name).in_engine("planar").clutch
    shift = SteppedShift(clutch, ShiftStart(0.0, 0.0, 0.2))
    shift.advance(0.2, StepLoads(500.0, 10.0, 0.0))
    shift.advance(0.21, StepLoads(500.0, 10.0, 0.0))
    assert shift.engaged
    assert shift._model.numbers[0].state_size == columns


def test_a_shift_that_goes_back_repeats_itself(clutch: Clutch) -> None:
    """Before and after the engagement, to the last digit."""
    shift = SteppedShift(clutch.with_engine("planar"), start_of(clutch, 50 * RPM, 10 * DEG))

    def run(counts: range) -> list[StepMotion]:
        motions = []
        for count in counts:
            shift.advance((count + 1) * 1e-3, StepLoads(469.0, 1.0, 0.0))
            motions.append(shift.motion)
        return motions

    run(range(2))
    saved = shift.save()
    assert not shift.engaged
    first = run(range(2, 140))
    assert shift.engaged
    latched = shift.save()
    tail = run(range(140, 150))
    shift.restore(latched)
    assert run(range(140, 150)) == tail
    shift.restore(saved)
    assert math.isnan(shift.engagement_time)
    assert run(range(2, 140)) == first


def test_a_force_beyond_the_contact_is_refused(clutch: Clutch) -> None:
    shift = SteppedShift(clutch.with_engine("planar"), start_of(clutch, 0.0, 0.0))
    with pytest.raises(InputError, match=r"contact\.stiffness_Pa_m"):
        shift.advance(1e-3, StepLoads(1e7, 0.0, 0.0))


def test_dogs_that_stand_in_each_other_are_an_error(clutch: Clutch) -> None:
    shift = SteppedShift(clutch.with_engine("planar"), start_of(clutch, 0.0, 0.0))
    saved = shift.save()
    state = list(saved.state)
    state[DISPLACEMENT] = clutch.dog.axial_gap + 0.6 * clutch.dog.height
    shift.restore(replace(saved, state=tuple(state)))
    with pytest.raises(EngineError, match=r"penetration of the dogs is .* mm, but"):
        shift.advance(1e-7, StepLoads(0.0, 0.0, 0.0))
