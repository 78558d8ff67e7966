"""Events and loads of a shift against cases in which they are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point, dog_of


def _shift(plant: ClutchPlant, point: OperatingPoint, angle: float) -> Engagement:
    return engage(plant, point, angle * DEG)


def test_slow_dog_on_dog_lands_once_and_slides_to_the_edge(
    plant: ClutchPlant, point: Point
) -> None:
    """The way slid is what was left of the face: from where it landed to the far edge."""
    result = _shift(plant, point(5, 469.0), 0)
    dog, events = plant.clutch.dog, result.events
    assert events.face_contacts == 1
    assert events.slots_skipped == 0
    landed = float(np.interp(result.phases[0].end, result.trace.time, result.trace.relative_angle))
    width = 2.0 * (dog.tip_width + dog.edge_drop * math.tan(dog.braking))
    crest = 0.5 * dog.pitch - dog.height * math.tan(dog.traction)
    left = width - crest - landed * dog.mean_radius
    assert events.face_slide == pytest.approx(left, rel=0.1)


def test_bounces_and_skipped_slots_of_a_fast_shift(plant: ClutchPlant, point: Point) -> None:
    """Slots skipped are whole pitches that the dogs passed after the crests met."""
    result = _shift(plant, point(249, 235.2), 2)
    trace, pitch = result.trace, plant.clutch.dog.pitch_angle
    met = int(np.argmax(trace.displacement >= plant.clutch.dog.axial_gap))
    turned = (trace.relative_angle[-1] - trace.relative_angle[met]) / pitch
    assert result.events.slots_skipped in (math.floor(turned), math.floor(turned) - 1)
    assert result.events.slots_skipped >= 1
    assert result.events.face_contacts >= result.events.slots_skipped + 1
    back = np.maximum.accumulate(trace.displacement) - trace.displacement
    assert result.events.rebound_travel == pytest.approx(back.max())
    assert result.events.rebound_travel > 1e-3


@pytest.mark.parametrize(
    ("asked", "phase", "least"),
    [((249, 641.5), 0.05, 2), ((249, 235.2), 0.45, 3), ((-149, 469.0), 0.05, 2)],
)
def test_a_flank_that_throws_a_dog_onto_the_next_face_makes_a_new_contact(
    plant: ClutchPlant, point: Point, asked: tuple[float, float], phase: float, least: int
) -> None:
    result = engage(plant, point(*asked), phase * plant.clutch.dog.pitch_angle)
    assert result.events.face_contacts >= least
    assert result.events.face_contacts > result.events.slots_skipped


def test_sliding_to_the_time_out_is_not_blocked(clutch: Clutch, point: Point) -> None:
    """A chamfer hardly steeper than friction: the faces slide at 30 mm/s when time is up."""
    dog = dog_of(clutch.dog, (6.007, 20.525, 13.26, 2.5423, 11))
    hasty = replace(clutch.with_dog(dog), timeout=0.2)
    result = _shift(ClutchPlant(hasty), point(10, 235.2), 18)
    assert result.outcome is Outcome.TIMED_OUT
    assert abs(result.trace.relative_speed[-1]) * dog.mean_radius > 1e-3
    assert result.loads.residual_mismatch is None
    assert result.loads.impact_impulse < 0.5


@pytest.mark.parametrize("mismatch", [50.0, -149.0])
def test_momentum_that_the_contact_takes_up(
    plant: ClutchPlant, point: Point, mismatch: float
) -> None:
    """Tangential force over time is what the sliding ring gained; along the shaft likewise."""
    result = _shift(plant, point(mismatch, 469.0), 3)
    trace, rings = result.trace, plant.clutch.rings
    steps = np.diff(trace.time, prepend=0.0)
    gained = rings.sliding_inertia * (trace.sliding_speed[-1] - trace.sliding_speed[0])
    turned = float((trace.tangential_force * steps).sum()) * plant.clutch.dog.mean_radius
    assert turned == pytest.approx(gained, rel=1e-9)
    free = result.point.profile.free_speed(float(trace.time[-1]), rings.mass)
    taken = rings.mass * (free - trace.axial_speed[-1])
    assert float((trace.contact_force * steps).sum()) == pytest.approx(taken, rel=1e-9)
    assert 0.0 < result.loads.impact_impulse < 2.0 * math.hypot(gained / 0.024, taken)


def test_energy_of_the_mismatch_is_dissipated(plant: ClutchPlant, point: Point) -> None:
    """Over a shift that ends at one speed the contact takes J dw2/2 and the work of the force."""
    result = _shift(plant, point(249, 641.5), 3)
    trace, rings = result.trace, plant.clutch.rings
    left = trace.relative_speed[-1]
    turning = 0.5 * rings.reduced_inertia * ((249 * RPM) ** 2 - left**2)
    work = float(np.trapezoid(trace.shift_force, trace.displacement))
    pushing = work - 0.5 * rings.mass * trace.axial_speed[-1] ** 2
    assert result.loads.energy_dissipated == pytest.approx(turning + pushing, rel=1e-3)
    assert 0.5 * rings.reduced_inertia * (249 * RPM) ** 2 == pytest.approx(3.34, abs=0.01)
    states, push, numbers = result.run.states, trace.shift_force, plant.clutch.numbers
    lost = [kernel.energy_lost(states[:n], push[:n], numbers) for n in range(1, len(push) + 1)]
    assert min(lost) > -0.02 * lost[-1]
