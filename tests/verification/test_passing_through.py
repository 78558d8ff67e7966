"""Dogs that pass through each other are no engagement."""

from dataclasses import replace

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim import kernel
from dogshape.sim.errors import InputError
from dogshape.sim.kernel_layout import DISPLACEMENT, OUTPUT_ANGLE, OUTPUT_SPEED, STATE_SIZE
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import (
    COVERED_DEPTH,
    STEP_REFINEMENT,
    Engagement,
    Outcome,
    engage,
    passing_through,
    require_stiff_enough,
    section_planes,
)
from dogshape.sim.shift.drive import NO_DRIVE, Drive
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import pressure_apex
from dogshape.sim.shift.pair import dog_pair
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, RPM

_DOG = Dog(31, 10.63 * DEG, 6.89 * DEG, 24.5 * DEG, 2.485e-3, 52e-3, 44e-3, 1e-3)


def _depth(dog: Dog, displacement: float, pitches: float) -> float:
    numbers, angle = replace(_fine(), dog=dog).numbers, pitches * dog.pitch_angle
    return kernel.penetration(displacement, angle, section_planes(dog_pair(dog)), numbers)


def _extremes(shift: Engagement) -> tuple[float, float]:
    """Find the deepest penetration and the farthest way of a shift, m."""
    planes = section_planes(shift.clutch.pair)
    return kernel.extremes(shift.run.times, shift.run.states, planes, shift.clutch.numbers)


@pytest.mark.parametrize(("side", "angle"), [(-1, _DOG.braking), (1, _DOG.traction)])
def test_a_seated_dog_off_its_slot_overlaps_across_the_flank(side: int, angle: float) -> None:
    off = 0.02
    assert _depth(_DOG, _DOG.travel, 0.5) == pytest.approx(0.0, abs=1e-12)
    assert _depth(_DOG, _DOG.axial_gap - 1e-5, 0.0) == 0.0
    expected = off * _DOG.pitch * np.cos(angle)
    assert _depth(_DOG, _DOG.travel, 0.5 + side * off) == pytest.approx(expected)


def _fine() -> Clutch:
    return replace(load_study("mq200_paper").clutch, dog=_DOG)


def _shift(mismatch: float, force: float, rise: float, pitches: float) -> Engagement:
    point = OperatingPoint(mismatch * RPM, ForceProfile(force, rise))
    return engage(ClutchPlant(_fine()), point, pitches * _DOG.pitch_angle)


def test_a_dog_inside_another_is_refused_with_depth_and_remedy() -> None:
    clutch, deep = _fine(), _depth(_DOG, _DOG.travel, 0.1)
    assert deep > pressure_apex(_DOG)[1]
    said = passing_through(clutch, deep, _DOG.travel)
    assert said.startswith("penetration of the dogs is")
    assert "lower shift force or mismatch" in said
    assert passing_through(clutch, _depth(_DOG, _DOG.travel, 0.49), _DOG.travel) == ""


def test_a_ring_beyond_its_travel_is_refused() -> None:
    clutch = _fine()
    assert passing_through(clutch, 0.0, _DOG.travel + 0.04 * MM) == ""
    said = passing_through(clutch, 0.0, _DOG.travel + 0.06 * MM)
    assert said.startswith("way beyond full travel is 0.06 mm")


@pytest.mark.parametrize("pitches", [0.1, 0.6])
def test_a_shift_whose_dogs_pass_through_is_simulated_with_finer_steps(pitches: float) -> None:
    result = _shift(-1000.0, 3000.0, 0.05, pitches)
    clutch = _fine()
    solver = replace(clutch.solver, max_step=clutch.solver.max_step / STEP_REFINEMENT)
    finer = ClutchPlant(replace(clutch, solver=solver))
    again = engage(finer, result.point, result.relative_angle)
    assert result.outcome is Outcome.ENGAGED
    assert result.shift_time == again.shift_time
    assert result.clutch == clutch
    assert _extremes(result)[0] < 0.2 * MM


@pytest.mark.parametrize("pitches", [0.1, 0.6])
def test_a_shift_that_passes_through_again_has_diverged(
    pitches: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dogshape.sim.shift.conclusion.STEP_REFINEMENT", 1.0)
    result = _shift(-1000.0, 3000.0, 0.05, pitches)
    assert result.outcome is Outcome.DIVERGED
    assert result.shift_time is None
    assert "penetration of the dogs is" in result.detail


def test_a_contact_too_soft_for_its_force_is_refused() -> None:
    clutch = load_study("mq200_paper").clutch
    soft = replace(clutch, contact=replace(clutch.contact, stiffness=1e10))
    with pytest.raises(InputError, match=r"take at least 5\.\de\+10 Pa/m"):
        require_stiff_enough(soft, 641.5)
    require_stiff_enough(replace(clutch, contact=replace(clutch.contact, stiffness=1e11)), 641.5)


def test_dogs_that_pass_within_a_step_are_found() -> None:
    """Seated in one slot before and in the next after a step: face to face in its middle."""
    pitch, states = _DOG.pitch_angle, np.zeros((2, STATE_SIZE))
    states[:, OUTPUT_ANGLE] = [0.5 * pitch, 1.5 * pitch]
    states[:, DISPLACEMENT] = _DOG.travel
    states[:, OUTPUT_SPEED] = pitch / 1e-3
    times, numbers = np.array([0.0, 1e-3]), _fine().numbers
    deepest, farthest = kernel.extremes(times, states, section_planes(dog_pair(_DOG)), numbers)
    assert farthest == pytest.approx(_DOG.travel)
    between = (_depth(_DOG, _DOG.travel, share) for share in np.linspace(0.5, 1.5, 21))
    assert deepest == pytest.approx(max(between))
    assert _depth(_DOG, _DOG.travel, 0.5) == pytest.approx(0.0, abs=1e-12)


def test_dogs_are_looked_at_between_the_steps_of_a_fast_shift() -> None:
    """At 5000 1/min a step of 1 ms turns two pitches: with it these dogs pass 0.89 mm deep."""
    dog = Dog(26, 6.75 * DEG, 10.38 * DEG, 12.01 * DEG, 3.96e-3, 52e-3, 44e-3, 1e-3)
    clutch = replace(load_study("mq200_paper").clutch, dog=dog)
    point = OperatingPoint(5000 * RPM, ForceProfile(100.0, 0.05))
    found = engage(ClutchPlant(clutch), point, 7.4755 * DEG)
    assert found.outcome is Outcome.ENGAGED
    assert _extremes(found)[0] < COVERED_DEPTH * pressure_apex(dog)[1]
    assert found.shift_time == pytest.approx(0.0918, rel=0.05)


def test_a_touch_within_one_step_is_not_passed_over() -> None:
    """At 700 1/min a flat tip grazes another one for 0.1 ms, which a step of 1 ms does not see."""
    clutch = load_study("motorcycle").clutch
    point, angle = OperatingPoint(700 * RPM, ForceProfile(500.0, 0.04)), 42 * DEG
    plain = engage(ClutchPlant(clutch), point, angle)
    fine = engage(PlanarClutch(clutch.with_engine("planar").refined()), point, angle)
    assert plain.events.face_contacts == fine.events.face_contacts == 1
    assert plain.shift_time == pytest.approx(fine.shift_time, rel=2e-3)


def test_a_ring_that_drag_slows_touches_nothing() -> None:
    """The flight of a ring that turns in drag ends at the first touch, as without drag."""
    clutch = load_study("mq200").clutch.with_engine("planar")
    point = OperatingPoint(100 * RPM, ForceProfile(469.0, 0.1766))
    still, turning = (
        engage(PlanarClutch(replace(clutch, drive=own)), point, 0.05)
        for own in (NO_DRIVE, Drive(2000 * RPM, engine_side="output"))
    )
    assert turning.phases[0].end == pytest.approx(still.phases[0].end, rel=0.02)
    assert turning.phases[0].end > 0.015
