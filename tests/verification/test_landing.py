"""The hardest landing against one body on a spring; wear of faces and edges over the life."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dogshape.pipeline.config.study_file import load_study, wear_of
from dogshape.pipeline.simulate.evaluation import STAGES, life_of
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim import kernel
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.geometry import Dog, section
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.strength.checks import LimitCheck
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import (
    Landing,
    Landings,
    Wear,
    bedding,
    crests_of,
    demand_checks,
    demand_of,
    elastic_loads,
    hardest,
    landing_load,
    wear_crests,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import MM
from tests.conftest import Point


@pytest.mark.parametrize("force", [235.2, 641.5])
def test_peak_pressure_of_flat_faces(clutch: Clutch, point: Point, force: float) -> None:
    """Faces without chamfer meet flat: Hunt and Crossley's force on the ring's mass alone."""
    dog = replace(clutch.dog, chamfer=0.0, inner_diameter=48e-3)
    flat = replace(clutch, dog=dog)
    operating = point(1.0, force)
    result = engage(ClutchPlant(flat), operating, 0.0)
    profile, contact, mass = operating.profile, clutch.contact, clutch.rings.mass
    start = profile.free_flight_time(dog.axial_gap, mass)
    overlap = kernel.face_overlap(operating.mismatch * start, flat.numbers)
    width = float(min(overlap, 2.0 * dog.face_width - overlap))
    stiffness = contact.stiffness * width * dog.radial_width * dog.count

    def press(x: float, v: float) -> float:
        return stiffness * max(x, 0.0) * max(0.0, 1.0 + contact.dissipation * v)

    def motion(t: float, state: np.ndarray) -> list[float]:
        return [state[1], (float(profile.at(t)) - press(*state)) / mass]

    speed = float(profile.free_speed(start, mass))
    span = start, start + 2e-3
    run = solve_ivp(motion, span, [0.0, speed], rtol=1e-8, atol=1e-12, max_step=1e-6)
    peak = max(press(x, v) for x, v in run.y.T)
    load = peak / (dog.radial_width * dog.count)
    classes = result.loads.landing_loads
    assert max(classes) == pytest.approx(load, rel=0.05)
    assert classes.index(max(classes)) == np.searchsorted(OVERLAPS, width, side="right") - 1


def _landing(**classes: float) -> Landing:
    """Return a landing with loads in N/mm by class, such as ``at_14`` for 1.4 mm of overlap."""
    loads = [0.0] * len(OVERLAPS)
    for name, load in classes.items():
        loads[int(name.removeprefix("at_"))] = load * 1e3
    return tuple(loads)


def _checks(dog: Dog, landing: Landing, limits: Limits) -> tuple[LimitCheck, ...]:
    return demand_checks(dog, demand_of(dog, landing, limits), limits)


def _elastic(dog: Dog, landing: Landing, limits: Limits) -> tuple[float, ...]:
    """Return the line loads of elastic dogs, N/mm."""
    loads = elastic_loads(crests_of(dog, limits), np.array([landing]), limits)[0] * MM
    return tuple(loads.tolist())


def test_overlap_is_flat_between_two_rounded_crests(prototype: Dog) -> None:
    """0.3 mm at 94 degrees takes 0.2798 mm of either face: 1.4 mm leave 0.840 mm."""
    limits = Limits(load=LoadCase(load_sharing=1.0))
    landing = _landing(at_14=100.0)
    load = _elastic(prototype, landing, limits)[14]
    face, core, edge = _checks(prototype, landing, limits)
    assert face.value == pytest.approx(load / 1.4, rel=1e-3)
    assert core.value == pytest.approx(load / (0.8405 + 0.8), rel=1e-3)
    assert edge.value == 0.0
    assert face.limit == pytest.approx(700 * 9.80665 / 3 / 1.2)
    assert edge.limit == pytest.approx(0.05 * 400)


def test_the_decisive_landing_has_the_force_behind_the_smallest_margin(prototype: Dog) -> None:
    """Of three shifts the one whose narrow overlap loads the core most, in its own class."""
    limits = Limits(load=LoadCase(load_sharing=1.0))
    shifts = (_landing(at_8=20.0, at_14=60.0), _landing(at_8=100.0, at_14=110.0), _landing())
    landings = Landings(np.array(shifts), np.ones(3))
    load = landing_load(prototype, limits, landings)
    assert load is not None
    checks = {check.name: check for check in _checks(prototype, hardest(shifts), limits)}
    assert load.check == min(checks, key=lambda name: checks[name].margin)
    assert load.overlap == pytest.approx(0.85 * MM)
    assert load.simulated_force == pytest.approx(100e3 * prototype.radial_width)
    elastic = _elastic(prototype, shifts[1], limits)[8]
    assert load.force == pytest.approx(elastic / MM * prototype.radial_width)
    assert landing_load(prototype, limits, Landings(np.array(shifts[2:]), np.ones(1))) is None


def test_roundings_bear_what_is_too_much_for_the_flat(prototype: Dog) -> None:
    """A flat of 0.041 mm bears pi/4 of 5283 MPa, and edges the rest of the load."""
    limits = Limits(load=LoadCase(load_sharing=1.0))
    landing = _landing(at_6=300.0)
    load = _elastic(prototype, landing, limits)[6]
    demand = demand_of(prototype, landing, limits)
    rest = load - 0.25 * math.pi * 5284.4 * 0.0405
    pressure = math.sqrt(rest * 115385.0 / (math.pi * 0.15))
    assert demand.edge == pytest.approx(1e6 * pressure, rel=1e-3)
    assert demand_of(prototype, _landing(at_6=10.0), limits).edge == 0.0


def test_what_is_not_flat_bears_on_edges(prototype: Dog) -> None:
    """Bedding to 4/sqrt 3 of 700 HV/3 = 5283 MPa: a = 2 w/(pi p), and R' = 2 w E*/(pi p^2)."""
    limits = Limits(load=LoadCase(load_sharing=1.0))
    landing = _landing(at_4=300.0, at_3=20.0)
    load = max(_elastic(prototype, landing, limits))
    face, core, edge = _checks(prototype, landing, limits)
    assert face.value == core.value == 0.0
    half_width = 2.0 * load / (math.pi * 5283.0)
    radius = 2.0 * load * 115385.0 / (math.pi * 5283.0**2)
    depth = 0.5 * half_width**2 * (1.0 / 0.3 - 1.0 / radius)
    assert edge.value == pytest.approx(1e3 * depth, rel=2e-3)
    demand = demand_of(prototype, landing, limits)
    assert demand.edge == pytest.approx(
        math.sqrt(load * 115385.0 / (math.pi * 0.15)) * 1e6, rel=1e-3
    )
    assert bedding(prototype, demand, limits).radius == pytest.approx(radius * MM, rel=1e-3)
    assert _checks(prototype, _landing(at_4=1.0), limits)[2].value == 0.0
    wide = limits.with_root_radius(0.6e-3)  # now 1.12 mm are rounded
    assert _checks(prototype, _landing(at_11=54.0), wide)[0].value == 0.0
    assert _checks(prototype, _landing(at_11=54.0), limits)[0].value > 0.0


DOG = load_study("mq200_paper").clutch.dog
QUICK = ["solver.engine=planar", "search.confirm_angles=4", "operating.mismatch_rpm=[50]"]


@pytest.mark.parametrize("loss", [0.01 * MM, 0.1 * MM, 0.2 * MM])
def test_a_worn_pair_has_lower_crests_and_nothing_else(loss: float) -> None:
    """Travel, flanks and braking edge stay where they were; the crest sinks along its flank."""
    pair = wear_crests(DOG, loss)
    assert pair.travel == pytest.approx(DOG.travel)
    assert pair.axial_gap == pytest.approx(DOG.axial_gap + 2.0 * loss)
    (_, edge, crest, _), (_, old_edge, old_crest, _) = section(pair), section(DOG)
    assert edge == pytest.approx(old_edge)
    assert crest[1] == pytest.approx(old_crest[1] - loss)
    assert crest[0] == pytest.approx(old_crest[0] + loss * math.tan(DOG.traction))
    assert 0.0 < pair.chamfer < DOG.chamfer


def test_archard_takes_what_friction_works() -> None:
    """Volume of the wedges that all dogs of both rings lose: rate times work of friction."""
    rate, energy, friction, shifts = 1e-15, 2.0, 0.08, 1e5
    loss = Wear(rate=rate).loss(DOG, energy, friction, shifts)
    wedges = 2 * DOG.count * DOG.radial_width * 0.5 * loss * DOG.face_width
    assert wedges == pytest.approx(rate * shifts * energy / friction)
    assert 1e-6 < loss < 1e-4


def test_the_area_between_both_faces_is_the_wedge() -> None:
    """Old face less new face, by the points of both sections, to first order of the loss."""
    loss = 0.02 * MM
    (_, edge, crest, _), (_, _, sunk, _) = section(DOG), section(wear_crests(DOG, loss))
    (y, z), (new_y, new_z) = np.subtract(crest, edge), np.subtract(sunk, edge)
    area = 0.5 * abs(y * new_z - new_y * z)
    assert area == pytest.approx(0.5 * loss * DOG.face_width, rel=0.04)


def test_a_life_is_that_of_three_dogs() -> None:
    """Each stage is the worn dog simulated as a dog of its own."""
    worn_by = ["wear.crest_loss_mm=0.2", "wear.edge_radius_mm=0.4"]
    study = load_study("mq200_paper", [*QUICK, *worn_by])
    wear = wear_of(study.file)
    assert wear is not None
    rows = life_of(study, study.prototype, wear, scratch_executor())
    assert [row.life for row in rows] == [*STAGES]
    assert [row.crest_loss_mm for row in rows] == pytest.approx([0.0, 0.1, 0.2])
    assert [row.edge_radius_mm for row in rows] == pytest.approx([0.0, 0.4 * math.sqrt(0.5), 0.4])
    pair = wear_crests(DOG, 0.2 * MM)
    keys = {
        "dog.height_mm": pair.height / MM,
        "dog.axial_gap_mm": pair.axial_gap / MM,
        "dog.chamfer_deg": math.degrees(pair.chamfer),
        "dog.edge_radius_mm": 0.4,
    }
    sets = [*QUICK, *(f"{key}={value!r}" for key, value in keys.items())]
    other = load_study("mq200_paper", [*sets, "wear.crest_loss_mm=0.0"])
    (first, *_) = life_of(other, other.prototype, Wear(crest_loss=0.0), scratch_executor())
    assert rows[-1].expected_shift_time_s == pytest.approx(first.expected_shift_time_s)
    assert rows[-1].margins["chamfer_release"] < 0.0 < rows[0].margins["chamfer_release"]
    assert rows[-1].margins["contact_ratio"] < rows[0].margins["contact_ratio"]


def test_equal_shares_of_the_life_take_equal_areas_from_an_edge() -> None:
    """The square of a rounding's radius grows evenly; friction has to work for a rate."""
    dog, wear = replace(DOG, edge_radius=0.1 * MM), Wear(edge_radius=0.3 * MM)
    squares = [wear.edge_radius_at(dog, share) ** 2 for share in (0.0, 0.5, 1.0)]
    assert squares == pytest.approx([0.01 * MM**2, 0.05 * MM**2, 0.09 * MM**2])
    with pytest.raises(InputError, match="edges do not get sharper"):
        wear.edge_radius_at(replace(DOG, edge_radius=0.4 * MM), 0.5)
    with pytest.raises(InputError, match="dynamic_friction is 0"):
        Wear(rate=1e-15).loss(DOG, 1.0, 0.0, 1.0)
