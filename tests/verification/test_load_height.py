"""Flanks out of angle on plane finite elements: balance, symmetry, a beam and a flat punch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import DEG
from dogshape.validation.finite_elements.root_stress import fem_available
from tests.conftest import require_program

if TYPE_CHECKING:
    from tests.verification.flank_model import FlankModel

FORCE = 4e5  #: N/m


@pytest.fixture(scope="module")
def coarse(prototype: Dog) -> FlankModel:
    """The prototype with twelve strips."""
    require_program(fem_available(), "scikit-fem")
    from tests.verification.flank_model import FlankModel

    return FlankModel(prototype, strips=12)


def test_angle_moves_the_load_to_either_end(coarse: FlankModel) -> None:
    heights = [coarse.press(a * DEG, FORCE).height for a in (0.0, 0.05, 0.1, 0.25, 0.5)]
    assert np.all(np.diff(heights) > 0.0)
    assert heights[-1] < 1.0
    other = coarse.press(-0.25 * DEG, FORCE).height
    assert other == pytest.approx(1.0 - heights[3], abs=1e-6)


def test_figures_of_the_documentation(coarse: FlankModel) -> None:
    """Load height by the angle, and the approach behind 25 N/(mm um), at the design force."""
    for angle, height in ((0.05, 0.61), (0.1, 0.71), (0.25, 0.89), (0.5, 0.95)):
        found = coarse.press(angle * DEG, 1.25e6 / 3.0)
        assert found.height == pytest.approx(height, abs=0.01)
    found = coarse.press(0.0, 1.25e6 / 3.0)
    assert found.approach == pytest.approx(11.9e-6, rel=0.02)
    assert found.force.min() >= 0.0


def test_only_load_over_angle_matters(coarse: FlankModel) -> None:
    """Elastic flanks without roundings know no other scale than force over angle."""
    one = coarse.press(0.1 * DEG, FORCE, "cut")
    two = coarse.press(0.3 * DEG, 3.0 * FORCE, "cut")
    assert two.height == pytest.approx(one.height, rel=1e-9)
    assert two.approach == pytest.approx(3.0 * one.approach, rel=1e-9)


def test_pressure_is_that_of_a_flat_punch(coarse: FlankModel) -> None:
    """Two bodies that touch on a strip alone: p = P/(pi sqrt(a^2 - x^2)) far from its ends."""
    found = coarse.press(0.0, FORCE, "cut")
    band = coarse.contact
    inside = np.isfinite(coarse.gap(0.0, "cut"))
    x = 2.0 * (coarse.levels - band.low) / band.height - 1.0
    share = np.diff(np.arcsin(np.clip(x, -1.0, 1.0)))[inside] / np.pi
    part = found.force[inside] / found.force.sum()
    assert np.abs(part / share - 1.0).max() < 0.15


def test_flexibility_is_symmetric_and_a_slender_dog_bends_as_a_beam() -> None:
    """A load at b turns all above by b^2/(2 E'I) more than the root: its curvature in b."""
    require_program(fem_available(), "scikit-fem")
    from tests.verification.flank_model import FlankModel

    dog = Dog(628, 0.0, 0.0, 0.0, 30e-3, 2.0, 1.992, 1e-3)
    model = FlankModel(dog, strips=24)
    low, top = model.middles, len(model.middles) - 1
    at = np.searchsorted(low, [10e-3, 14e-3, 18e-3])
    rise = low[top] - low[top - 6]
    turn = (model.flexibility[top, at] - model.flexibility[top - 6, at]) / rise
    curvature = 2.0 * np.polyfit(low[at], turn, 2)[0]
    inertia = dog.root_width**3 / 12.0
    assert curvature == pytest.approx((1.0 - POISSON**2) / (YOUNG * inertia), rel=0.02)
