"""Dogs and pointed teeth of two published models against the times that their equations give.

Rectangular dogs: ``dogClutch5.mo`` of the repository MarvinSt/Modelica, with inertias of its
``Gearbox.mo``. Pointed teeth of a synchroniser's sleeve: ``DogClutch2`` in ``Synchronizer3`` of the
repository wubonian/Modelica_TDL (Transmission Dynamic Library). Both have no friction on the dogs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array
from dogshape.sim.kernel_layout import (
    AXIAL_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SPEED,
    SLIDING_ANGLE,
    SLIDING_SPEED,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint, Rings, solver_for
from dogshape.sim.shift.conclusion import Engagement, engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, RPM

RISE = 1e-4  #: s, rise of a force that both models have at once


def clutch_of(dog: Dog, rings: Rings, dissipation: float, stiffness: float) -> Clutch:
    """Return a frictionless clutch in the compiled engine that waits for seconds."""
    contact = ContactSet("lubricated_steel", 0.0, 0.0, 2e-4, stiffness, dissipation)
    return Clutch(dog, rings, contact, solver_for(contact), timeout=5.0).with_engine("planar")


class Window(NamedTuple):
    """Rectangular dogs of ``dogClutch5.mo``: 5 of them, 15 in 72 degrees are open."""

    pitch: float = 72.0 * DEG
    window: float = 15.0 * DEG
    radius: float = 50.0 * MM
    gap: float = 2.0 * MM
    throw: float = 2.5 * MM
    sleeve_mass: float = 0.01  #: kg, of the fork
    input_inertia: float = 0.1  #: kg m2
    output_inertia: float = 0.05

    @property
    def clutch(self) -> Clutch:
        """Flat dogs with straight flanks and the window as backlash."""
        dog = Dog(
            5, 0.0, 0.0, 0.0, self.throw - self.gap, 2.0 * (self.radius + 5.0 * MM),
            2.0 * (self.radius - 5.0 * MM), self.gap, backlash=self.window * self.radius,
        )  # fmt: skip
        rings = Rings(self.sleeve_mass, self.input_inertia, self.output_inertia)
        return clutch_of(dog, rings, 20.0, 5e12)

    def mean_wait(self, mismatch: float) -> float:
        """Compute the mean wait of a random phase for the next window, s."""
        return (self.pitch - self.window) ** 2 / (2.0 * self.pitch * mismatch)


def has_direct_entry(shift: Engagement) -> bool:
    """Test that a shift engaged in the first window without touching a face."""
    return shift.shift_time is not None and shift.events.face_contacts == 0


@pytest.mark.parametrize("mismatch_rpm", [5.0, 20.0, 60.0])
def test_rectangular_dogs_wait_for_their_window(mismatch_rpm: float) -> None:
    """Direct share exact on a grid of 0.75 degrees; mean wait within 4 %."""
    count, model = 96, Window()
    plant, mismatch, force = PlanarClutch(model.clutch), mismatch_rpm * RPM, 300.0
    point = OperatingPoint(mismatch, ForceProfile(force, RISE))
    angles = (np.arange(count) + 0.5) / count * model.pitch
    shifts = [engage(plant, point, float(angle)) for angle in angles]
    assert sum(map(has_direct_entry, shifts)) == round(count * model.window / model.pitch) == 20
    flight = RISE / 2.0 + math.sqrt(2.0 * model.sleeve_mass * model.throw / force)
    waits = np.array([shift.shift_time or math.nan for shift in shifts]) - flight
    assert waits.mean() == pytest.approx(model.mean_wait(mismatch), rel=0.04)


class Sleeve(NamedTuple):
    """Pointed teeth of ``DogClutch2``: 27 of a half angle of 56 degrees on 28 mm, heavy wheel."""

    force: float
    count: int = 27
    radius: float = 28.0 * MM
    slope: float = 34.0 * DEG  #: of the roof from the face plane
    mass: float = 0.05  #: kg
    inertia: float = 3.51e-4  #: kg m2, of hub and sleeve
    wheel_inertia: float = 20.0

    @property
    def clutch(self) -> Clutch:
        """Roofs over half a pitch; narrow, as the model has one radius, and stiff, as it is rigid.

        The crests stand 10 um apart, the least of a shift from rest on the roofs.
        """
        half = 0.1 * MM
        dog = Dog(
            self.count, self.slope, 0.0, 0.0, 4.0 * MM, 2.0 * (self.radius + half),
            2.0 * (self.radius - half), 0.01 * MM, crest=0.5, chamfer_back=self.slope,
        )  # fmt: skip
        rings = Rings(self.mass, self.inertia, self.wheel_inertia)
        return clutch_of(dog, rings, 5.0, 5e15)

    @property
    def lever(self) -> float:
        """Torque over axial force, m."""
        return self.radius * math.tan(self.slope)

    @property
    def moving_mass(self) -> float:
        """Mass of the sleeve and of what turns with it, at the sleeve, kg."""
        return self.mass + self.inertia / self.lever**2

    @property
    def tip_height(self) -> float:
        """Height of the roof, m."""
        return math.pi / self.count * self.lever

    def slide_time(self, start: float, end: float) -> float:
        """Compute the time from a plastic landing at the angle ``start`` to ``end``, rad, s."""
        fall = self.clutch.dog.axial_gap + start * self.lever
        landing = self.mass * math.sqrt(2.0 * self.force * fall / self.mass) / self.moving_mass
        pull, way = self.force / self.moving_mass, (end - start) * self.lever
        return (math.sqrt(landing**2 + 2.0 * pull * way) - landing) / pull

    def fall_time(self, start: float) -> float:
        """Compute the time from rest to the landing at the angle ``start``, rad, s."""
        fall = self.clutch.dog.axial_gap + start * self.lever
        return RISE / 2.0 + math.sqrt(2.0 * self.mass * fall / self.force)


def test_the_sleeve_has_the_numbers_of_its_model() -> None:
    sleeve = Sleeve(500.0)
    assert sleeve.tip_height == pytest.approx(2.198 * MM, rel=1e-3)
    assert sleeve.clutch.dog.face_width * 2.0 * math.tan(sleeve.slope) == pytest.approx(
        sleeve.tip_height, rel=1e-6
    )
    assert sleeve.moving_mass == pytest.approx(1.034, rel=1e-3)
    assert sleeve.lever == pytest.approx(18.89 * MM, rel=1e-3)
    times = [math.sqrt(2.0 * sleeve.tip_height * sleeve.moving_mass / f) for f in (500.0, 2000.0)]
    assert times == pytest.approx([3.02e-3, 1.51e-3], rel=3e-3)


@pytest.mark.parametrize(
    ("force", "engine"),
    [(500.0, "planar"), (1000.0, "planar"), (2000.0, "planar"), (500.0, "drake")],
)
def test_pointed_teeth_slide_as_a_wedge(force: float, engine: str) -> None:
    """Slide within 2 %, torque over force within 1 % from 1.2 degrees off the ridge on."""
    sleeve, start, end = Sleeve(force), 0.5 * DEG, 6.6 * DEG
    clutch = sleeve.clutch.with_engine(engine)
    plant = (ClutchPlant if engine == "drake" else PlanarClutch)(clutch)
    run = engage(plant, OperatingPoint(0.0, ForceProfile(force, RISE)), start).run
    times, states = run.times, run.states
    lead = states[:, OUTPUT_ANGLE] - states[:, SLIDING_ANGLE]
    speeds = states[:, OUTPUT_SPEED] - states[:, SLIDING_SPEED]
    ended = kernel.crossing(times, lead, speeds, end)
    assert ended - sleeve.fall_time(start) == pytest.approx(sleeve.slide_time(start, end), rel=0.02)
    first, last = np.searchsorted(lead, (1.2 * DEG, 6.4 * DEG))
    assert lever_between(sleeve, times, states, first, last) == pytest.approx(
        sleeve.lever, rel=0.01
    )


def lever_between(sleeve: Sleeve, times: Array, states: Array, first: int, last: int) -> float:
    """Compute the impulse of the torque over that of the axial force between two steps, m."""
    turned = sleeve.inertia * abs(states[last, SLIDING_SPEED] - states[first, SLIDING_SPEED])
    pushed = sleeve.force * (times[last] - times[first])
    gained = states[last, AXIAL_SPEED] - states[first, AXIAL_SPEED]
    return float(turned / (pushed - sleeve.mass * gained))
