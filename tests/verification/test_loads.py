"""Release, pull-out, coast, load spectrum and misuse against equilibrium and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import pytest
from scipy.optimize import brentq

from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.shift.geometry import FLANKS, Dog
from dogshape.sim.strength.dog_strength import Limits, fatigue, root_load, root_of
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import pull_out_force, release_angle, retention
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.strength.materials import MATERIALS, damage, stress_reserve
from dogshape.sim.units import DEG, MM, MPA
from tests.conftest import named_checks

SPLINE = LoadCase(spline_friction=0.1, spline_radius=17.6 * MM, pull_out_force_limit=641.5)


def _pull_by_equilibrium(dog: Dog, angle: float, mu: float, spline: float, radius: float) -> float:
    """Return the pull in N at 200 N m from the normal forces of flank and spline themselves."""
    # Outwards: normal sin less friction cos; along the circumference both carry the torque.
    normal = 200.0 / dog.mean_radius / (math.cos(angle) + mu * math.sin(angle))
    return spline * 200.0 / radius - normal * (math.sin(angle) - mu * math.cos(angle))


def test_pull_out_is_the_balance_of_flank_and_spline(prototype: Dog) -> None:
    """611 N for the prototype and 1357 N at 6.89 degrees; 200 N m, 0.12 at flank and spline."""
    narrow = replace(prototype, traction=6.8912 * DEG)
    for dog, force in ((prototype, 611.5), (narrow, 1356.6)):
        found = pull_out_force(dog, SPLINE, "traction")
        by_hand = _pull_by_equilibrium(dog, dog.traction, 0.12, 0.12, 17.6 * MM)
        assert found == pytest.approx(by_hand, rel=1e-12)
        assert found == pytest.approx(force, abs=0.5)


def test_a_flank_lets_go_where_the_pull_vanishes(prototype: Dog) -> None:
    def pull(angle: float) -> float:
        return pull_out_force(replace(prototype, traction=angle), SPLINE, "traction")

    vanishes = brentq(pull, 5 * DEG, 30 * DEG)
    assert release_angle(prototype, SPLINE) == pytest.approx(vanishes, rel=1e-9)
    assert vanishes / DEG == pytest.approx(6.843 + 9.295, abs=0.01)
    checks = named_checks(prototype, SPLINE)
    assert checks["traction_release"].limit == pytest.approx(vanishes / DEG)
    assert checks["braking_release"].limit == pytest.approx(vanishes / DEG)
    assert checks["chamfer_release"].limit == pytest.approx(6.843, abs=0.001)
    assert checks["pull_out_force"].value == pytest.approx(611.5, abs=0.5)
    assert checks["pull_out_force"].margin == pytest.approx(1 - 611.5 / 641.5, abs=1e-3)


def test_a_spline_holds_with_the_lower_coefficient(prototype: Dog) -> None:
    """852 N less at 300 N m, 17.6 mm and 0.05, the holding coefficient, below the spline's 0.1."""
    slippery = replace(SPLINE, spline_friction=0.01)
    for flank, (load, friction) in product(FLANKS, ((SPLINE, 0.05), (slippery, 0.01))):
        found = retention(prototype, load, flank)
        helped = found.flank_friction - found.all_friction
        assert helped == pytest.approx(friction * 300 / 17.6e-3, rel=1e-12)


@pytest.mark.parametrize("share", [1.0, 0.6, 0.3])
def test_equivalent_stress_takes_tension_and_shear_of_a_flank(prototype: Dog, share: float) -> None:
    """Traction flanks of 30 and braking ones of 5 degrees: coast moves what decides to traction."""
    steep = replace(prototype, chamfer=0.0, traction=30 * DEG, braking=5 * DEG)
    limits = Limits(load=LoadCase(coast_share=share))
    roots = {f: root_of(steep, limits, root_load(steep, limits, f)) for f in FLANKS}
    by_flank = {f: math.hypot(root.core, math.sqrt(3.0) * root.shear) for f, root in roots.items()}
    found = named_checks(steep, limits.load)["equivalent_stress"].value * MPA
    assert found == pytest.approx(max(by_flank.values()), rel=1e-12)
    assert (by_flank["braking"] > by_flank["traction"]) == (share == 1.0)


@pytest.mark.parametrize("given", ["mechanism.spline_friction=0.1", "effects.spline_friction=0.1"])
def test_the_actuator_pulls_with_the_smallest_shift_force_unless_the_study_says(given: str) -> None:
    study = load_study("mq200_paper", [given])
    load = study.limits.load
    assert load.pull_out_force_limit == 235.2
    assert load.spline_friction == 0.1
    assert load.spline_radius == pytest.approx(0.8 * 22e-3)
    said = load_study("mq200_paper", [given, "load.pull_out_force_limit_N=1200"]).limits.load
    assert said.pull_out_force_limit == 1200.0


@pytest.mark.parametrize(
    ("ratio", "factor"), [(2.0, 1.0), (1.2, 1.0), (0.8, 1.6487), (0.5, 2.4007)]
)
def test_a_thin_rim_raises_the_root_stress(prototype: Dog, ratio: float, factor: float) -> None:
    """ISO 6336-3: 1.6 ln(2.242 h/s) below 1.2 heights, and nothing above."""
    rim = ManufacturingLimits(rim=ratio * prototype.height)
    plain, thin = named_checks(prototype), named_checks(prototype, Limits(manufacturing=rim))
    for name in ("root_bending_traction", "root_bending_braking", "root_fatigue"):
        assert thin[name].value == pytest.approx(factor * plain[name].value, rel=2e-4)
    assert thin["shear_stress"].value == plain["shear_stress"].value
    assert thin["rim"].margin == pytest.approx(ratio / 0.5 - 1.0)
    assert "rim" not in plain
    assert load_study("mq200_paper", ["manufacturing.rim_mm=3"]).limits.manufacturing.rim == 3e-3


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
    assert stress_reserve(STEEL, cycles, *strengths) == pytest.approx(factor, rel=1e-9)
    assert damage(STEEL, [factor * s for s in strengths], cycles) == pytest.approx(1.0, rel=1e-9)


def test_a_peak_beyond_the_static_strength_is_borne_by_none() -> None:
    assert damage(STEEL, [2.6], [1.0]) == math.inf
    assert stress_reserve(STEEL, [1.0], 2.0) == pytest.approx(STEEL.static_factor / 2.0)
    assert stress_reserve(STEEL, []) == math.inf


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
    for flank, ratio, close in (("traction", 1.0, 1e-12), ("braking", 250.0 / 300.0, 1e-9)):
        known = ratio * plain[f"root_bending_{flank}"].value
        assert less[f"root_bending_{flank}"].value == pytest.approx(known, rel=close)


def test_vibration_adds_the_inertia_of_ring_and_fork() -> None:
    keys = ["mechanism.added_mass_kg=0.2"]
    plain = load_study("mq200_paper", keys)
    shaken = load_study("mq200_paper", [*keys, "load.axial_vibration_m_s2=500"])
    for flank in ("traction", "braking"):
        name = f"retention_{flank}"
        before, after = (named_checks(s.clutch.dog, s.limits)[name] for s in (plain, shaken))
        assert after.value - before.value == pytest.approx(500.0 * 0.5, rel=1e-9)
    assert shaken.physics_hash == plain.physics_hash
