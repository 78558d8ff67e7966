"""The compiled engine against Drake, closed forms and mirror images, for dogs of any shape."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, contact_set, solver_for
from dogshape.sim.shift.conclusion import Outcome, section_planes
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.pair import dog_pair
from dogshape.sim.shift.planar import PlanarClutch, touch_time
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM
from tests.conftest import Point
from tests.verification.test_shapes import ALL, ROOFS, SHAPES, mirrored, shaped

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


@pytest.mark.parametrize("name", ["prototype", "round", "wide", *DOGS, *ALL])
def test_forces_of_single_states_are_those_of_drake(clutch: Clutch, name: str) -> None:
    """Random places with up to 0.1 mm of overlap, random speeds: nine in ten within 0.03 %.

    What is left are other triangles of the same polygon, over which friction turns, and edges
    beside which Drake's mesh has the pressure of the dog's ends.
    """
    own = {"prototype": clutch.dog, "round": replace(clutch.dog, edge_radius=2e-4), **DOGS}
    # Farther from flank to flank than from the middle to an end.
    own["wide"] = Dog(6, 2 * DEG, 4 * DEG, 5 * DEG, 1.6e-3, 52e-3, 44e-3, 1e-3, edge_radius=3e-4)
    dog = shaped(clutch.dog, name, ALL) if name in ALL else own[name]
    plant, mine = ClutchPlant(replace(clutch, dog=dog)), PlanarClutch(replace(clutch, dog=dog))
    plant.start(OperatingPoint(1.0, ForceProfile(469.0, 0.1766)), 0.1)
    carriage = plant.plant.GetBodyByName("carriage").model_instance()
    port = plant.plant.get_generalized_contact_forces_output_port(carriage)
    rng, errors, numbers = np.random.default_rng(2), [], mine.clutch.numbers
    while len(errors) < 60:
        angle = rng.uniform(-dog.pitch_angle, dog.pitch_angle)
        way = rng.uniform(0.98 * dog.axial_gap, dog.travel)
        if not 0.0 < kernel.penetration(way, angle, section_planes(dog_pair(dog)), numbers) < 1e-4:
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
    workspace = kernel.clip_workspace(len(plant.surfaces.normals))
    found: tuple[float, float] = kernel.contact(*state, plant.surfaces, plant.law, workspace)
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


def test_phases_add_up_to_the_shift_time(clutch: Clutch, point: Point) -> None:
    own = clutch.with_engine("planar")
    for degrees in np.linspace(0.0, 23.0, 12):
        shift = engage(own, point(50, 469.0), float(degrees) * DEG)
        assert shift.shift_time is not None
        lengths = [phase.end - phase.start for phase in shift.phases]
        assert min(lengths) >= 0.0
        assert sum(lengths) == pytest.approx(shift.shift_time, rel=1e-14)


def test_phases_of_a_direct_entry_are_between_the_steps(clutch: Clutch, point: Point) -> None:
    """Free flight ends where the crests meet, by the closed form; flanks close between two steps.

    Steps of a shift whose rings are free last tenths of a millisecond.
    """
    own = clutch.with_engine("planar")
    place = point(50, 469.0)
    shifts = [engage(own, place, degrees * DEG) for degrees in np.linspace(0.0, 23.0, 24).tolist()]
    direct = [shift for shift in shifts if shift.events.face_contacts == 0]
    assert len(direct) > 2
    for shift in direct:
        flight, faces, entry, _ = shift.phases
        assert flight.end == pytest.approx(touch_time(own, place.profile), abs=1e-7)
        assert faces.end == faces.start
        times = shift.run.times
        step = int(np.searchsorted(times, entry.end))
        assert times[step - 1] < entry.end < times[step]


def test_phases_hardly_depend_on_the_steps(clutch: Clutch, point: Point) -> None:
    """At a thirtieth of the tolerance a first touch moves by 15 us, of steps up to 500."""
    own = clutch.with_engine("planar")
    for degrees in (3.0, 9.0, 15.0, 21.0):
        shifts = [engage(one, point(50, 469.0), degrees * DEG) for one in (own, own.refined())]
        coarse, fine = (shift.phases[0].end for shift in shifts)
        assert coarse == pytest.approx(fine, abs=1.5e-5)


def test_falling_friction_follows_fine_steps_of_drake(clutch: Clutch, point: Point) -> None:
    """The published set; at its own accuracy Drake's scheme is up to 1 % off its limit."""
    contact = contact_set("adams2019")
    fine = replace(solver_for(contact), accuracy=1e-9, max_step=2e-4)
    own = replace(clutch, contact=contact, solver=solver_for(contact))
    for here, degrees in ((point(5, 315.5), 9.0), (point(149, 315.5), 3.0)):
        mine = engage(own.with_engine("planar"), here, degrees * DEG).shift_time
        limit = engage(replace(own, solver=fine), here, degrees * DEG).shift_time
        assert mine == pytest.approx(limit, rel=3e-3)


def test_like_coefficients_of_a_creep_keep_both(clutch: Clutch, point: Point) -> None:
    """Slip stays below ten stiction velocities, so times do not depend on the dynamic one."""
    times = []
    for dynamic in (0.22, 0.23):
        contact = replace(contact_set("adams2019"), dynamic_friction=dynamic)
        own = replace(clutch, contact=contact, solver=solver_for(contact)).with_engine("planar")
        times.append(engage(own, point(5, 315.5), 9.0 * DEG).shift_time)
    assert times[0] == pytest.approx(times[1], rel=1e-3)
    assert solver_for(contact_set("lubricated_steel")).scheme == "runge_kutta3"


def test_a_creep_takes_long_steps_and_goes_as_far_as_in_drake(clutch: Clutch, point: Point) -> None:
    """Nearly flat faces with the published friction; Drake's explicit scheme takes 20,000 steps."""
    flat = replace(clutch, dog=replace(clutch.dog, chamfer=1 * DEG, count=8))
    own = replace(flat, contact=contact_set("adams2019"), timeout=0.3)
    ends = []
    for one in (own.with_engine("planar"), own):
        found = engage(one, point(5, 641.5), 0.0)
        assert found.outcome is Outcome.TIMED_OUT
        ends.append(found)
    mine, drake = ends
    assert len(mine.run.times) < 0.05 * len(drake.run.times)
    for name in ("relative_angle", "displacement"):
        one, other = (float(getattr(e.trace, name)[-1]) for e in ends)
        assert one == pytest.approx(other, rel=2e-4)


@pytest.mark.parametrize(
    "mechanism",
    [
        Mechanism(),
        Mechanism(added_mass=1.0),
        Mechanism(friction=40.0, damping=60.0),
        Mechanism(detent=60.0, detent_position=1e-3, detent_width=2e-3),
        Mechanism(detent=60.0, detent_position=5e-4, detent_seat=3e-3),
        Mechanism(spline_friction=0.15, drag_torque=1.5),
        Mechanism(added_mass=0.5, compliance=2e-7),
        Mechanism(added_mass=0.5, compliance=2e-7, free_play=5e-4, friction=20.0),
    ],
    ids=["lagged force", "mass", "friction", "detent", "seat", "spline", "linkage", "play"],
)
def test_every_mechanism_follows_drake(clutch: Clutch, point: Point, mechanism: Mechanism) -> None:
    own, here = replace(clutch, mechanism=mechanism), point(50, 469.0)
    if mechanism == Mechanism():
        here = replace(here, profile=replace(here.profile, lag=0.02))
    for degrees in (3.0, 15.0):
        mine, drake = _both(own, here, degrees * DEG)
        assert mine == pytest.approx(drake, rel=5e-3)


def _clutch(clutch: Clutch, name: str, radius: float = 0.0) -> Clutch:
    return replace(clutch, dog=replace(shaped(clutch.dog, name, ALL), edge_radius=radius))


@pytest.mark.parametrize("radius", [0.0, 5e-5])
@pytest.mark.parametrize("name", ALL)
def test_shifts_follow_drake(clutch: Clutch, point: Point, name: str, radius: float) -> None:
    """Same outcome and events, times within 0.1 % of Drake, the engine's own accuracy refined."""
    own = _clutch(clutch, name, radius)
    mine = own.with_engine("planar").refined()
    for rpm, force, share in ((50, 469.0, 0.1), (-50, 469.0, 0.35), (5, 315.5, 0.93)):
        angle = share * own.dog.pitch_angle
        one, other = engage(own, point(rpm, force), angle), engage(mine, point(rpm, force), angle)
        assert one.outcome is other.outcome
        assert one.events.face_contacts == other.events.face_contacts
        assert one.events.slots_skipped == other.events.slots_skipped
        if one.shift_time is not None:
            assert other.shift_time == pytest.approx(one.shift_time, rel=1e-3)


@pytest.mark.parametrize("engine", ["planar", "drake"])
@pytest.mark.parametrize("name", ["symmetric", "ridge aside", "play alone", "undercut"])
def test_the_mirror_image_shifts_alike_at_the_other_sign(
    clutch: Clutch, point: Point, name: str, engine: str
) -> None:
    """Opposite mismatch and angle; a symmetric roof is its own mirror image."""
    here = _clutch(clutch, name).with_engine(engine).refined()
    there = replace(here, dog=mirrored(here.dog))
    for rpm, share in ((25.0, 0.55), (-100.0, 0.3)):
        angle = share * here.dog.pitch_angle
        one = engage(here, point(rpm, 469.0), angle)
        other = engage(there, point(-rpm, 469.0), -angle)
        assert one.outcome is other.outcome is Outcome.ENGAGED
        assert one.shift_time == pytest.approx(other.shift_time, rel=1e-4)
        assert one.events.face_contacts == other.events.face_contacts
        assert one.events.slots_skipped == other.events.slots_skipped


@pytest.mark.parametrize("name", SHAPES)
def test_rings_have_the_play_of_the_closed_form_at_every_depth(clutch: Clutch, name: str) -> None:
    """Flanks touch where half of the play and D tan is turned, at the radius where that is first.

    D is the distance of the median planes, down from where the edges of that flank have passed all
    along; rings that are turned towards each other are not quite parallel there.
    """
    plant = PlanarClutch(_clutch(clutch, name))
    dog = plant.clutch.dog
    middle, (back, edge) = 0.5 * dog.pitch_angle, dog.drops_at(dog.outer_radius)
    for sign, angle, drop in ((1.0, dog.traction, back), (-1.0, dog.braking, edge)):
        for share in (0.05, 0.4, 0.95):
            distance = share * (dog.height - 2.0 * drop)
            lean = distance * np.tan(angle)
            radius = dog.outer_radius if lean > 0.0 else dog.inner_radius
            exact = 0.5 * dog.backlash_angle + np.arcsin(lean / radius)
            low, high = 0.0, 0.5 * middle
            while high - low > 1e-9:
                turned = 0.5 * (low + high)
                force = force_of(plant, middle + sign * turned, distance, 0.0, 0.0)
                low, high = (low, turned) if any(force) else (turned, high)
            assert low == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("angle", [12.0, -4.0])
def test_flanks_lie_on_each_other_once_the_play_is_turned(clutch: Clutch, angle: float) -> None:
    """Pressed 30 um into each other they bear the same over the whole flank, whatever the play."""
    found = []
    for backlash in (1.2, 2.4, 4.0):
        own = {"count": 6, "traction": angle * DEG, "backlash": backlash * MM}
        plant = PlanarClutch(replace(clutch, dog=replace(clutch.dog, chamfer=0.0, **own)))
        dog = plant.clutch.dog
        closed = 0.5 * (dog.pitch_angle + dog.backlash_angle)
        found.append(force_of(plant, closed + 30e-6 / dog.mean_radius, 0.0, 0.0, 0.0))
    area = dog.height * dog.radial_width
    assert found[1] == pytest.approx(found[0], rel=1e-5)
    assert found[2] == pytest.approx(found[0], rel=1e-5)
    assert abs(found[0][1]) == pytest.approx(
        clutch.contact.stiffness * 30e-6 * np.cos(angle * DEG) * area * dog.mean_radius, rel=0.02
    )


@pytest.mark.parametrize("name", ALL)
def test_no_overlap_is_passed_over(clutch: Clutch, name: str) -> None:
    """The force at random places is the same where every dog is looked at."""
    plant = PlanarClutch(_clutch(clutch, name))
    every = plant.surfaces._replace(traction_lean=-1e9, braking_lean=-1e9, half_backlash=0.0)
    everything: Any = SimpleNamespace(surfaces=every, law=plant.law)
    dog, rng, touched = plant.clutch.dog, np.random.default_rng(5), 0
    for _ in range(3000):
        angle, distance = rng.uniform(-1.0, 1.0) * dog.pitch_angle, rng.uniform(0.0, dog.height)
        here, there = (force_of(one, angle, distance, 3.0, 0.1) for one in (plant, everything))
        assert here == there
        touched += here[0] != 0.0
    assert touched > 1000


def test_ridges_meet_at_the_axial_gap(clutch: Clutch) -> None:
    """Ridge on ridge at the mean radius: apart above, in touch 0.01 um below."""
    for name in ROOFS:
        plant = PlanarClutch(_clutch(clutch, name))
        dog = plant.clutch.dog
        angle = -dog.crest_overlap / dog.mean_radius
        assert force_of(plant, angle, dog.height + 1e-9, 0.0, 0.0) == (0.0, 0.0)
        assert force_of(plant, angle, dog.height - 1e-8, 0.0, 0.0)[0] > 0.0
