"""Rounded edges and crests that cross: geometry, contact on a line, both engines, hanging."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import dogshape.sim.shift.mesh
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.shift_page import event_facts
from dogshape.sim import kernel
from dogshape.sim.part import dog_corners, ring_part
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome
from dogshape.sim.shift.geometry import FLANKS, Dog, crest_loss, crest_setback, flank_contact
from dogshape.sim.shift.mesh import DEVIATION, dog_planes, tip_edges
from dogshape.sim.shift.planar import PlanarClutch, surfaces_of
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.strength.dog_strength import Limits, notch_factor
from dogshape.sim.strength.landing import demand_of
from dogshape.sim.strength.manufacture import manufacturing_checks
from dogshape.sim.units import DEG, MM
from tests.conftest import Point, dog_of
from tests.verification.crests import DESIGNS, Crests, crests_of, time_on_crests
from tests.verification.ridges import (
    WINDOW_FACTOR,
    hang_and_late_widths,
    ridges_of,
    with_edge_radius,
)


@pytest.mark.parametrize("radius", [0.02 * MM, 0.1 * MM, 0.3 * MM])
def test_planes_of_an_edge_touch_its_cylinder_and_stand_out_by_a_micrometre(
    prototype: Dog, radius: float
) -> None:
    dog = replace(prototype, edge_radius=radius)
    planes = dog_planes(dog)
    faces = (planes.traction, planes.face, planes.braking)
    for edge, before, after in zip(tip_edges(dog), faces, faces[1:], strict=False):
        around = [before, *edge.planes, after]
        for plane in around:
            assert plane.offset - plane.normal @ edge.axis == pytest.approx(radius, abs=1e-15)
            assert plane.normal @ edge.direction == pytest.approx(0.0, abs=1e-14)
        leans = [float(a.normal @ b.normal) for a, b in pairwise(around)]
        assert leans == pytest.approx([leans[0]] * len(leans))
        out = radius * (1.0 / math.cos(0.5 * math.acos(leans[0])) - 1.0)
        assert 0.0 < out <= DEVIATION


def test_the_ridge_is_where_the_closed_form_has_it(prototype: Dog) -> None:
    """Top of the cylinder against the sharp crest, in the frame of the traction flank."""
    radius = 0.3 * MM
    crest, _ = tip_edges(replace(prototype, edge_radius=radius))
    quarter = 0.25 * prototype.pitch_angle
    across = np.array([-math.sin(quarter), math.cos(quarter), 0.0])
    lower = 0.5 * prototype.height - (crest.axis[2] + radius)
    back = -0.5 * prototype.height * math.tan(prototype.traction) - crest.axis @ across
    assert lower == pytest.approx(crest_loss(prototype, radius), rel=1e-9)
    assert back == pytest.approx(crest_setback(prototype, radius), rel=1e-9)


@pytest.fixture
def _exact(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let planes stand out of an edge by a fiftieth of a micrometre, for comparison with arcs."""
    monkeypatch.setattr(dogshape.sim.shift.mesh, "DEVIATION", 2e-8)
    surfaces_of.cache_clear()
    yield
    surfaces_of.cache_clear()


def _pressed(clutch: Clutch, aside: float, depth: float) -> tuple[float, float]:
    """Load along and across the axis on a dog without friction, N, ridges ``aside`` of each other.

    By the compiled engine; ``aside`` and ``depth`` in m.
    """
    dog, plant = clutch.dog, PlanarClutch(clutch)
    place = 2.0 * crest_setback(dog, dog.edge_radius) + aside - dog.crest_overlap
    way = dog.axial_gap + 2.0 * crest_loss(dog, dog.edge_radius) + depth
    law, workspace = plant.law.copy(), kernel.clip_workspace(len(plant.surfaces.normals))
    law.dynamic_friction = law.static_friction = 0.0
    still = place / dog.mean_radius, dog.travel - way, 0.0, 0.0
    axial, torque = kernel.contact(*still, plant.surfaces, law, workspace)
    return axial, torque / dog.mean_radius


@pytest.mark.usefixtures("_exact")
def test_two_ridges_press_as_cylinders_on_a_bed(clutch: Clutch) -> None:
    """Force per length 4/3 k sqrt(2 R) d^1.5 with half of their radius, on dogs too short to cross.

    That is Hertz's parabola on springs: the width of contact is 2 sqrt(2 R d), and the force
    two thirds of the largest pressure over it.
    """
    radius, short = 0.3 * MM, 0.1 * MM
    dog = replace(clutch.dog, outer_diameter=48 * MM + short, inner_diameter=48 * MM - short)
    own = with_edge_radius(replace(clutch, dog=dog), radius)
    for depth in (5e-6, 10e-6):
        half = math.sqrt(2.0 * (0.5 * radius) * depth)
        peak = own.contact.stiffness * depth
        axial, across = _pressed(own, 0.0, depth)
        assert axial == pytest.approx(2.0 / 3.0 * peak * 2.0 * half * short, rel=0.01)
        assert abs(across) < 0.02 * axial
    assert _pressed(own, 0.0, -1e-7) == (0.0, 0.0)


@pytest.mark.usefixtures("_exact")
@pytest.mark.parametrize("aside", [-0.15, -0.05, 0.0, 0.05, 0.2])
def test_forces_beside_the_ridge_are_those_of_sections(clutch: Clutch, aside: float) -> None:
    """Load along and across the axis against sums over the exact profile, arcs and faces."""
    own = with_edge_radius(clutch, 0.3 * MM)
    along, across = ridges_of(own).pressed(aside * MM, 40e-6, 200)
    axial, tangential = _pressed(own, aside * MM, 40e-6)
    assert axial == pytest.approx(along, rel=0.01)
    assert tangential == pytest.approx(across, abs=0.01 * along)


def test_a_rounded_crest_lands_later_by_what_it_lost(clutch: Clutch, point: Point) -> None:
    """Ridge on ridge: the first touch is at the gap and twice the loss of height."""
    own = with_edge_radius(clutch.with_engine("planar"), 0.3 * MM)
    dog = own.dog
    angle = (2.0 * crest_setback(dog, dog.edge_radius) - dog.crest_overlap) / dog.mean_radius
    found = engage(own, point(0.0, 235.2), angle)
    free = found.trace.displacement[: int(np.argmax(found.trace.contact_force > 1.0)) + 1]
    wanted = dog.axial_gap + 2.0 * crest_loss(dog, dog.edge_radius)
    assert free[-2] < wanted + 1e-6
    assert free[-1] > wanted - 2.0 * DEVIATION
    assert free[-1] - dog.axial_gap > 0.06 * MM


@pytest.mark.parametrize("name", ["prototype", "lean"])
def test_shifts_hang_over_the_closed_forms_window(clutch: Clutch, point: Point, name: str) -> None:
    """Landed without mismatch all over the window, with little creep.

    Those hang that creep does not lead out of the window in time, and none that friction does not
    hold; sharp crests would hang over their crossing at most.
    """
    firm = replace(clutch.contact, stiction_velocity=2e-5)
    dog = replace(dog_of(clutch.dog, DESIGNS[name]), edge_radius=0.3 * MM)
    own, here = replace(replace(clutch, dog=dog), contact=firm), point(0.0, 235.2)
    ridges, each = ridges_of(own), 235.2 / dog.count
    over, friction = WINDOW_FACTOR * ridges.stiff_window(0.1), firm.dynamic_friction
    hung, _ = hang_and_late_widths(own, here, over, 24)
    left = own.timeout - here.profile.rise
    least = ridges.hung_window(each, friction, firm.stiction_velocity, left)
    most, step = ridges.window(each, friction), over / 24
    sharp = dog.height * math.tan(dog.traction) / dog.mean_radius * dog.radial_width
    assert least - step < hung < most + step
    assert least > 0.9 * sharp
    assert hung > sharp


def test_part_drawing_and_checks_have_the_radius_of_the_edges(prototype: Dog) -> None:
    """Root fillets stay; tips, what touches and what lands follow the edge radius."""
    root, tip = 0.3 * MM, 0.5 * MM
    dog = replace(prototype, edge_radius=tip)
    fine = {"segments": 16, "step": 0.5 * DEG}
    both, roots = (ring_part(d, r, 3 * MM, **fine) for d, r in ((prototype, tip), (dog, root)))
    radii = [corner.radius for corner in dog_corners(dog, root)]
    assert radii == pytest.approx([-root, tip, tip, -root])
    # Larger fillets of the same tips add matter.
    assert roots.volume < both.volume
    limits = Limits()
    for flank in FLANKS:
        assert flank_contact(dog, root, flank) == flank_contact(prototype, tip, flank)
        # The root keeps its own radius; its load acts where the flank touches.
        assert notch_factor(dog, root, flank) == notch_factor(prototype, root, flank)
    drawn = dimensioned_svg(dog, limits)
    assert "roots R 0.30 ±0.05, tip edges R 0.50" in drawn
    assert "roots and tip edges R 0.30" in dimensioned_svg(prototype, limits)
    edge = (5e4, *(0.0 for _ in OVERLAPS[1:]))
    sharp, round_ = (demand_of(one, edge, limits).edge for one in (prototype, dog))
    # A strip as far from the sharp crest is as stiff beside either rounding.
    assert round_ == pytest.approx(sharp * math.sqrt(root / tip), rel=0.02)


def test_edges_must_clear_the_fillets(prototype: Dog) -> None:
    limits = Limits().manufacturing
    names = {check.name for check in manufacturing_checks(prototype, limits)}
    assert "edge_clearance" not in names
    for radius, passes in ((0.2, False), (0.3, True), (0.5, True)):
        dog = replace(prototype, edge_radius=radius * MM)
        (check,) = (c for c in manufacturing_checks(dog, limits) if c.name == "edge_clearance")
        assert check.passed is passes
        assert passes or "use a larger dog.edge_radius_mm" in check.remedy


def _landed(clutch: Clutch, point: OperatingPoint, overlap: float) -> Engagement:
    dog = clutch.dog
    return engage(clutch, point, (overlap - dog.crest_overlap) / dog.mean_radius)


@pytest.mark.parametrize(("chamfer", "traction"), [(6, 20), (8, 12), (11, 7), (19.9, 15), (17, 27)])
def test_nothing_pushes_across_the_axis_where_crests_cross(chamfer: float, traction: float) -> None:
    """The sum over the whole pattern vanishes; where faces overlap alone they push by tan a."""
    crests = Crests(chamfer * DEG, traction * DEG, 0.03, 1e-4, 1e18)
    _, along, across = crests.sums()
    assert abs(across[-1] / along[-1]) < 1e-4
    ratios = crests.balance(np.array([0.0, 2.0, 5.0]) * crests.width, 20.0)[1]
    assert abs(ratios[0]) < 1e-3
    assert ratios[1:] == pytest.approx(-math.tan(chamfer * DEG), rel=0.05)


def test_crests_that_cross_hang_where_the_chamfer_would_slide(clutch: Clutch, point: Point) -> None:
    """Depth and place as the closed form has them; beside the crossing the faces slide."""
    lean = replace(clutch, dog=dog_of(clutch.dog, DESIGNS["lean"]))
    assert math.tan(lean.dog.chamfer) > 1.5 * lean.contact.static_friction
    crests = crests_of(lean)
    hung = _landed(lean, point(0.0, 235.2), 0.4 * crests.width)
    assert hung.outcome is Outcome.BLOCKED
    assert event_facts(hung)[-1].startswith("stands crest across crest")
    assert time_on_crests(hung) > 0.1
    trace = hung.trace
    overlap = kernel.face_overlap(trace.relative_angle[-1:], lean.numbers)
    force = float(trace.shift_force[-1]) / lean.dog.count
    depth, ratio = crests.balance(overlap, force)
    assert trace.displacement[-1] - lean.dog.axial_gap == pytest.approx(depth[0], rel=0.03)
    assert abs(ratio[0]) < lean.contact.dynamic_friction
    beside = _landed(lean, point(0.0, 235.2), 1.2 * crests.width)
    assert beside.outcome is Outcome.ENGAGED
    assert not any("crest across" in fact for fact in event_facts(beside))
