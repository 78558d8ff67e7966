"""The compiled engine against Drake and against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, contact_set, solver_for
from dogshape.sim.shift.conclusion import Outcome, section_planes
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG
from tests.conftest import Point
from tests.verification.test_shapes import ALL, shaped

#: A small and a large dog beside the prototype, fine and coarse.
DOGS = {
    "small": Dog(14, 12 * DEG, 20 * DEG, 8 * DEG, 2.5e-3, 40e-3, 32e-3, 1e-3),
    "large": Dog(30, 4 * DEG, 8 * DEG, 15 * DEG, 5e-3, 120e-3, 100e-3, 1.5e-3),
}


def _both(clutch: Clutch, point: OperatingPoint, angle: float) -> tuple[float, float]:
    """Shift times by the compiled engine and by Drake, s."""
    mine, drake = engage(clutch.with_engine("planar"), point, angle), engage(clutch, point, angle)
    assert mine.outcome is drake.outcome is Outcome.ENGAGED
    assert mine.shift_time is not None
    assert drake.shift_time is not None
    return mine.shift_time, drake.shift_time


@pytest.mark.parametrize("name", ["prototype", "round", *DOGS, *ALL])
def test_forces_of_single_states_are_those_of_drake(clutch: Clutch, name: str) -> None:
    """Random places with up to 0.1 mm of overlap, random speeds: nine in ten within 0.03 %.

    What is left are other triangles of the same polygon, over which friction turns, and edges
    beside which Drake's mesh has the pressure of the dog's ends.
    """
    own = {"prototype": clutch.dog, "round": replace(clutch.dog, edge_radius=2e-4), **DOGS}
    dog = shaped(clutch.dog, name, ALL) if name in ALL else own[name]
    plant, mine = ClutchPlant(clutch.with_dog(dog)), PlanarClutch(clutch.with_dog(dog))
    plant.start(OperatingPoint(1.0, ForceProfile(469.0, 0.1766)), 0.1)
    carriage = plant.plant.GetBodyByName("carriage").model_instance()
    port = plant.plant.get_generalized_contact_forces_output_port(carriage)
    rng, errors, numbers = np.random.default_rng(2), [], mine.clutch.numbers
    while len(errors) < 60:
        angle = rng.uniform(-dog.pitch_angle, dog.pitch_angle)
        way = rng.uniform(0.98 * dog.axial_gap, dog.travel)
        if not 0.0 < kernel.penetration(way, angle, section_planes(dog), numbers) < 1e-4:
            continue
        output, sliding, speed = (float(v) for v in rng.normal(0.0, [5.0, 5.0, 0.3]))
        plant.plant.SetPositions(plant.plant_context, [1.0 + angle, way, 1.0])
        plant.plant.SetVelocities(plant.plant_context, [output, speed, sliding])
        _, axial, torque = port.Eval(plant.plant_context)
        found = np.array(force_of(mine, angle, dog.travel - way, output - sliding, speed))
        given, scale = np.array([-axial, torque]), np.array([1.0, dog.mean_radius])
        if np.hypot(*(given / scale)) > 1e-6:
            errors.append(float(np.hypot(*((found - given) / scale)) / np.hypot(*(given / scale))))
    assert np.quantile(errors, 0.5) < 1e-5
    assert np.quantile(errors, 0.9) < 3e-4


def force_of(plant: PlanarClutch, *state: float) -> tuple[float, float]:
    """Compute force and torque at angle, distance and both speeds."""
    work = kernel.workspace(len(plant.surfaces[1]))
    found: tuple[float, float] = kernel.contact(*state, plant.surfaces, plant.law, work)
    return found


@pytest.mark.parametrize(
    ("mismatch", "force"), [(5, 235.2), (25, 641.5), (-50, 469.0), (149, 315.5), (-249, 641.5)]
)
def test_single_shifts_follow_drake(
    clutch: Clutch, point: Point, mismatch: int, force: int
) -> None:
    """At the engine's own accuracy within 1 %, refined within 0.2 % of Drake's default."""
    here, fine = point(mismatch, force), clutch.with_engine("planar").refined()
    for degrees in (3.0, 9.0, 15.0, 21.0):
        mine, drake = _both(clutch, here, degrees * DEG)
        assert mine == pytest.approx(drake, rel=1e-2)
        assert engage(fine, here, degrees * DEG).shift_time == pytest.approx(drake, rel=2e-3)


def test_loads_and_events_follow_drake(clutch: Clutch, point: Point) -> None:
    here, angle = point(50, 469.0), 15 * DEG
    mine, drake = engage(clutch.with_engine("planar"), here, angle), engage(clutch, here, angle)
    assert mine.loads.peak_axial_force == pytest.approx(drake.loads.peak_axial_force, rel=0.02)
    assert mine.loads.impact_impulse == pytest.approx(drake.loads.impact_impulse, rel=0.02)
    assert mine.loads.energy_dissipated == pytest.approx(drake.loads.energy_dissipated, rel=0.02)
    assert np.array(mine.loads.landing_loads) == pytest.approx(
        np.array(drake.loads.landing_loads), rel=0.05, abs=100.0
    )
    assert mine.events.face_contacts == drake.events.face_contacts
    assert [p.name for p in mine.phases] == [p.name for p in drake.phases]
    for one, other in zip(mine.phases, drake.phases, strict=True):
        assert one.end == pytest.approx(other.end, abs=3e-4)


def test_falling_friction_follows_fine_steps_of_drake(clutch: Clutch, point: Point) -> None:
    """The published set; at its own accuracy Drake's scheme is up to 1 % off its limit."""
    contact = contact_set("adams2019")
    fine = replace(solver_for(contact), accuracy=1e-9, max_step=2e-4)
    own = replace(clutch, contact=contact, solver=solver_for(contact))
    for here, degrees in ((point(5, 315.5), 9.0), (point(149, 315.5), 3.0)):
        mine = engage(own.with_engine("planar"), here, degrees * DEG).shift_time
        limit = engage(replace(own, solver=fine), here, degrees * DEG).shift_time
        assert mine == pytest.approx(limit, rel=3e-3)


def test_a_creep_takes_long_steps_and_goes_as_far_as_in_drake(clutch: Clutch, point: Point) -> None:
    """Nearly flat faces with the published friction; Drake's explicit scheme takes 20,000 steps."""
    flat = clutch.with_dog(replace(clutch.dog, chamfer=1 * DEG, count=8))
    own = replace(flat, contact=contact_set("adams2019"), timeout=0.3)
    ends = []
    for one in (own.with_engine("planar"), own):
        found = engage(one, point(5, 641.5), 0.0)
        assert found.outcome is Outcome.TIMED_OUT
        ends.append(found)
    mine, drake = ends
    assert mine.steps < 0.05 * drake.steps
    for name in ("relative_angle", "displacement"):
        one, other = (float(getattr(e.trace, name)[-1]) for e in ends)
        assert one == pytest.approx(other, rel=2e-4)


@pytest.mark.parametrize(
    "mechanism",
    [
        Mechanism(added_mass=1.0),
        Mechanism(friction=40.0, damping=60.0),
        Mechanism(detent=60.0, detent_position=1e-3, detent_width=2e-3),
        Mechanism(detent=60.0, detent_position=5e-4, detent_seat=3e-3),
        Mechanism(spline_friction=0.15, drag_torque=1.5),
        Mechanism(added_mass=0.5, compliance=2e-7),
        Mechanism(added_mass=0.5, compliance=2e-7, free_play=5e-4, friction=20.0),
    ],
    ids=["mass", "friction", "detent", "seat", "spline", "linkage", "play"],
)
def test_every_mechanism_follows_drake(clutch: Clutch, point: Point, mechanism: Mechanism) -> None:
    own = replace(clutch, mechanism=mechanism)
    for degrees in (3.0, 15.0):
        mine, drake = _both(own, point(50, 469.0), degrees * DEG)
        assert mine == pytest.approx(drake, rel=5e-3)


def test_a_lagged_force_follows_drake(clutch: Clutch, point: Point) -> None:
    base = point(50, 469.0)
    lagged = ForceProfile(base.profile.force, base.profile.rise, lag=0.02)
    mine, drake = _both(clutch, replace(base, profile=lagged), 15 * DEG)
    assert mine == pytest.approx(drake, rel=5e-3)
