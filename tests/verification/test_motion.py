"""The plant against closed forms: flight, momentum, energy, symmetry of the dogs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Outcome, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG
from tests.conftest import RISE, Point


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


@pytest.mark.parametrize("mismatch", [149.0, -149.0])
def test_angular_momentum_is_kept_over_a_whole_shift(
    plant: ClutchPlant, point: Point, mismatch: float
) -> None:
    rings = plant.clutch.rings
    trace = engage(plant, point(mismatch, 469.0), 3 * DEG).trace
    momentum = (
        rings.sliding_inertia * trace.sliding_speed + rings.output_inertia * trace.output_speed
    )
    assert momentum == pytest.approx(np.full_like(momentum, momentum[0]), rel=1e-6)


@pytest.mark.parametrize(("mismatch", "force"), [(10.0, 641.5), (50.0, 235.2), (149.0, 469.0)])
def test_one_dog_moves_as_all_dogs_do(
    clutch: Clutch, point: Point, mismatch: float, force: float
) -> None:
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
    flat = clutch.with_dog(replace(clutch.dog, chamfer=chamfer * DEG))
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
