"""Crests that cross hold each other whatever their chamfer: closed form and simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dogshape.pipeline.reports.shift_page import event_facts
from dogshape.sim import kernel
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement, Outcome, engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG
from tests.conftest import Point, dog_of
from tests.verification.crests import DESIGNS, Crests, crests_of, time_on_crests


@pytest.fixture(scope="module")
def lean(clutch: Clutch) -> Clutch:
    """A chamfer of 12.5 degrees, which slides from rest up to a friction of 0.22."""
    return clutch.with_dog(dog_of(clutch.dog, DESIGNS["lean"]))


def _landed(clutch: Clutch, point: OperatingPoint, overlap: float) -> Engagement:
    dog = clutch.dog
    return engage(ClutchPlant(clutch), point, (overlap - dog.crest_overlap) / dog.mean_radius)


@pytest.mark.parametrize(("chamfer", "traction"), [(6, 20), (8, 12), (11, 7), (19.9, 15), (17, 27)])
def test_nothing_pushes_across_the_axis_where_crests_cross(chamfer: float, traction: float) -> None:
    """The sum over the whole pattern vanishes; where faces overlap alone they push by tan a."""
    crests = Crests(chamfer * DEG, traction * DEG, 0.03, 1e-4, 1e18)
    _, along, across = crests.sums()
    assert abs(across[-1] / along[-1]) < 1e-4
    ratios = crests.balance(np.array([0.0, 2.0, 5.0]) * crests.width, 20.0)[1]
    assert abs(ratios[0]) < 1e-3
    assert ratios[1:] == pytest.approx(-math.tan(chamfer * DEG), rel=0.05)


def test_crests_that_cross_hang_where_the_chamfer_would_slide(lean: Clutch, point: Point) -> None:
    """Depth and place as the closed form has them; beside the crossing the faces slide."""
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
