"""One impact of face on face against its closed form, and the published contact beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import Context

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import CONTACT_SETS, Clutch, ContactSet, OperatingPoint, Solver
from dogshape.sim.shift.mesh import rigid_dog
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG
from dogshape.validation.impact import impact, published_impact


def flat_dogs(clutch: Clutch, contact: ContactSet) -> Clutch:
    """Rectangular dogs of equal side angles: at zero angle face lies on face all over."""
    dog = replace(clutch.dog, chamfer=0.0, traction=15 * DEG, braking=15 * DEG)
    fine = Solver(accuracy=1e-7, max_step=1e-6)
    return replace(clutch, dog=dog, contact=contact, solver=fine)


def face_area(clutch: Clutch) -> float:
    mesh = rigid_dog(clutch.dog)
    a, b, c = np.moveaxis(mesh.vertices[mesh.cells[2:4]], 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def _simulated(clutch: Clutch, speed: float) -> tuple[float, float, float]:
    """Throw the ring at the other; return penetration, restitution, time in contact."""
    plant = ClutchPlant(clutch)
    point = OperatingPoint(0.0, ForceProfile(1.0, 10.0))
    simulator = plant.start(point, 0.0)
    gap = clutch.dog.axial_gap
    plant.plant.SetPositions(plant.plant_context, [0.0, gap - 1e-9, 0.0])
    plant.plant.SetVelocities(plant.plant_context, [0.0, speed, 0.0])
    simulator.Initialize()
    seen: list[tuple[float, float, float]] = []

    def watch(context: Context) -> None:
        state = plant.state()
        seen.append((context.get_time(), state[1] - gap, state[4]))

    simulator.set_monitor(watch)
    simulator.AdvanceTo(4.0 * impact(clutch.contact, face_area(clutch), 0.02, speed).duration)
    time, depth, rate = np.array(seen).T
    inside = depth > 0.0
    return float(depth.max()), float(-rate[-1] / speed), float(np.ptp(time[inside]))


@pytest.mark.parametrize("name", sorted(CONTACT_SETS))
@pytest.mark.parametrize("speed", [0.05, 0.4])
def test_single_impact_against_the_closed_form(clutch: Clutch, name: str, speed: float) -> None:
    """Penetration, restitution and duration of one dog's share of the ring to 1 %."""
    flat = flat_dogs(clutch, CONTACT_SETS[name])
    exact = impact(flat.contact, face_area(flat), clutch.rings.mass / 15, speed)
    depth, restitution, duration = _simulated(flat, speed)
    assert depth == pytest.approx(exact.penetration, rel=0.01)
    assert restitution == pytest.approx(exact.restitution, rel=0.01)
    assert duration == pytest.approx(exact.duration, rel=0.01)


def test_closed_form_has_its_limits() -> None:
    """Without dissipation half a period of a spring; restitution 1 - 2/3 d v and 1/(d v)."""
    soft = ContactSet("soft", 0.0, 0.0, 1e-3, 1e12, 1e-2)
    area, mass, speed = 1e-5, 0.02, 0.3
    rate = math.sqrt(1e12 * area / mass)
    result = impact(soft, area, mass, speed)
    assert result.penetration == pytest.approx(speed / rate, rel=2e-3)
    assert result.duration == pytest.approx(math.pi / rate, rel=1e-4)
    assert 1 - result.restitution == pytest.approx(2 / 3 * 1e-2 * speed, rel=3e-3)
    dead = replace(soft, dissipation=1e3)
    assert impact(dead, area, mass, speed).restitution == pytest.approx(1 / 300, rel=0.01)


def test_adams_set_stops_an_impact_where_the_published_contact_does() -> None:
    """A dog's share of the ring at 0.2 m/s: the damper decides, whatever the unit of K.

    Penetration within 20 %, next to no restitution in both.
    """
    ours = impact(CONTACT_SETS["adams2019"], 12.6e-6, 0.02, 0.2)
    for stiffness in (1e8, 3.16e9):
        theirs = published_impact(stiffness, 0.02, 0.2)
        assert ours.penetration == pytest.approx(theirs.penetration, rel=0.2)
        assert theirs.restitution < 0.12
    assert ours.restitution == pytest.approx(0.05, abs=0.01)
