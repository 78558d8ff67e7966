"""The hardest landing: peak of the simulation against one body on a spring, and its checks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dogshape.sim import kernel
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.events import OVERLAPS
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import Landing, demand_checks, demand_of, edge_pressure
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import MPA
from tests.conftest import Point


@pytest.mark.parametrize("force", [235.2, 641.5])
def test_peak_pressure_of_flat_faces(clutch: Clutch, point: Point, force: float) -> None:
    """Faces without chamfer meet flat: Hunt and Crossley's force on the ring's mass alone."""
    dog = replace(clutch.dog, chamfer=0.0, inner_diameter=48e-3)
    flat = clutch.with_dog(dog)
    operating = point(1.0, force)
    result = engage(ClutchPlant(flat), operating, 0.0)
    profile, contact, mass = operating.profile, clutch.contact, clutch.rings.mass
    start = profile.free_flight_time(dog.axial_gap, mass)
    overlap = kernel.face_overlap(operating.mismatch * start, flat.numbers)
    width = float(min(overlap, 2.0 * dog.face_width - overlap))
    stiffness = contact.stiffness * width * dog.radial_width * dog.count

    def press(x: float, v: float) -> float:
        return stiffness * max(x, 0.0) * max(0.0, 1.0 + contact.dissipation * v)

    def motion(t: float, state: np.ndarray) -> list[float]:
        return [state[1], (float(profile.at(t)) - press(*state)) / mass]

    speed = float(profile.free_speed(start, mass))
    run = solve_ivp(
        motion, (start, start + 2e-3), [0.0, speed], rtol=1e-8, atol=1e-12, max_step=1e-6
    )
    peak = max(press(x, v) for x, v in run.y.T)
    load = peak / (dog.radial_width * dog.count)
    classes = result.loads.landing_loads
    assert max(classes) == pytest.approx(load, rel=0.05)
    assert classes.index(max(classes)) == np.searchsorted(OVERLAPS, width, side="right") - 1


def _landing(**classes: float) -> Landing:
    """Return a landing with loads in N/mm by class, such as ``at_14`` for 1.4 mm of overlap."""
    loads = [0.0] * len(OVERLAPS)
    for name, load in classes.items():
        loads[int(name.removeprefix("at_"))] = load * 1e3
    return tuple(loads)


def _checks(dog: Dog, landing: Landing, limits: Limits) -> tuple[Check, ...]:
    return demand_checks(demand_of(dog, landing, limits), limits)


def test_hertz_of_two_edges_by_hand() -> None:
    """54 N/mm on two radii of 0.3 mm: sqrt(54e3 x 115.4e9 / (pi 0.15e-3))."""
    assert edge_pressure(54e3, 0.3e-3) / MPA == pytest.approx(3636, abs=2)


def test_overlap_is_flat_between_two_rounded_crests(prototype: Dog) -> None:
    """0.3 mm at 94 degrees takes 0.2798 mm of either face: 1.4 mm leave 0.840 mm."""
    limits = Limits(load=LoadCase(load_sharing=1.0))
    face, core, edge = _checks(prototype, _landing(at_14=100.0), limits)
    assert face.value == pytest.approx(100.0 / 0.8405, rel=1e-3)
    assert core.value == pytest.approx(100.0 / (0.8405 + 0.8), rel=1e-3)
    assert edge.value == 0.0
    assert face.limit == pytest.approx(700 * 9.80665 / 3 / 1.2)
    assert edge.limit == pytest.approx(4 / math.sqrt(3) * 700 * 9.80665 / 3)


def test_what_is_not_flat_bears_on_edges(prototype: Dog) -> None:
    limits = Limits(load=LoadCase(load_sharing=1.0))
    face, core, edge = _checks(prototype, _landing(at_6=54.0, at_3=20.0), limits)
    assert face.value == core.value == 0.0
    assert edge.value == pytest.approx(3636, abs=2)
    wide = limits.with_root_radius(0.6e-3)  # now 1.12 mm are rounded
    assert _checks(prototype, _landing(at_11=54.0), wide)[0].value == 0.0
    assert _checks(prototype, _landing(at_11=54.0), limits)[0].value > 0.0
