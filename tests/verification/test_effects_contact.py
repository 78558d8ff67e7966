"""Effects that act through the contact of the dogs, and what the balance says of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.mechanism import Mechanism, smooth_sign
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, RPM
from tests.conftest import Point
from tests.verification.test_impact import face_area, flat_dogs

EFFECTS = load()
PUSH = ForceProfile(469.0, 0.1766)


def _pressed(clutch: Clutch, depth: float, speed: float) -> tuple[float, float]:
    """Press face on face, sliding at 50 1/min and closing at ``speed``; return forces, N.

    Rectangular dogs that face each other: axial force against the shift and force along the
    circumference, both of one dog.
    """
    flat = flat_dogs(clutch, clutch.contact)
    dog, plant = flat.dog, ClutchPlant(flat)
    plant.start(OperatingPoint(50 * RPM, PUSH), 0.0)
    plant.plant.SetPositions(plant.plant_context, [0.0, dog.axial_gap + depth, 0.0])
    plant.plant.SetVelocities(plant.plant_context, [50 * RPM, speed, 0.0])
    body = plant.plant.GetBodyByName("carriage")
    port = plant.plant.get_generalized_contact_forces_output_port(body.model_instance())
    forces = port.Eval(plant.plant_context)
    return float(-forces[1]), float(forces[2]) / dog.mean_radius


@pytest.mark.parametrize(("static", "dynamic"), [(0.12, 0.10), (0.30, 0.25)])
def test_the_plant_sees_the_friction(setting: Setting, static: float, dynamic: float) -> None:
    values = {"static_friction": static, "dynamic_friction": dynamic}
    changed = EFFECTS["contact_friction"].apply(setting, values)
    axial, along = _pressed(changed.clutch, 5e-6, 0.0)
    # The law falls short of its coefficient by (2/pi) v_s/v; the centre of force lies off the
    # mean radius by w2/12 r2.
    assert along / axial == pytest.approx(dynamic, rel=5e-3)


def test_the_plant_sees_stiffness_and_dissipation(setting: Setting) -> None:
    """F = k A x (1 + d v)."""
    flat = flat_dogs(setting.clutch, setting.clutch.contact)
    depth, speed, area = 5e-6, 0.01, face_area(flat)
    stiff = EFFECTS["contact_stiffness"].apply(setting, {"stiffness_Pa_m": 2e12})
    assert _pressed(stiff.clutch, depth, 0.0)[0] == pytest.approx(2e12 * area * depth, rel=1e-3)
    dead = EFFECTS["contact_dissipation"].apply(stiff, {"dissipation_s_m": 60.0})
    exact = 2e12 * area * depth * (1.0 + 60.0 * speed)
    assert _pressed(dead.clutch, depth, speed)[0] == pytest.approx(exact, rel=1e-3)


def test_the_plant_sees_the_stiction_velocity(setting: Setting) -> None:
    """The force along is mu (2/pi) atan(v/v_s) of the axial one."""
    slow = setting.with_contact(stiction_velocity=0.1, dynamic_friction=0.1)
    fast = EFFECTS["contact_creep"].apply(slow, {"stiction_factor": 3.0})
    speed = 50 * RPM * slow.clutch.dog.mean_radius
    for one, stiction in ((slow, 0.1), (fast, 0.3)):
        axial, along = _pressed(one.clutch, 5e-6, 0.0)
        law = 0.1 * 2.0 / math.pi * math.atan(speed / stiction)
        assert along / axial == pytest.approx(law, rel=0.01)


@pytest.mark.parametrize("offset", [-0.3, 0.4])
def test_another_gap_is_another_free_flight(clutch: Clutch, point: Point, offset: float) -> None:
    """Dogs facing slots, hardly turning: the ring flies the whole travel."""
    still = Setting(clutch, OperatingPoint(0.1 * RPM, point(5, 469.0).profile))
    changed = EFFECTS["axial_gap"].apply(still, {"gap_offset_mm": offset})
    result = engage(ClutchPlant(changed.clutch), changed.point, 12.0 * DEG)
    way = clutch.shift_travel + offset * 1e-3
    floor = changed.point.profile.free_flight_time(way, 0.3)
    assert result.shift_time == pytest.approx(floor, rel=0.02)
    assert result.shift_time >= floor * (1.0 - 1e-4)


def test_spline_friction_is_what_the_torque_behind_the_ring_presses(clutch: Clutch) -> None:
    """m dv/dt falls by mu |T| / r, T = (J1 - m r2) dw/dt, while everything else is the same."""
    rates, coefficient, radius, speed = {}, 0.15, 0.0176, 0.2
    for mu in (0.0, coefficient):
        mechanism = Mechanism(spline_friction=mu, spline_radius=radius)
        plant = ClutchPlant(replace(clutch, mechanism=mechanism))
        plant.start(OperatingPoint(50 * RPM, PUSH), 0.0)
        plant.plant.SetPositions(plant.plant_context, [0.0, 1.605e-3, 0.0])
        plant.plant.SetVelocities(plant.plant_context, [50 * RPM, speed, 0.0])
        derivatives = plant.plant.EvalTimeDerivatives(plant.plant_context)
        rates[mu] = derivatives.CopyToVector()[3:]
    assert abs(rates[0.0][2]) > 10.0
    assert rates[coefficient][2] == pytest.approx(rates[0.0][2], rel=1e-12)
    torque = (0.01 - 0.3 * clutch.dog.mean_radius**2) * abs(rates[0.0][2])
    friction = 0.3 * (rates[0.0][1] - rates[coefficient][1])
    expected = coefficient * torque / radius * smooth_sign(speed, 1e-3)
    assert friction == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    "mechanism",
    [
        Mechanism(spline_friction=0.15, friction=20.0),
        Mechanism(compliance=4e-6, added_mass=0.3, damping=20.0),
        Mechanism(detent=60.0, detent_position=2e-3, detent_seat=4e-3, drag_torque=1.0),
    ],
    ids=["spline", "linkage", "detent"],
)
def test_the_balance_finds_the_force_of_the_contact(
    clutch: Clutch, point: Point, mechanism: Mechanism
) -> None:
    """Contact forces from the momentum of all parts against Drake's own, while faces slide."""
    plant = ClutchPlant(replace(clutch, mechanism=mechanism))
    result = engage(plant, point(10, 469.0), 0.0)
    trace, count = result.trace, clutch.dog.count
    body = plant.plant.GetBodyByName("carriage")
    port = plant.plant.get_generalized_contact_forces_output_port(body.model_instance())
    places = np.transpose([trace.relative_angle, trace.displacement, 0.0 * trace.time])
    rates = np.transpose([trace.output_speed, trace.axial_speed, trace.sliding_speed])
    if mechanism.has_linkage:
        places = np.column_stack([places, trace.actuator_displacement])
        rates = np.column_stack([rates, trace.actuator_speed])
    said = []
    for place, rate in zip(places, rates, strict=True):
        plant.plant.SetPositions(plant.plant_context, place)
        plant.plant.SetVelocities(plant.plant_context, rate)
        said.append(count * port.Eval(plant.plant_context)[[1, 2]])
    axial, torque = np.array(said).T
    slides = (trace.time > result.phases[1].start + 0.01) & (trace.time < result.phases[1].end)
    assert slides.sum() > 50
    steps = np.diff(trace.time, prepend=0.0)[slides]
    for mean, force in (
        (trace.contact_force, -axial),
        (trace.tangential_force * clutch.dog.mean_radius, torque),
    ):
        impulse = float((mean[slides] * steps).sum())
        assert impulse == pytest.approx(float((force[slides] * steps).sum()), rel=0.01)


@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_only_drag_takes_angular_momentum(clutch: Clutch, point: Point, drag: float) -> None:
    """J1 w1 + J2 w2 falls by the impulse of the drag, and friction in the spline takes none."""
    mechanism = Mechanism(spline_friction=0.2, friction=20.0, drag_torque=drag)
    rings, plant = clutch.rings, ClutchPlant(replace(clutch, mechanism=mechanism))
    trace = engage(plant, point(100, 469.0), 3 * DEG).trace
    sliding = rings.sliding_inertia * trace.sliding_speed
    momentum = sliding + rings.output_inertia * trace.output_speed
    held = drag * smooth_sign(trace.sliding_speed, 0.05)
    taken = np.concatenate([[0.0], np.cumsum(0.5 * (held[1:] + held[:-1]) * np.diff(trace.time))])
    close = 1e-6 * momentum[0] + 0.01 * abs(taken[-1])
    assert momentum[0] - momentum == pytest.approx(taken, abs=close)
    assert math.isclose(momentum[0], 0.6048 * 100 * RPM)
