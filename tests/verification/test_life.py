"""Fatigue under a load spectrum, misuse and vibration, against closed forms."""

from __future__ import annotations

import math

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_strength import Limits, fatigue, root_load, root_of
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.materials import MATERIALS, damage, reserve
from tests.conftest import named_checks

STEEL = MATERIALS["16MnCr5"]


@pytest.mark.parametrize("cycles", [1.0, 100.0, 1e3, 1e5, 3e6, 1e9])
def test_one_class_is_the_check_of_a_life_of_so_many_cycles(prototype: Dog, cycles: float) -> None:
    plain = named_checks(prototype, LoadCase(shifts=cycles))["root_fatigue"]
    one = named_checks(prototype, LoadCase(spectrum=((1.0, cycles),)))["root_fatigue"]
    assert one.value == pytest.approx(plain.value, rel=1e-12)
    assert one.limit == pytest.approx(plain.limit, rel=1e-9)


def test_the_reserve_of_a_spectrum_on_one_slope_is_a_power_mean() -> None:
    """While all classes stay on one slope, sum n (f s)^(1/x) = 3e6 gives f in closed form."""
    classes = [(1.9, 2e3), (1.6, 1e4), (1.5, 2e4)]
    slope = math.log(STEEL.static_factor) / math.log(3e6 / 1e3)
    used = sum(n * s ** (1.0 / slope) for s, n in classes)
    factor = (3e6 / used) ** slope
    assert all(1.0 < factor * s < STEEL.static_factor for s, _ in classes)
    strengths, cycles = zip(*classes, strict=True)
    assert reserve(STEEL, cycles, *strengths) == pytest.approx(factor, rel=1e-9)
    assert damage(STEEL, strengths, cycles, factor) == pytest.approx(1.0, rel=1e-9)


def test_a_peak_beyond_the_static_strength_is_borne_by_none() -> None:
    assert damage(STEEL, [2.6], [1.0]) == math.inf
    assert reserve(STEEL, [1.0], 2.0) == pytest.approx(STEEL.static_factor / 2.0)
    assert reserve(STEEL, []) == math.inf


def test_negative_classes_load_the_braking_flank(prototype: Dog) -> None:
    limits = Limits(load=LoadCase(spectrum=((0.1, 1e3), (-0.8, 1e5))))
    value, limit = fatigue(prototype, limits)
    load = root_load(prototype, limits, "braking", 0.8 * limits.load.design_torque)
    assert value == pytest.approx(root_of(prototype, limits, load).tension, rel=1e-12)
    assert limit == pytest.approx(limits.endurance(1e5), rel=1e-9)


def test_misuse_meets_the_static_limits_alone(prototype: Dog) -> None:
    plain, hard = (named_checks(prototype, LoadCase(abuse_torque=t)) for t in (None, 600.0))
    for name, check in hard.items():
        static = name.startswith("root_bending") or name in ("shear_stress", "equivalent_stress")
        ratio = 2.0 if static else 1.0  # 600 N m over 200 with 1.5
        assert check.value == pytest.approx(ratio * plain[name].value, rel=1e-9), name
    less = named_checks(prototype, LoadCase(abuse_torque=250.0, coast_share=0.4))
    assert less["root_bending_traction"].value == pytest.approx(
        plain["root_bending_traction"].value, rel=1e-12
    )
    assert less["root_bending_braking"].value == pytest.approx(
        plain["root_bending_braking"].value * 250.0 / 300.0, rel=1e-9
    )


def test_vibration_adds_the_inertia_of_ring_and_fork() -> None:
    keys = ["mechanism.added_mass_kg=0.2"]
    plain = load_study("mq200_paper", keys)
    shaken = load_study("mq200_paper", [*keys, "load.axial_vibration_m_s2=500"])
    for flank in ("traction", "braking"):
        name = f"separating_force_{flank}"
        before, after = (named_checks(s.clutch.dog, s.limits)[name] for s in (plain, shaken))
        assert after.value - before.value == pytest.approx(500.0 * 0.5, rel=1e-9)
    assert shaken.physics_hash == plain.physics_hash
