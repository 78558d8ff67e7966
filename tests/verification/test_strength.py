"""Strength and locking of the prototype against hand calculation."""

from __future__ import annotations

import math

import pytest

from sim.checks import Check
from sim.geometry import Dog
from sim.strength import (
    Limits,
    LoadCase,
    axial_force,
    bending_stress,
    flank_pressure,
    shear_stress,
    strength_checks,
)
from sim.units import DEG


def _by_name(dog: Dog) -> dict[str, Check]:
    return {check.name: check for check in strength_checks(dog, Limits())}


def test_rated_torque_on_all_dogs(prototype: Dog) -> None:
    load = LoadCase(application_factor=1.0, load_sharing=1.0)
    assert load.force_per_dog(prototype) == pytest.approx(200 / (0.024 * 15))
    pressure = flank_pressure(prototype, load, prototype.working_height)
    assert pressure / 1e6 == pytest.approx(44, abs=0.5)
    assert bending_stress(prototype, load) / 1e6 == pytest.approx(81, abs=0.5)
    assert shear_stress(prototype, load) / 1e6 == pytest.approx(34, abs=0.5)


def test_design_load_on_half_the_dogs(prototype: Dog) -> None:
    checks = _by_name(prototype)
    assert checks["flank_pressure"].value == pytest.approx(132, abs=0.5)
    assert checks["shear_stress"].value == pytest.approx(101, abs=0.5)
    assert checks["root_stress"].value == pytest.approx(517, abs=0.5)
    assert checks["root_stress"].limit == pytest.approx(735 / 1.2)


def test_braking_flanks_overlap_less(prototype: Dog) -> None:
    """1666.7 N on 4 mm x (3.7 - 2 x 0.579) mm."""
    assert _by_name(prototype)["flank_pressure_braking"].value == pytest.approx(163.9, abs=0.1)


@pytest.mark.parametrize(
    ("angle", "friction", "force"),
    [
        (12, 0.0, 1771),
        (12, 0.10, 918),
        (12, 0.16, 424),
        (12, 0.30, -685),
        (22, 0.0, 3367),
        (22, 0.10, 2435),
        (22, 0.16, 1910),
        (22, 0.30, 773),
    ],
)
def test_axial_force_of_a_loaded_flank(
    prototype: Dog, angle: float, friction: float, force: float
) -> None:
    assert axial_force(prototype, 200.0, angle * DEG, friction) == pytest.approx(force, abs=1.0)


def test_locking_limits_are_friction_angles(prototype: Dog) -> None:
    checks = _by_name(prototype)
    for name in ("chamfer_release", "self_locking_traction", "self_locking_braking"):
        assert checks[name].limit == pytest.approx(math.degrees(math.atan(0.12)))
        assert not checks[name].at_most


def test_margin_is_the_share_of_the_limit_that_is_left() -> None:
    assert Check("a", 150.0, 200.0, "MPa", True, "").margin == pytest.approx(0.25)
    assert Check("b", 3.0, 2.0, "mm", False, "").margin == pytest.approx(0.5)
    assert not Check("c", 201.0, 200.0, "MPa", True, "").passed
    assert Check("d", 200.0, 200.0, "MPa", True, "").passed


def test_prototype_passes_every_check(prototype: Dog) -> None:
    assert all(check.passed for check in strength_checks(prototype, Limits()))
