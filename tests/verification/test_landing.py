"""The hardest landing: peak of the simulation against one body on a spring, and its checks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sim.batch import landing_of, landing_record
from sim.clutch import Clutch, OperatingPoint
from sim.engagement import engage
from sim.landing import edge_pressure, hardest, landing_checks
from sim.loadcase import LoadCase
from sim.loads import Landing
from sim.phases import face_overlap
from sim.plant import ClutchPlant
from sim.strength import Limits
from sim.units import MPA

Point = Callable[[float, float], OperatingPoint]


@pytest.mark.parametrize("force", [235.2, 641.5])
def test_peak_pressure_of_flat_faces(clutch: Clutch, point: Point, force: float) -> None:
    """Faces without chamfer meet flat: Hunt and Crossley's force on the ring's mass alone."""
    dog = replace(clutch.dog, chamfer=0.0, inner_diameter=48e-3)
    flat = clutch.with_dog(dog)
    operating = point(1.0, force)
    result = engage(ClutchPlant(flat), operating, 0.0)
    profile, contact, mass = operating.profile, clutch.contact, clutch.rings.mass
    start = profile.free_flight_time(dog.axial_gap, mass)
    angle = np.array([operating.mismatch * start])
    overlap, most = face_overlap(flat, angle)
    width = float(min(overlap[0], most - overlap[0]))
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
    pressure = peak / (width * dog.radial_width * dog.count)
    assert result.loads.landing.face_pressure == pytest.approx(pressure, rel=0.05)


def test_flanks_do_not_land(clutch: Clutch, point: Point) -> None:
    """A shift that never meets a face has no landing, however hard its flanks close."""
    angle = next(
        angle
        for angle in np.linspace(0.0, clutch.dog.pitch_angle, 25)
        if engage(ClutchPlant(clutch), point(25, 641.5), angle).events.face_contacts == 0
    )
    result = engage(ClutchPlant(clutch), point(25, 641.5), angle)
    assert result.loads.landing == Landing(0.0, 0.0)
    assert result.loads.peak_tangential_force > 100.0


def test_hertz_of_an_edge_by_hand() -> None:
    """54 N/mm on 0.3 mm: sqrt(54e3 x 115.4e9 / (pi 0.3e-3))."""
    assert edge_pressure(54e3, 0.3e-3) / MPA == pytest.approx(2571, abs=2)


def test_uneven_landing_grows_with_the_root_of_the_share() -> None:
    landing = Landing(100.0 * MPA, 20e3)
    even = landing_checks(landing, Limits(load=LoadCase(load_sharing=1.0)))
    half = landing_checks(landing, Limits(load=LoadCase(load_sharing=0.25)))
    assert even[0].value == pytest.approx(100.0)
    assert half[0].value == pytest.approx(200.0)
    assert half[1].value == pytest.approx(even[1].value * math.sqrt(2.0))


def test_hardest_of_many() -> None:
    landings = [Landing(1.0, 5.0), Landing(3.0, 2.0)]
    assert hardest(landings) == Landing(3.0, 5.0)
    assert hardest([]) == Landing(0.0, 0.0)
    assert landing_of(landing_record(landings[0])) == landings[0]
