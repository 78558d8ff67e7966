"""Dogs that pass through each other are no engagement."""

from dataclasses import replace

import numpy as np
import pytest

from sim.geometry import Dog
from sim.mesh import pressure_apex
from sim.passing import passing_through, penetration
from sim.units import DEG

_DOG = Dog(31, 10.63 * DEG, 6.89 * DEG, 24.5 * DEG, 2.485e-3, 52e-3, 44e-3, 1e-3)


def _depth(dog: Dog, displacement: float, pitches: float) -> float:
    angle = np.array([pitches * dog.pitch_angle])
    return float(penetration(dog, np.array([displacement]), angle)[0])


def test_seated_dogs_touch_and_do_not_overlap() -> None:
    assert _depth(_DOG, _DOG.travel, 0.5) == pytest.approx(0.0, abs=1e-12)


def test_flat_faces_overlap_by_the_way_beyond_their_gap() -> None:
    flat = replace(_DOG, chamfer=0.0)
    assert _depth(flat, flat.axial_gap - 1e-5, 0.0) == 0.0
    assert _depth(flat, flat.axial_gap + 1e-4, 0.0) == pytest.approx(1e-4)


@pytest.mark.parametrize(("side", "angle"), [(-1, _DOG.braking), (1, _DOG.traction)])
def test_a_seated_dog_off_its_slot_overlaps_across_the_flank(side: int, angle: float) -> None:
    off = 0.02
    expected = off * _DOG.pitch * np.cos(angle)
    assert _depth(_DOG, _DOG.travel, 0.5 + side * off) == pytest.approx(expected)


def test_a_dog_inside_another_is_refused_with_depth_and_remedy() -> None:
    way, angle = np.array([_DOG.travel]), np.array([0.1 * _DOG.pitch_angle])
    assert _depth(_DOG, _DOG.travel, 0.1) > pressure_apex(_DOG)[1]
    assert "penetration of the dogs is" in passing_through(_DOG, way, angle)
    assert passing_through(_DOG, way, np.array([0.49 * _DOG.pitch_angle])) == ""
