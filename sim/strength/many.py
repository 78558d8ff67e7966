"""Margins of many designs at once: the closed forms of one design on whole columns.

``strength_checks`` takes a good part of a millisecond for a design, most of it for the contact that
is left within the tolerances. A table of a hundred thousand wants more. Here the same formulas run
over columns; both agree to rounding, which ``tests/properties/test_many_designs.py`` holds for
designs drawn at random. Loads that a design shares in a way of its own are left to
``strength_checks``; ``covers`` tells which.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dogshape.sim.shift.flank import FLANKS, Flank
from dogshape.sim.shift.geometry import SHARPEST, Dog
from dogshape.sim.strength.columns import Column, Dogs
from dogshape.sim.strength.dog_strength import LEAST_AREA, Limits
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.notch import LONGEST, STEEPEST, TENSION
from dogshape.sim.strength.rim import THICK, THINNEST
from dogshape.sim.strength.tolerance import SIDES
from dogshape.sim.units import DEG, MM

Margins = dict[str, Column]  #: by the check's name, in the order of ``strength_checks``, each (n,)


def covers(dog: Dog, limits: Limits) -> bool:
    """Decide whether columns say all.

    They do without rounded edges, shares by pitch errors, load spectrum and flank strike.
    """
    load = limits.load
    shared = load.accuracy is not None or load.pitch_sd is not None or load.run_out > 0.0
    return not (shared or load.spectrum or limits.strike is not None or dog.edge_radius > 0.0)


def strength_margins(dogs: Dogs, limits: Limits) -> Margins:
    """Compute the margin of every check that needs no simulation, (n,) each.

    Of designs that ``Dogs.possible`` marks, for limits that ``covers`` takes.
    """
    return {
        **_to_make(dogs, limits),
        **_to_lock(dogs, limits.load),
        **_to_carry(dogs, limits),
        **_within_tolerances(dogs, limits),
    }


def _below(value: Column | float, limit: Column | float) -> Column:
    """Compute the margin of values to an upper limit, as ``Check`` does."""
    return _margin(np.subtract(limit, value), limit)


def _above(value: Column | float, limit: Column | float) -> Column:
    """Compute the margin of values to a lower limit."""
    return _margin(np.subtract(value, limit), limit)


def _margin(left: Column, limit: Column | float) -> Column:
    size = np.abs(limit)
    return np.asarray(left / np.where(size > 0.0, size, 1.0))


def _to_make(dogs: Dogs, limits: Limits) -> Margins:
    made, inner = limits.manufacturing, dogs.inner_radius
    tip = dogs.tip_width_at(inner)
    slot = dogs.pitch_angle * inner - dogs.root_width_at(inner)
    lowest = dogs.height - dogs.edge_drop_at(dogs.outer_radius)
    core = tip - 2.0 * limits.material.case_depth
    return {
        "tip_width": _above(tip / MM, made.tip_width / MM),
        "slot_width": _above(slot / MM, made.slot_width / MM),
        "cutter_reach": _below(dogs.height / slot, made.cutter_reach),
        "flank_height": _above(lowest / MM, made.flank_height / MM),
        "root_radius": _above(dogs.root_radius_room() / MM, made.root_radius / MM),
        "chamfer_share": _below(
            dogs.edge_drop_at(dogs.mean_radius) / dogs.height, made.chamfer_share
        ),
        "module": _above(2.0 * dogs.mean_radius / dogs.count / MM, made.module / MM),
        "tip_core": _above(core / MM, made.tip_core / MM),
    }


def _to_lock(dogs: Dogs, load: LoadCase) -> Margins:
    slides = math.atan(load.friction_release)
    found = {"chamfer_release": _above(dogs.chamfer / DEG, slides / DEG)}
    if load.release_by_itself:
        lets_go = slides + np.arctan(load.spline_friction * dogs.mean_radius / load.spline_radius)
        for flank in FLANKS:
            angle = dogs.side_angle(flank)
            found[f"{flank}_release"] = _above(angle / DEG, lets_go / DEG)
    for flank in FLANKS:
        torque = load.design_torque * load.share_of(flank)
        held = min(load.spline_friction, load.friction_hold) * torque / load.spline_radius
        pushed = _axial_force(dogs, torque, flank, load.friction_hold)
        force = pushed - held + load.vibration_force
        found[f"separating_force_{flank}"] = _below(force, load.separating_force_limit)
    if load.pull_out_force_limit is not None:
        pulls = []
        for flank in FLANKS:
            torque = load.torque * load.share_of(flank)
            push = _axial_force(dogs, torque, flank, load.friction_release)
            pulls.append(load.spline_friction * torque / load.spline_radius - push)
        found["pull_out_force"] = _below(np.maximum(*pulls), load.pull_out_force_limit)
    return found


def _axial_force(dogs: Dogs, torque: float, flank: Flank, friction: float) -> Column:
    angle = dogs.side_angle(flank) - math.atan(friction)
    return np.asarray(torque / dogs.mean_radius * np.tan(angle))


def _to_carry(dogs: Dogs, limits: Limits) -> Margins:
    load, material = limits.load, limits.material
    found, radius = {}, limits.root_radius
    rim, area = _rim_factor(dogs, limits), dogs.radial_width * dogs.root_width_at(dogs.mean_radius)
    depth = 1.0 + material.case_depth / radius
    below = (depth**-2 + 3.0 * depth**-4) / 4.0
    tensions, shears, equivalents, lasting = [], [], [], []
    for flank in FLANKS:
        design, static = load.design_torque * load.share_of(flank), load.static_torque(flank)
        touching = np.maximum(dogs.contact_area(radius, flank), LEAST_AREA)
        pressure = _force(dogs, load, design) / touching
        found[f"flank_pressure_{flank}"] = _below(pressure, material.allowable_pressure)
        notch, force = _notch(dogs, radius, flank), _force(dogs, load, static)
        nominal = _nominal(dogs, limits, flank)
        tensions.append(notch * (force * nominal) * rim)
        lasting.append(notch * (_force(dogs, load, design) * nominal) * rim)
        shears.append(1.5 * force / area)
        core = force * nominal * (1.0 + (notch - 1.0) * below) * rim
        equivalents.append(np.hypot(core, math.sqrt(3.0) * shears[-1]))
    for flank, tension in zip(FLANKS, tensions, strict=True):
        found[f"root_bending_{flank}"] = _below(tension, limits.static_root_stress)
    allowable = limits.allowable_stress
    found["shear_stress"] = _below(np.maximum(*shears), allowable / math.sqrt(3.0))
    found["equivalent_stress"] = _below(np.maximum(*equivalents), allowable)
    found["root_fatigue"] = _below(np.maximum(*lasting), limits.fatigue_stress)
    rim_thickness = limits.manufacturing.rim
    if rim_thickness is not None:
        found["rim"] = _above(rim_thickness / MM, THINNEST * dogs.height / MM)
    return found


def _force(dogs: Dogs, load: LoadCase, torque: float) -> Column:
    """Compute the tangential force on the dog that carries most, N."""
    return torque / (dogs.mean_radius * dogs.count * load.load_sharing)


def _rim_factor(dogs: Dogs, limits: Limits) -> Column:
    rim = limits.manufacturing.rim
    if rim is None:
        return np.ones(len(dogs.height))
    thin = np.maximum(1.0, 1.6 * np.log(2.242 * dogs.height / rim))
    return np.where(rim >= THICK * dogs.height, 1.0, thin)


def _notch(dogs: Dogs, root_radius: float, flank: Flank) -> Column:
    """Compute ``notch_factor``: tension in the fillet over the nominal one."""
    by, width = TENSION, dogs.root_width_at(dogs.mean_radius)
    lean = np.minimum(dogs.leans[flank], STEEPEST)
    sharp = 1.0 + by.notch * np.power(width / root_radius, by.sharpness)
    length = np.minimum(dogs.radial_width / width, LONGEST)
    return np.maximum(1.0, sharp * (1.0 + by.spread * length) * (1.0 + by.lean * lean))


def _nominal(dogs: Dogs, limits: Limits, flank: Flank) -> Column:
    """Compute ``root_nominal`` over the force, 1/m2."""
    by, width, lean = TENSION, dogs.root_width_at(dogs.mean_radius), dogs.leans[flank]
    lost = dogs.lost(limits.root_radius, flank, dogs.mean_radius)
    lever = lost + limits.load.load_height * (dogs.height - lost - lost)
    arm = 0.5 * width - lever * lean
    bent = 6.0 * lever / width**2
    axial = by.axial * lean * np.maximum(0.0, 6.0 * arm / width**2 + 1.0 / width)
    nominal = bent + by.near / np.sqrt(width * lever) - axial
    return np.asarray(np.maximum(nominal, 2.0 * lever / width**2) / dogs.radial_width)


def _within_tolerances(dogs: Dogs, limits: Limits) -> Margins:
    sizes = limits.tolerances
    seated = limits.seated_tolerance / dogs.height
    left = [
        here - seated - worst
        for here, worst in zip(
            _contact(dogs, limits.root_radius), _worst_contact_losses(dogs, limits), strict=True
        )
    ]
    clearance = dogs.axial_gap - sizes.axial_gap - 2.0 * sizes.height
    return {
        "contact_ratio": _above(np.maximum(np.minimum(*left), -1.0), sizes.contact_ratio),
        "clearance": _above(clearance / MM, sizes.clearance / MM),
    }


def _contact(dogs: Dogs, root_radius: Column | float) -> list[Column]:
    """Return the height that touches over that of the dog, of either flank, (n,) each."""
    lost = [dogs.lost(root_radius, flank, dogs.mean_radius) for flank in FLANKS]
    return [(dogs.height - one - one) / dogs.height for one in lost]


def _worst_contact_losses(dogs: Dogs, limits: Limits) -> list[Column]:
    """Compute the largest loss of either flank's contact within the tolerances, (n,) each."""
    sizes, nominal = limits.tolerances.dimensions, _contact(dogs, limits.root_radius)
    ones = np.ones(len(dogs.height))

    def fall(deviations: Mapping[str, Column]) -> list[Column]:
        """Lose what the dogs off by so much do, infinity where that is no dog."""
        off = {name: by for name, by in deviations.items() if name != "root_radius"}
        moved = dogs.moved(off)
        radius = np.maximum(SHARPEST, limits.root_radius + deviations.get("root_radius", 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):  # of shapes that cannot be
            real, there = moved.possible(), _contact(moved, radius)
            return [
                np.where(real, one - off, np.inf) for one, off in zip(nominal, there, strict=True)
            ]

    falls = {
        name: [fall({name: side * size * ones}) for side in SIDES] for name, size in sizes.items()
    }
    found = []
    for i in range(len(FLANKS)):
        worst, corner = [np.zeros(len(ones))], {}
        for name, (down, up) in falls.items():
            # The first of two that take as much, as for one design.
            corner[name] = np.where(down[i] >= up[i], SIDES[0], SIDES[1]) * sizes[name]
            worst.append(np.maximum(down[i], up[i]))
        found.append(np.maximum.reduce([*worst, fall(corner)[i]]))
    return found
