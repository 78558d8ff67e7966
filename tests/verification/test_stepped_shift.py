"""A shift in communication steps: the same engine as a whole shift, and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study, points_of
from dogshape.sim.errors import EngineError, InputError
from dogshape.sim.kernel_layout import AMBIENT_PA, DISPLACEMENT, OUTPUT_SPEED, SLIDING_SPEED
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import COMMAND_RISE_S, EXAMPLES, KINDS, Cam, Solenoid, Spring
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.commanded_actuator import CommandCourse
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


def _apart(clutch: Clutch, kind: str, **changes: float) -> Clutch:
    """Give rings that never meet the example of an actuator, and a ring that stays at its place."""
    far = replace(clutch.dog, axial_gap=90e-3)
    heavy = replace(clutch.rings, mass=1000.0)
    actuator = replace(EXAMPLES[kind], **changes)
    return replace(clutch.with_engine("planar"), dog=far, rings=heavy, actuator=actuator)


def _command(shift: SteppedShift, end: float, force: float, step: float = 1e-3) -> list[float]:
    """Hold a command to a time in s; list the force of the actuator at the ends of steps, N."""
    forces = []
    while shift.time < end - 1e-9:
        shift.advance(min(shift.time + step, end), StepLoads(0.0, 0.0, 0.0, force))
        forces.append(shift.actuator_reading.force)
    return forces


@pytest.mark.parametrize("kind", sorted(KINDS.keys() - {"motor"}))
def test_a_command_that_ends_leaves_no_force(clutch: Clutch, kind: str) -> None:
    """No force before the command, and none after it but a return spring's."""
    apart = _apart(clutch, kind)
    actuator = apart.actuator
    assert actuator is not None
    shift = SteppedShift(apart, ShiftStart(0.0, 0.0, 0.1))
    assert _command(shift, 0.01, 0.0) == [0.0] * 10
    assert shift.motion.travel == 0.0
    assert max(_command(shift, 0.06, actuator.full_force)) > 100.0
    off = _command(shift, 0.6 if kind == "pneumatic" else 0.2, 0.0)  # its valve vents slowly
    assert shift.motion.travel > 0.0
    return_force = actuator.release_force(shift.motion.travel) or 0.0
    assert off[-1] == pytest.approx(-return_force, abs=1.0)


def test_a_motor_coasts_without_its_command(clutch: Clutch) -> None:
    apart = replace(_apart(clutch, "motor"), rings=clutch.rings)
    actuator = apart.actuator
    assert actuator is not None
    shift = SteppedShift(apart, ShiftStart(0.0, 0.0, 0.1))
    _command(shift, 0.01, actuator.full_force)
    _command(shift, 0.02, 0.0)
    speed = shift.motion.axial_speed
    assert speed > 0.1
    forces = _command(shift, 0.04, 0.0)
    assert max(map(abs, forces)) < 0.01 * actuator.full_force
    assert shift.motion.axial_speed == pytest.approx(speed, rel=0.01)


def test_a_spring_behind_a_lag_follows_its_command(clutch: Clutch) -> None:
    """F (1 - exp(-t/T)) up, and F exp(-t/T) down; a dead time shifts both."""
    course = CommandCourse(delay=0.0035, lag=0.005, loss=20.0)
    apart = _apart(clutch, "spring", rate=0.0)
    assert isinstance(apart.actuator, Spring)
    shift = SteppedShift(apart, ShiftStart(0.0, 0.0, 0.1), course)
    on = _command(shift, 0.02, 300.0)
    off = _command(shift, 0.04, 0.0)
    times = 1e-3 * np.arange(1, 21)
    grown = 1.0 - np.exp(-np.maximum(times - 0.0035, 0.0) / 0.005)
    assert on == pytest.approx(280.0 * grown, abs=0.5)
    end = 1.0 - math.exp(-0.02 / 0.005)
    late = times > 0.0035
    decayed = 280.0 * end * np.exp(-(times[late] - 0.0035) / 0.005)
    assert np.array(off)[late] == pytest.approx(decayed, abs=0.5)


def test_the_pressure_goes_on_where_a_command_changes(clutch: Clutch) -> None:
    shift = SteppedShift(_apart(clutch, "pneumatic"), ShiftStart(0.0, 0.0, 0.1))
    _command(shift, 0.05, 900.0)
    pressure = shift.actuator_reading.channel
    assert 1e5 < pressure < 8e5
    for force in (500.0, 0.0, 900.0):
        _command(shift, shift.time + 1e-9, force)
        assert shift.actuator_reading.channel == pytest.approx(pressure, rel=1e-5)
    _command(shift, shift.time + 0.5, 0.0)
    assert shift.actuator_reading.channel == pytest.approx(0.0, abs=0.01 * AMBIENT_PA)


def test_the_current_of_a_coil_rises_and_decays(clutch: Clutch) -> None:
    """i = U/R (1 - exp(-R t/L)) at the open armature, and its decay."""
    apart = _apart(clutch, "solenoid")
    coil = apart.actuator
    assert isinstance(coil, Solenoid)
    shift = SteppedShift(apart, ShiftStart(0.0, 0.0, 0.1))
    time_constant = coil.inductance / coil.resistance
    full = coil.voltage / coil.resistance
    for _ in range(5):
        _command(shift, shift.time + 1e-3, coil.full_force)
        exact = full * (1.0 - math.exp(-shift.time / time_constant))
        assert shift.actuator_reading.channel == pytest.approx(exact, rel=2e-3)
    current = shift.actuator_reading.channel
    _command(shift, 0.010, 0.0)
    decayed = current * math.exp(-0.005 / time_constant)
    assert shift.actuator_reading.channel == pytest.approx(decayed, rel=2e-3)


def test_a_drum_stops_and_turns_on_with_its_command(clutch: Clutch) -> None:
    """The coupling of a ring that stays is loaded by the groove at the time under command."""
    apart = _apart(clutch, "cam", stiffness=1e4, force_limit=500.0)
    cam = apart.actuator
    assert isinstance(cam, Cam)
    shift = SteppedShift(apart, ShiftStart(0.0, 0.0, 0.1))
    _command(shift, 0.005, 0.0)
    _command(shift, 0.015, cam.full_force)
    assert _command(shift, 0.045, 0.0)[-1] == 0.0
    _command(shift, 0.055, cam.full_force)
    share = 0.02 / (cam.ramp / cam.drum_speed)
    groove = cam.stroke * share**2 * (3.0 - 2.0 * share)
    speed = 6.0 * cam.stroke * share * (1.0 - share) / (cam.ramp / cam.drum_speed)
    damping = 2.0 * 0.3 * math.sqrt(1e4 * 1000.0)
    motion = shift.motion
    exact = 1e4 * (groove - motion.travel) + damping * (speed - motion.axial_speed)
    assert shift.actuator_reading.force == pytest.approx(min(exact, cam.full_force), rel=1e-3)


def test_the_engagement_is_the_arrival_of_the_ring(clutch: Clutch) -> None:
    """As the shift time is, also where the actuator behind a linkage arrives steps later."""
    mechanism = replace(clutch.mechanism, compliance=2e-6, free_play=0.2e-3)
    linked = replace(clutch, mechanism=mechanism, actuator=EXAMPLES["cam"]).with_engine("planar")
    force = EXAMPLES["cam"].full_force
    reference = engage(
        linked, OperatingPoint(50 * RPM, ForceProfile(force, COMMAND_RISE_S)), 10 * DEG
    )
    assert reference.shift_time is not None
    both_time = reference.run.times[-1]
    assert both_time > reference.shift_time + 1e-3
    for step in (1e-3, 2e-4):
        shift = SteppedShift(linked, start_of(linked, 50 * RPM, 10 * DEG))
        while not shift.engaged:
            _command(shift, shift.time + step, force, step)
        assert shift.engagement_time == pytest.approx(reference.shift_time, abs=1e-4)
        assert shift.time == pytest.approx(both_time, abs=1.1 * step)


def test_a_command_without_an_actuator_is_refused(clutch: Clutch) -> None:
    shift = SteppedShift(clutch.with_engine("planar"), start_of(clutch, 0.0, 0.0))
    with pytest.raises(InputError, match="force of a command is 100 N, but the clutch has no"):
        shift.advance(1e-3, StepLoads(0.0, 0.0, 0.0, 100.0))
