"""The plant against closed forms: flight, momentum, energy, events, loads."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, RPM
from tests.conftest import RISE, Point, dog_of


@pytest.mark.parametrize(
    ("force", "gap_ms", "full_ms"),
    [(235.2, 24.04, 35.57), (315.5, 20.08, 29.71), (469.0, 16.97, 25.11), (641.5, 13.28, 19.65)],
)
def test_free_flight_closed_form(force: float, gap_ms: float, full_ms: float) -> None:
    """x = (F T2/m)(s4/4 - s5/10), solved by hand for 1.0 and 4.7 mm."""
    profile = ForceProfile(force, RISE[force])
    assert profile.free_flight_time(1e-3, 0.3) * 1e3 == pytest.approx(gap_ms, abs=0.006)
    assert profile.free_flight_time(4.7e-3, 0.3) * 1e3 == pytest.approx(full_ms, abs=0.006)


def test_simulated_flight_before_the_first_touch(plant: ClutchPlant, point: Point) -> None:
    """Displacement to 0.1 % of the closed form at every step of the free fly."""
    result = engage(plant, point(50, 235.2), 12 * DEG)
    trace, mass = result.trace, plant.clutch.rings.mass
    flying = (trace.time < result.phases[0].end) & (trace.displacement > 1e-5)
    exact = [result.point.profile.free_flight(t, mass) for t in trace.time[flying]]
    assert flying.sum() > 10
    assert trace.displacement[flying] == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(("mismatch", "force"), [(10.0, 641.5), (50.0, 235.2), (149.0, 469.0)])
def test_one_dog_moves_as_all(clutch: Clutch, point: Point, mismatch: float, force: float) -> None:
    every = replace(clutch, solver=replace(clutch.solver, all_dogs=True))
    plants = ClutchPlant(clutch), ClutchPlant(every)
    for angle in (0.0, 16.0):
        one, many = (engage(plant, point(mismatch, force), angle * DEG) for plant in plants)
        assert one.shift_time == pytest.approx(many.shift_time, rel=2e-3)
        assert one.trace.output_speed[-1] == pytest.approx(many.trace.output_speed[-1], rel=2e-3)


def test_reused_plant_repeats_bit_by_bit(clutch: Clutch, plant: ClutchPlant, point: Point) -> None:
    engage(plant, point(249, 641.5), 5 * DEG)
    again = engage(plant, point(50, 469.0), 5 * DEG)
    fresh = engage(ClutchPlant(clutch), point(50, 469.0), 5 * DEG)
    assert again.shift_time == fresh.shift_time


#: Designs of the search space: chamfer, traction, braking in deg, height in mm, dogs.
#: The second is one at which a looser accuracy leaves a sliding contact.
DESIGNS = [
    (8.0, 12.0, 22.0, 3.7, 15),
    (6.007, 20.525, 13.260, 2.5423, 11),
    (17.42, 26.58, 15.98, 4.629, 12),
    (11.4, 7.2, 22.3, 1.95, 34),
]


def test_a_rebound_ends_at_the_stop(clutch: Clutch, point: Point) -> None:
    """Thrown back at 249 1/min, the ring stays within the stop and hardly leaves it."""
    lowest = {}
    for rebound in (1e-3, 50e-3):
        plant = ClutchPlant(replace(clutch, rebound=rebound))
        trace = engage(plant, point(249, 235.2), 0.0).trace
        lowest[rebound] = trace.displacement.min()
        if rebound == 1e-3:
            hit = int(trace.displacement.argmin())
            before = -trace.axial_speed[:hit].min()
            soon = (trace.time > trace.time[hit]) & (trace.time < trace.time[hit] + 5e-4)
            pushed = 5e-4 * trace.shift_force[soon].max() / clutch.rings.mass
            assert before > 0.5
            assert trace.axial_speed[soon].max() < 0.05 * before + pushed
    assert lowest[1e-3] == pytest.approx(-1e-3, abs=5e-5)
    assert lowest[50e-3] < -5e-3


@pytest.mark.parametrize(("chamfer", "outcome"), [(4.5, Outcome.BLOCKED), (7.5, Outcome.ENGAGED)])
def test_chamfer_releases_above_the_friction_angle(
    clutch: Clutch, point: Point, chamfer: float, outcome: Outcome
) -> None:
    """Dog on dog at rest: dynamic friction 0.10 is 5.7 deg."""
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=chamfer * DEG))
    result = engage(ClutchPlant(flat), OperatingPoint(0.0, point(5, 641.5).profile), 0.0)
    assert result.outcome is outcome
    if outcome is Outcome.BLOCKED:
        assert result.shift_time is None
        assert result.trace.time[-1] < 0.5 * clutch.timeout


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ({"max_steps": 20}, "no end after solver.max_steps = 20, at 0."),
        ({"time_limit": 0.01}, "no end after solver.time_limit_s = 0.01, at 0."),
    ],
)
def test_a_shift_beyond_its_limits_is_an_outcome(
    clutch: Clutch, point: Point, limit: dict[str, float], words: str
) -> None:
    limited = replace(clutch, solver=replace(clutch.solver, **limit))
    result = engage(ClutchPlant(limited), point(50, 235.2), 0.0)
    assert result.outcome is Outcome.DIVERGED
    assert result.shift_time is None
    assert words in result.detail
    assert engage(ClutchPlant(clutch), point(50, 235.2), 0.0).outcome is Outcome.ENGAGED


def _shift(plant: ClutchPlant, point: OperatingPoint, angle: float) -> Engagement:
    return engage(plant, point, angle * DEG)


def test_slow_dog_on_dog_lands_once_and_slides_to_an_edge(plant: ClutchPlant, point: Point) -> None:
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
    hasty = replace(replace(clutch, dog=dog), timeout=0.2)
    result = _shift(ClutchPlant(hasty), point(10, 235.2), 18)
    assert result.outcome is Outcome.TIMED_OUT
    assert abs(result.trace.relative_speed[-1]) * dog.mean_radius > 1e-3
    assert result.loads.residual_mismatch is None
    assert result.loads.impact_impulse < 0.5


@pytest.mark.parametrize("mismatch", [50.0, 149.0, -149.0])
def test_momentum_that_the_contact_takes(plant: ClutchPlant, point: Point, mismatch: float) -> None:
    """Tangential force over time is what the sliding ring gained; along the shaft likewise.

    Angular momentum of both rings is kept over the whole shift.
    """
    result = _shift(plant, point(mismatch, 469.0), 3)
    trace, rings = result.trace, plant.clutch.rings
    sliding = rings.sliding_inertia * trace.sliding_speed
    momentum = sliding + rings.output_inertia * trace.output_speed
    assert momentum == pytest.approx(np.full_like(momentum, momentum[0]), rel=1e-6)
    steps = np.diff(trace.time, prepend=0.0)
    gained = sliding[-1] - sliding[0]
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
