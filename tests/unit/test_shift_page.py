"""Words of the page of a shift."""

from __future__ import annotations

from collections.abc import Callable

from dogshape.pipeline.reports.shift_page import event_facts, load_facts, phase_table
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG


def test_facts_are_events_and_loads_with_their_units(
    plant: ClutchPlant, point: Callable[[float, float], OperatingPoint]
) -> None:
    """People read free flight; the record keeps its key."""
    result = engage(plant, point(50.0, 469.0), 10 * DEG)
    assert result.phases[0].name == "free fly"
    assert phase_table(result).rows[0][0] == "free flight"
    listed = [*event_facts(result), *load_facts(result, 12.3)]
    assert "face contacts 1" in listed
    assert f"peak axial force {result.loads.peak_axial_force:.4g} N" in listed
    assert listed[-1] == "driveline peak 12.3 N m"
