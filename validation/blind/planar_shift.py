"""Stand of a blind check in the compiled engine, with the contact of its truth.

It shares mechanism and geometry with the simulation and differs in the contact as two honest
engines do: stiffness, dissipation and stiction velocity of the truth change mean times by some
percent. So it asks for the diagnosis with a model error, and not for the models of the effects;
MuJoCo (``validation.blind.mujoco_shift``) asks for both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Rings, contact_set, solver_for
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mechanism import Mechanism
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.validation.blind.mujoco_shift import DETENT_WIDTH, SPLINE_RADIUS_RATIO, Draw, Shift
from dogshape.validation.blind.stand import Point, Stand, Truth


class PlanarEngine:
    """Stand with its truth in the compiled engine for any number of shifts."""

    def __init__(self, stand: Stand, truth: Truth | None = None) -> None:
        self.stand = stand
        self.truth = truth or Truth()
        truth = self.truth
        only_mujoco = truth.ripple, truth.high_dog, truth.stage_time
        if any((*only_mujoco, truth.galling, truth.static_excess)):
            raise InputError(
                "the compiled engine has no ripple, no high dog, no force in stages, no galling "
                "and no friction at rest along the shaft; take the engine mujoco"
            )
        self._plant = PlanarClutch(clutch_of(stand, self.truth).with_engine("planar"))

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate a shift at a nominal point, with its motion if ``keep``."""
        truth = self.truth
        actual = truth.apply(point, draw.progress)
        profile = ForceProfile(actual.force, actual.rise, lag=truth.lag)
        result = engage(self._plant, OperatingPoint(actual.mismatch, profile), draw.angle)
        delay = truth.delay + draw.late + truth.clock_drift * draw.progress
        at_actuator = truth.linkage and truth.sensor == "actuator"
        engaged_time = result.actuator_time if at_actuator else result.shift_time
        motion = None
        if keep:
            trace = result.trace
            sensor = trace.actuator_displacement if at_actuator else trace.displacement
            motion = np.column_stack(
                [
                    *(trace.time + delay, sensor, trace.displacement),
                    *(trace.sliding_speed, trace.output_speed, trace.axial_speed),
                ]
            )
        if engaged_time is None or float(engaged_time) + delay > self.stand.timeout:
            return Shift(None, motion)
        return Shift(float(engaged_time) + delay, motion)


def clutch_of(stand: Stand, truth: Truth) -> Clutch:
    """Build the clutch with its truth, with the mechanisms of the effects of the list."""
    dog = Dog(
        count=stand.count,
        chamfer=stand.chamfer + truth.chamfer_offset,
        traction=stand.traction,
        braking=stand.braking,
        height=stand.height,
        outer_diameter=2.0 * stand.outer_radius,
        inner_diameter=2.0 * stand.inner_radius,
        axial_gap=stand.gap + truth.gap_offset,
    )
    inertia = truth.inertia_factor * stand.sliding_inertia
    rings = Rings(stand.mass, inertia, stand.output_inertia)
    static = stand.static_friction if truth.static_friction is None else truth.static_friction
    dynamic = stand.dynamic_friction if truth.dynamic_friction is None else truth.dynamic_friction
    contact = replace(
        contact_set("adams2019"),
        name="blind",
        static_friction=static,
        dynamic_friction=dynamic,
        stiction_velocity=truth.stiction * stand.stiction_speed,
        stiffness=truth.stiffness,
        dissipation=truth.dissipation,
    )
    mechanism = Mechanism(
        added_mass=truth.added_mass,
        friction=truth.friction,
        damping=truth.damping,
        detent=truth.detent,
        detent_position=truth.detent_position,
        detent_width=DETENT_WIDTH,
        spline_friction=truth.spline_friction,
        spline_radius=SPLINE_RADIUS_RATIO * stand.inner_radius,
        drag_torque=truth.drag_torque,
        compliance=truth.compliance,
        free_play=truth.free_play,
    )
    return Clutch(
        dog,
        rings,
        contact,
        solver=solver_for(contact),
        timeout=stand.timeout,
        seated_tolerance=stand.seated,
        mechanism=mechanism,
    )
