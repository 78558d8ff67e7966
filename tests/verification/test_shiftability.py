"""First tries and freed shifts against closed forms, and against simulated shifts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape import Study
from dogshape.pipeline.config.study_file import MAX_PASSED_PLAY
from dogshape.pipeline.store.result_records import LimitRow, PointRow
from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome, engage
from dogshape.sim.shift.drive import Drive
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.statistics.blocks import Block, even_block, run_block
from dogshape.sim.statistics.expectation import (
    PointExpectation,
    SetPoint,
    ShiftResult,
    expect_point,
    time_quantile,
)
from dogshape.sim.statistics.shift_records import entries_by_angle, first_windows, result_of
from dogshape.sim.statistics.shiftability import (
    direct_share,
    limit_draws,
    speed_limits,
    torque_limits,
)
from dogshape.sim.units import DEG, RPM

SLOW = SetPoint(amplitude=2.0, period=0.5, start=0.1)  #: swings by 1/pi rad


@pytest.fixture
def flat(clutch: Clutch) -> Clutch:
    """The prototype without chamfer, in the compiled engine."""
    return replace(clutch, dog=replace(clutch.dog, chamfer=0.0)).with_engine("planar")


def _slow(mismatch_rpm: float) -> OperatingPoint:
    return OperatingPoint(mismatch_rpm * RPM, ForceProfile(235.0, 1e-3))


def test_the_integral_of_the_speed_passes_the_overlap() -> None:
    """A sin(w t) added up to the time of passage; beyond A T/pi there is none."""
    rests = np.array([0.01, 0.1, 0.3, 0.99 / math.pi, 1.01 / math.pi])
    times = SLOW.passages(rests)
    for rest, end in zip(rests[:4], times[:4] - SLOW.start, strict=True):
        grid = np.linspace(0.0, end, 2001)
        speed = SLOW.amplitude * np.sin(2.0 * np.pi * grid / SLOW.period)
        assert np.trapezoid(speed, grid) == pytest.approx(rest, rel=1e-6)
    assert math.isnan(times[4])
    assert np.isnan(SetPoint().passages(rests)).all()


def test_nothing_frees_a_shift_without_a_set_point() -> None:
    """Not even one that friction holds at the very edge of a face."""
    shifts = [ShiftResult(Outcome.BLOCKED, None, rest) for rest in (0.0, 0.1)]
    assert SetPoint().free_blocked(shifts) == shifts


def test_the_mean_passage_is_the_closed_form() -> None:
    r"""Rests even up to U: (T/2 pi)(sin f - f cos f)/(1 - cos f), cos f = 1 - 2 pi U/(A T)."""
    n, pitch, held = 4000, 2.0 * math.pi / 24, 2800
    rests = (np.arange(held) + 0.5) * pitch / n
    shifts = [ShiftResult(Outcome.BLOCKED, None, rest) for rest in rests.tolist()]
    shifts += [ShiftResult(Outcome.ENGAGED, 0.08)] * (n - held)
    freed = SLOW.free_blocked(shifts)
    f = math.acos(1.0 - 2.0 * math.pi * (held / n * pitch) / (SLOW.amplitude * SLOW.period))
    passage = SLOW.period / (2.0 * math.pi) * (math.sin(f) - f * math.cos(f)) / (1.0 - math.cos(f))
    found = expect_point(_slow(5.0), freed, 1.0, 0.2)
    assert found.hangs == 0
    assert found.engaged_mean == pytest.approx(0.3 * 0.08 + 0.7 * (SLOW.start + passage), rel=1e-6)
    assert (found.engaged, found.first_try_share, found.blocked, found.freed) == (
        0.3,
        1.0,
        held,
        held,
    )
    assert found.unaided_mean == pytest.approx(0.08)
    last = SLOW.passages(np.array([held / n * pitch]))[0]
    assert time_quantile([1.0], [freed], 0.9995, 1.0, 0.2).value == pytest.approx(last, rel=1e-3)
    assert expect_point(_slow(5.0), SetPoint().free_blocked(shifts), 1.0, 0.2).time is None


@pytest.mark.parametrize("mismatch_rpm", [5.0, -5.0])
def test_rests_of_blocked_shifts_are_what_slides_leave(flat: Clutch, mismatch_rpm: float) -> None:
    """Faces that slide by J dw2/(2 mu F r) and stand (Bóka): even angles leave even rests."""
    n, pitch, point = 48, flat.dog.pitch_angle, _slow(mismatch_rpm)
    rows = run_block(even_block(flat, point, n, (1, 0)))
    found = [one.overlap for one in map(result_of, rows) if one.outcome is Outcome.BLOCKED]
    even = (np.arange(len(found)) + 0.5) * pitch / n
    assert len(found) > 30
    assert np.sort(np.array(found, dtype=float)) == pytest.approx(even, abs=pitch / n)


@pytest.mark.parametrize(("share", "skipped"), [(0.2, 0.0), (MAX_PASSED_PLAY, 0.0), (0.8, 1.0)])
def test_a_ring_falls_into_the_slot_that_comes(flat: Clutch, share: float, skipped: float) -> None:
    """Without friction, from on a face: at shares of the speed that passes the play in a fall."""
    slippery = replace(flat.contact, static_friction=1e-3, dynamic_friction=1e-3)
    close = replace(flat.dog, axial_gap=1e-5)
    plant = PlanarClutch(replace(flat, contact=slippery, dog=close))
    fall = math.sqrt(2.0 * flat.rings.mass * close.height / 235.0)
    speed = share * close.entry_play / close.mean_radius / fall
    point = OperatingPoint(speed, ForceProfile(235.0, 1e-4))
    angles = np.linspace(0.0, close.pitch_angle, 48)
    numbers = plant.clutch.numbers
    faces = [
        kernel.overlapping_surfaces(kernel.face_overlap(angle, numbers), numbers)
        for angle in angles
    ]
    overlap, most, _ = np.array(faces).T
    on_face = (overlap > 0.05 * most) & (overlap < 0.95 * most)
    found = [engage(plant, point, float(angle)) for angle in angles[on_face]]
    assert np.mean([one.events.slots_skipped > 0 for one in found]) == skipped
    if not skipped:
        rests = (most - overlap)[on_face] / close.mean_radius
        passed = [one.shift_time or math.inf for one in found] - rests / speed
        assert 0.0 < passed.min() <= passed.max() < 0.012


@pytest.mark.parametrize("mismatch_rpm", [5.0, 25.0])
def test_entries_of_flat_dogs_are_those_of_closed_forms(flat: Clutch, mismatch_rpm: float) -> None:
    """Direct: play less the way turned while the ring falls past the crests; engaged: Bóka's."""
    n, dog, point = 96, flat.dog, _slow(mismatch_rpm)
    rows = list(run_block(even_block(flat, point, n, (1, 0))))
    own = expect_point(point, [result_of(row) for row in rows], 1.0, 0.2)
    found = PointRow.of(replace(own, by_angle=entries_by_angle(rows))).shiftability
    assert found is not None
    play = dog.entry_play / dog.mean_radius
    slide = flat.rings.reduced_inertia * point.mismatch**2
    slide /= 2.0 * flat.contact.dynamic_friction * 235.0 * dog.mean_radius
    assert found.direct == pytest.approx(play / dog.pitch_angle, abs=0.02)
    assert found.direct_interval[0] < play / dog.pitch_angle < found.direct_interval[1]
    assert own.engaged == pytest.approx((play + slide) / dog.pitch_angle, abs=1.6 / 30)
    assert found.engaged_interval[0] < own.engaged < found.engaged_interval[1]
    assert [sum(counts) for counts in found.by_angle] == [4] * 24
    direct = [counts[0] for counts in found.by_angle]
    assert direct.count(4) >= 4
    assert np.count_nonzero(np.diff(np.sign([*direct, direct[0]]))) == 2  # one run of angles


@pytest.mark.parametrize("mismatch_rpm", [5.0, 100.0, -150.0, 249.0])
@pytest.mark.parametrize(("flank_deg", "backlash"), [(0.0, 2e-3), (-4.0, 2.6e-3)])
def test_direct_entries_fall_with_the_mismatch_as_the_closed_form(
    flat: Clutch, mismatch_rpm: float, flank_deg: float, backlash: float
) -> None:
    """Straight and undercut flanks with a backlash, which throw no ring back."""
    flank, n = flank_deg * DEG, 96
    own = replace(flat, dog=replace(flat.dog, traction=flank, braking=flank, backlash=backlash))
    point = OperatingPoint(mismatch_rpm * RPM, ForceProfile(469.0, 0.18))
    rows = list(run_block(even_block(own, point, n, (1, 0))))
    direct = sum(counts[0] for counts in entries_by_angle(rows)) / n
    closed = direct_share(own, point)
    assert closed is not None
    assert direct == pytest.approx(closed, abs=1.5 / n)


def test_sloped_tips_have_no_closed_form_of_direct_entries(clutch: Clutch) -> None:
    assert direct_share(clutch, _slow(50.0)) is None


def test_a_first_window_is_one_that_no_slot_was_passed_for() -> None:
    rows = [
        {"outcome": outcome, "shift_time_s": time, "slots_skipped": skipped}
        for outcome, time, skipped in (
            ("engaged", 0.1, 0),
            ("engaged", 0.1, 1),
            ("blocked", None, 0),
            ("engaged", 0.2, 0),
        )
    ]
    assert first_windows(rows) == 2


LINE = np.array([10.0, 30.0, 50.0, 70.0, 90.0])  #: tested mismatches


def _shares(speeds: np.ndarray) -> np.ndarray:
    """Fall in a line from 1 at a mismatch of 10 to 0.6 at 90: 0.9 at 30, 0.8 at 50."""
    return 1.0 - (speeds - 10.0) / 200.0


def test_the_limit_of_many_shifts_is_where_the_line_passes_the_share() -> None:
    """By straight lines between the tested mismatches; blocked shifts at a low one do not count."""
    many = np.full(5, 1e6)
    engaged = np.round(many * _shares(LINE))
    for share, speed in ((0.85, 40.0), (0.7, 70.0)):
        assert limit_draws(LINE, engaged, many, share) == pytest.approx(speed, abs=0.5)
    engaged[0] = 0.2 * many[0]
    assert limit_draws(LINE, engaged, many, 0.85) == pytest.approx(40.0, abs=0.5)


def test_limits_beyond_the_tested_mismatches_are_said() -> None:
    many = np.full(5, 1e6)
    engaged = np.round(many * _shares(LINE))
    assert np.isinf(limit_draws(LINE, engaged, many, 0.55)).all()
    assert (limit_draws(LINE, 0.5 * engaged, many, 0.9) == 0.0).all()


def test_the_interval_of_a_limit_holds_the_limit() -> None:
    """95 % of repetitions with 96 random angles, in 200 of them at least 90 %."""
    rng, shifts, inside = np.random.default_rng(5), np.full(5, 96.0), 0
    for _ in range(200):
        engaged = rng.binomial(96, _shares(LINE)).astype(float)
        low, high = np.quantile(limit_draws(LINE, engaged, shifts, 0.85), (0.025, 0.975))
        inside += low <= 40.0 <= high
    assert inside >= 180


def test_limits_are_by_force_and_sense_of_the_mismatch() -> None:
    """Two mismatches of a sense at least; standing rings have no sense."""
    found = [
        replace(
            expect_point(
                OperatingPoint(mismatch, ForceProfile(force, 0.01)),
                [ShiftResult(Outcome.ENGAGED, 0.1)] * 96, 1.0, 0.2,
            ),
            first_window=count,
        )
        for force, mismatch, count in (
            (200.0, 5.0, 96), (200.0, 20.0, 30), (200.0, -5.0, 96), (300.0, 5.0, 96),
            (300.0, 0.0, 0), (300.0, 9.0, 96),
        )
    ]  # fmt: skip
    first, second = speed_limits(found, 0.9)
    assert (first.force, first.sense, first.tested) == (200.0, 1, 20.0)
    assert 5.0 < first.low < first.median < first.high < 20.0
    assert (second.force, second.median) == (300.0, math.inf)
    rows = [LimitRow.of(limit, 0.9) for limit in (first, second)]
    assert rows[0].limit_engagement_speed_rpm == pytest.approx(first.median / RPM)
    assert rows[1].limit_engagement_speed_rpm is None
    assert rows[1].cell("limit_engagement_speed_rpm") == f"over {9.0 / RPM:.4g}"


@pytest.mark.parametrize("sense", [1, -1])
def test_the_limit_torque_of_a_pressed_flank_is_its_closed_form(flat: Clutch, sense: int) -> None:
    """F r/tan(flank + arctan mu), with the share of the torque that the inertias let through.

    A torque on the sliding side presses a flank once the damped ring is a third of the height deep.
    Friction that slips at some mm/s is 2 % below its coefficient, and the time ends at 0.6 s.
    """
    force, damping = 235.0, 2000.0
    dog, rings = replace(flat.dog, axial_gap=1e-5), flat.rings
    flank = dog.traction if sense > 0 else dog.braking
    share = rings.output_inertia / (rings.sliding_inertia + rings.output_inertia)
    lean = math.tan(flank + math.atan(flat.contact.dynamic_friction))
    limit = force * dog.mean_radius / lean / share
    pressed = 0.3 * dog.height * damping / force
    depths = np.linspace(0.3, 0.4, 8) * dog.height
    turns = (dog.height - depths) * math.tan(flank) / dog.mean_radius
    angles = tuple((0.5 * dog.pitch_angle + sense * turns).tolist())
    damped = replace(flat, dog=dog, timeout=0.6, mechanism=Mechanism(damping=damping))
    point = OperatingPoint(0.0, ForceProfile(force, 1e-4))

    def expected(torque: float) -> list[PointExpectation]:
        times = (0.0, pressed, pressed + 1e-3)
        drive = Drive(sliding_torque=(0.0, 0.0, torque), times=times)
        rows = run_block(Block(replace(damped, drive=drive), point, angles))
        return [expect_point(point, [result_of(row) for row in rows], 0.6, 0.2)]

    torques = [sense * factor * limit for factor in (0.5, 0.9, 0.97, 1.1, 1.2)]
    by_torque = {torque: expected(torque) for torque in torques}
    (found,) = torque_limits(expected(0.0), by_torque, 0.5)
    assert (found.force, found.sense) == (force, sense)
    assert found.tested == pytest.approx(1.2 * limit)
    assert 0.97 * limit < found.low <= found.high < 1.1 * limit
    assert found.median == pytest.approx(limit, rel=0.06)


def _counted(force: float, engaged: int, n: int) -> PointExpectation:
    shifts = [ShiftResult(Outcome.ENGAGED, 0.1)] * engaged
    shifts += [ShiftResult(Outcome.TIMED_OUT, None)] * (n - engaged)
    return expect_point(OperatingPoint(5.0, ForceProfile(force, 0.01)), shifts, 1.0, 0.2)


def test_limit_torques_are_by_force_and_sense_over_all_mismatches() -> None:
    """Pooled counts fall from 1 by 0.1 a newton metre: 0.85 is between 1 and 2 N m."""
    n = 4000
    points = [_counted(force, n, n) for force in (300.0, 500.0, 500.0)]
    loaded = {
        torque: [
            _counted(300.0, n, n),
            _counted(500.0, round(n * (1.0 - 0.2 * torque)), n),
            _counted(500.0, n, n),
        ]
        for torque in (2.0, 1.0)
    }
    over, found = torque_limits(points, loaded, 0.85)
    assert (over.force, over.sense, over.tested) == (300.0, 1, 2.0)
    assert math.isinf(over.median)
    assert (found.force, found.sense) == (500.0, 1)
    assert found.low < 1.5 < found.high
    assert found.median == pytest.approx(1.5, abs=0.03)
    assert [limit.sense for limit in torque_limits(points, {-1.0: loaded[1.0]}, 0.85)] == [-1, -1]
    assert not [*torque_limits(points, {}, 0.85)]


def test_expect_states_limit_torques_where_torques_are_given() -> None:
    """In JSON and in a table; without torques there is no key."""
    place = {"operating.mismatch_rpm": [50.0], "operating.force_N": [469.0]}
    torques = {
        "expectation.limit_torques_Nm": [0.5, -0.5],
        "expectation.limit_torque_side": "sliding",
    }
    plain = Study("mq200", place).expect(angles=3, jobs=1)
    loaded = Study("mq200", place | torques).expect(angles=3, jobs=1)
    assert "engagement_torque_limits" not in plain.to_dict()
    rows = loaded.to_dict()["engagement_torque_limits"]
    assert [(row["sense"], row["tested_Nm"]) for row in rows] == [(-1, 0.5), (1, 0.5)]
    assert loaded.to_dict()["points"] == plain.to_dict()["points"]
    assert "limit engagement torque, N m" in repr(loaded)
