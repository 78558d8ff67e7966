"""What must not change when the description of a shift does."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.clutch import OperatingPoint
from sim.engagement import engage
from sim.plant import ClutchPlant
from sim.units import DEG, FACTORS, from_si, to_si, unit_of

Point = Callable[[float, float], OperatingPoint]


@pytest.mark.parametrize("pitches", [1, 7, -3])
def test_a_whole_pitch_changes_nothing(plant: ClutchPlant, point: Point, pitches: int) -> None:
    pitch = plant.clutch.dog.pitch_angle
    here = engage(plant, point(50, 469.0), 4 * DEG)
    there = engage(plant, point(50, 469.0), 4 * DEG + pitches * pitch)
    assert here.shift_time == pytest.approx(there.shift_time, rel=1e-5)


def test_coinciding_angles_of_the_thesis(plant: ClutchPlant, point: Point) -> None:
    """148 and 196 degrees are two pitches apart, 114 and 258 six."""
    for a, b in ((148, 196), (114, 258)):
        one = engage(plant, point(100, 315.5), a * DEG)
        two = engage(plant, point(100, 315.5), b * DEG)
        assert one.shift_time == pytest.approx(two.shift_time, rel=1e-4)


@given(st.sampled_from(sorted(FACTORS)), st.floats(-1e6, 1e6))
def test_units_go_there_and_back(suffix: str, value: float) -> None:
    name = f"quantity{suffix}"
    assert from_si(name, to_si(name, value)) == pytest.approx(value, rel=1e-12, abs=1e-300)
    assert unit_of(name)


def test_units_of_names() -> None:
    assert to_si("height_mm", 3.7) == pytest.approx(3.7e-3)
    assert to_si("mismatch_rpm", 60.0) == pytest.approx(6.283185307)
    assert to_si("stiction_velocity_m_s", 2.0) == 2.0
    assert to_si("count", 15) == 15
    assert unit_of("proof_stress_MPa") == "MPa"
    assert unit_of("inertia_kgm2") == "kg m2"
