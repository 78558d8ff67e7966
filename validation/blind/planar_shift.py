"""Stand of a blind check in the compiled engine, with a contact of its own.

It shares mechanism and geometry with the simulation and differs in the contact as two honest
engines do: stiffness, dissipation and stiction velocity of the truth change mean times by some
percent. So it asks for the diagnosis with a model error, and not for the models of the effects;
MuJoCo (``validation.blind.mujoco_shift``) asks for both. It makes no ripple, no high dog and no
force in stages.
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
from dogshape.validation.blind.mujoco_shift import DETENT_WIDTH, SPLINE_PLACE, Draw, Shift
from dogshape.validation.blind.stand import Point, Stand, Truth


class PlanarEngine:
    """A stand with its truth, ready to shift."""

    def __init__(self, stand: Stand, truth: Truth | None = None) -> None:
        self.stand, self.truth = stand, truth or Truth()
        if self.truth.ripple or self.truth.high_dog or self.truth.stage_time:
            raise InputError(
                "the compiled engine has no ripple, no high dog and no force in stages; take the "
                "engine mujoco"
            )
        self._plant = PlanarClutch(clutch_of(stand, self.truth).with_engine("planar"))

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate one shift; ``keep`` keeps its motion."""
        truth, true = self.truth, self.truth.given(point, draw.fade)
        asked = OperatingPoint(true.mismatch, ForceProfile(true.force, true.rise, lag=truth.lag))
        found, late = engage(self._plant, asked, draw.angle), truth.delay + draw.late
        ahead = truth.linkage and truth.sensor == "actuator"
        time, motion = found.actuator_time if ahead else found.shift_time, None
        ended = None if time is None else float(time) + late
        if keep:
            seen = found.trace
            ways = seen.actuator_displacement if ahead else seen.displacement, seen.displacement
            speeds = seen.sliding_speed, seen.output_speed, seen.axial_speed
            motion = np.column_stack([seen.time + late, *ways, *speeds])
        return Shift(None if ended is None or ended > self.stand.timeout else ended, motion)


def clutch_of(stand: Stand, truth: Truth) -> Clutch:
    """Build the clutch with its truth, mechanisms as those of the effects of the list."""
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
    static, dynamic = truth.static_friction, truth.dynamic_friction
    contact = replace(
        contact_set("adams2019"),
        name="blind",
        static_friction=stand.static_friction if static is None else static,
        dynamic_friction=stand.dynamic_friction if dynamic is None else dynamic,
        stiction_velocity=truth.stiction * stand.stiction_speed,
        stiffness=truth.stiffness,
        dissipation=truth.dissipation,
    )
    alike = (
        *("added_mass", "friction", "damping", "detent", "detent_position", "spline_friction"),
        *("drag_torque", "compliance", "free_play"),
    )
    mechanism = Mechanism(
        **{name: getattr(truth, name) for name in alike},
        detent_width=DETENT_WIDTH,
        spline_radius=SPLINE_PLACE * stand.inner_radius,
    )
    solver = solver_for(contact)
    return Clutch(dog, rings, contact, solver, stand.timeout, stand.seated, mechanism=mechanism)
