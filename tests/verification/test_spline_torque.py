"""Torque behind the spline's friction, where the contact set has two coefficients.

The torque of a plant is read from the force that its mechanism puts on the ring, and is that of
all dogs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim import kernel
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint, contact_set, solver_for
from dogshape.sim.shift.conclusion import section_planes
from dogshape.sim.shift.mechanism import SMOOTH_SPEED_M_S, Mechanism, smooth_sign
from dogshape.sim.shift.pair import dog_pair
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.shift.plant import SHIFT, ClutchPlant
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG
from tests.conftest import Point

SPLINE = Mechanism(spline_friction=0.1, spline_radius=17.6e-3)
ADAMS = contact_set("adams2019")
DRY = ContactSet("dry", 0.45, 0.12, 0.02, 2e12, 5.0)


def _with(clutch: Clutch, contact: ContactSet, mechanism: Mechanism = SPLINE) -> Clutch:
    solver = solver_for(contact, mechanism)
    return replace(clutch, contact=contact, solver=solver, mechanism=mechanism)


class _Spline:
    """Plant whose spline torque can be asked at any state."""

    def __init__(self, clutch: Clutch) -> None:
        self.clutch, self.plant = clutch, ClutchPlant(clutch)
        self.plant.start(OperatingPoint(1.0, ForceProfile(469.0, 0.1)), 0.1)
        systems = self.plant.diagram.GetSystems()
        (self._forces,) = (s for s in systems if type(s).__name__ == "_Forces")
        joints = [
            self.plant.plant.get_joint_actuator(i).joint().name()
            for i in self.plant.plant.GetJointActuatorIndices()
        ]
        self._shift = joints.index(SHIFT)
        carriage = self.plant.plant.GetBodyByName("carriage").model_instance()
        self._contact = self.plant.plant.get_generalized_contact_forces_output_port(carriage)

    def at(self, angle: float, way: float, turn: float, speed: float) -> float:
        """Give the size of the torque in N m; ``turn`` is output less sliding speed, rad/s."""
        plant = self.plant
        plant.plant.SetPositions(plant.plant_context, [1.0 + angle, way, 1.0])
        plant.plant.SetVelocities(plant.plant_context, [turn, speed, 0.0])
        context = self._forces.GetMyContextFromRoot(plant.context)
        push = float(self._forces.push.Eval(context)[0])
        force = float(self._forces.get_output_port().Eval(context)[self._shift])
        held, mechanism = (push - force) * plant.share, self.clutch.mechanism
        pressed = held / float(smooth_sign(speed, SMOOTH_SPEED_M_S))
        return pressed * mechanism.spline_radius / mechanism.spline_friction

    def axial(self) -> float:
        """Give the contact's force along the shaft at that state, N."""
        return -float(self._contact.Eval(self.plant.plant_context)[1]) * self.plant.share


def _share(clutch: Clutch) -> float:
    rings = clutch.rings
    return clutch.mechanism.spline_share(rings.mass, clutch.dog.mean_radius, rings.sliding_inertia)


@pytest.mark.parametrize("contact", [ADAMS, DRY], ids=["adams2019", "dry"])
def test_flat_faces_press_the_spline_by_coulombs_law(clutch: Clutch, contact: ContactSet) -> None:
    """Closed form: |T| = mu F r; mu is static in a creep's limit, dynamic far beyond the fall."""
    flat = _with(replace(clutch, dog=replace(clutch.dog, chamfer=0.0)), contact)
    dog, spline = flat.dog, _Spline(flat)
    slow, still = 0.05 * contact.stiction_velocity, 1e-6 * contact.stiction_velocity
    for slip, coefficient in (
        (slow, contact.static_friction * slow / contact.stiction_velocity),
        (1e3 * contact.stiction_velocity, contact.dynamic_friction),
    ):
        torque = spline.at(0.0, dog.axial_gap + 1e-6, slip / dog.mean_radius, still)
        force = spline.axial()
        assert force > 10.0
        known = coefficient * force * dog.mean_radius * _share(flat)
        assert torque == pytest.approx(known, rel=8e-3)


@pytest.mark.parametrize("contact", [ADAMS, DRY], ids=["adams2019", "dry"])
@pytest.mark.parametrize("chamfer", [8.0, 0.0])
def test_engines_press_a_spline_alike(clutch: Clutch, contact: ContactSet, chamfer: float) -> None:
    """Ten random states in touch, faces and flanks, about and beyond the fall of the friction."""
    own = _with(replace(clutch, dog=replace(clutch.dog, chamfer=chamfer * DEG)), contact)
    spline, mine, dog = _Spline(own), PlanarClutch(own.with_engine("planar")), own.dog
    rng, workspace, seen = np.random.default_rng(4), kernel.clip_workspace(3), 0
    scale = 0.003 * contact.stiffness * dog.radial_width**2 * 1e-5 * dog.mean_radius
    while seen < 10:
        angle, way = rng.uniform(0, dog.pitch_angle), rng.uniform(0.98 * dog.axial_gap, dog.travel)
        if (
            not 2e-6
            < kernel.penetration(way, angle, section_planes(dog_pair(dog)), own.numbers)
            < 3e-5
        ):
            continue
        turn, speed = float(rng.normal(0.0, 15.0)), float(rng.uniform(0.02, 0.3))
        _, torque = kernel.contact(
            angle, dog.travel - way, turn, speed, mine.surfaces, mine.law, workspace
        )
        if abs(torque) * dog.count > scale:
            expected = abs(torque) * dog.count * _share(own)
            assert spline.at(angle, way, turn, speed) == pytest.approx(expected, rel=1e-2)
            seen += 1


def test_a_loaded_spline_shifts_as_in_the_compiled_engine(clutch: Clutch, point: Point) -> None:
    """With the dynamic coefficient alone for the spline Drake's shift comes to 54.1 ms."""
    dog = replace(
        clutch.dog, chamfer=16.47 * DEG, traction=21.73 * DEG, braking=15.85 * DEG,
        height=4.192e-3, count=21,
    )  # fmt: skip
    own = _with(replace(clutch, dog=dog), ADAMS, replace(SPLINE, spline_friction=0.05))
    here = replace(point(149, 469.0), profile=ForceProfile(469.0, 0.15))
    compiled = engage(own.with_engine("planar"), here, 9.525 * DEG).shift_time
    drake = engage(own, here, 9.525 * DEG).shift_time
    assert compiled == pytest.approx(52.97e-3, rel=2e-3)
    assert drake == pytest.approx(compiled, rel=3e-3)
