"""Text and solids of the page of a shift."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dogshape.pipeline.reports.shift_page import event_facts, load_facts, phase_table, solids
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_planes, dog_solid
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG

Point = Callable[[float, float], OperatingPoint]


def test_touching_surfaces_come_first_in_the_order_the_page_names(prototype: Dog) -> None:
    dog, planes = dog_solid(prototype), dog_planes(prototype)
    assert solids(prototype)["cells"] == dog.cells.ravel().tolist()
    for index, name in enumerate(("traction", "face", "braking")):
        for a, b, c in dog.vertices[dog.cells[2 * index : 2 * index + 2]]:
            normal = np.cross(b - a, c - a)
            assert normal / np.linalg.norm(normal) == pytest.approx(planes[name].normal, abs=1e-9)


def test_phases_have_the_names_of_the_field(plant: ClutchPlant, point: Point) -> None:
    """People read free flight; the record keeps its key."""
    result = engage(plant, point(0.0, 641.5), 12 * DEG)
    assert result.phases[0].name == "free fly"
    names = [row[0] for row in phase_table(result).rows]
    assert "free flight" in names
    assert "free fly" not in names


def test_facts_are_events_and_loads_with_their_units(plant: ClutchPlant, point: Point) -> None:
    result = engage(plant, point(50.0, 469.0), 10 * DEG)
    listed = [*event_facts(result), *load_facts(result, 12.3)]
    assert "face contacts 1" in listed
    assert f"peak axial force {result.loads.peak_axial_force:.4g} N" in listed
    assert listed[-1] == "driveline peak 12.3 N m"
