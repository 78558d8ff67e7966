"""The mechanism of a clutch in its Drake plant: bodies of actuator and shafts, and the forces.

Everything is that of one modelled dog: masses and forces over the number of dogs it stands for.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, System

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mechanism import Shaft

#: Joints that forces act on: ring and actuator along the shaft, both rings and what is behind them.
ACTUATOR, SHIFT, SLIDING, OUTPUT = "actuator", "shift", "sliding", "output"
BEHIND = {SLIDING: "input_side", OUTPUT: "output_side"}  #: joints of what is behind a ring's shaft


def add_actuator(plant: MultibodyPlant, clutch: Clutch, share: int, axis: np.ndarray) -> None:
    """Add a body that the shift force moves along ``axis``; it touches nothing."""
    mass = clutch.mechanism.actuator_mass(clutch.rings.mass) / share
    inertia = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(0.01))
    body = plant.AddRigidBody("actuator", inertia)
    joint = PrismaticJoint(ACTUATOR, plant.world_frame(), body.body_frame(), axis, damping=0.0)
    plant.AddJointActuator("actuator_force", plant.AddJoint(joint))


def shafts_of(clutch: Clutch) -> dict[str, Shaft]:
    """Return the shafts that give way, by the joint of their ring."""
    rings, mechanism = clutch.rings, clutch.mechanism
    sides = {
        SLIDING: mechanism.input_side(rings.sliding_inertia),
        OUTPUT: mechanism.output_side(rings.output_inertia),
    }
    return {joint: shaft for joint, shaft in sides.items() if shaft is not None}


def add_behind(
    plant: MultibodyPlant, ring: str, shaft: Shaft, share: int, axis: np.ndarray
) -> None:
    """Add what is behind a ring's shaft: a body that turns about ``axis`` and touches nothing."""
    unit = UnitInertia(0.5, 0.5, 1.0)
    inertia = SpatialInertia(shaft.far / share, np.zeros(3), unit)
    body = plant.AddRigidBody(BEHIND[ring], inertia)
    joint = RevoluteJoint(BEHIND[ring], plant.world_frame(), body.body_frame(), axis, damping=0.0)
    plant.AddJointActuator(f"{BEHIND[ring]}_torque", plant.AddJoint(joint))


def add_forces(
    builder: DiagramBuilder, plant: MultibodyPlant, clutch: Clutch, share: int, source: System
) -> None:
    """Connect the forces of the mechanism; ``source`` is that of the shift force."""
    forces = builder.AddSystem(_Forces(plant, clutch, share))
    builder.Connect(source.get_output_port(), forces.push)
    builder.Connect(plant.get_state_output_port(), forces.state)
    if forces.contact is not None:
        world = plant.GetBodyByName("carriage").model_instance()
        builder.Connect(plant.get_generalized_contact_forces_output_port(world), forces.contact)
    builder.Connect(forces.get_output_port(), plant.get_actuation_input_port())


class _Forces(LeafSystem):  # type: ignore[misc]
    """Forces of the actuators from the shift force, the state and the contact's torque."""

    def __init__(self, plant: MultibodyPlant, clutch: Clutch, share: int) -> None:
        super().__init__()
        rings, mechanism = clutch.rings, clutch.mechanism
        self._mechanism, self._share = mechanism, share
        self._linkage = mechanism.linkage(rings.mass) if mechanism.has_linkage else None
        radius = clutch.dog.mean_radius
        self._spline = mechanism.spline_share(rings.mass, radius, rings.sliding_inertia) * share
        places = plant.num_positions()
        joint = {n: plant.GetJointByName(n) for n in (SHIFT, SLIDING)}
        self._way, self._turn = (joint[n].position_start() for n in (SHIFT, SLIDING))
        self._rate = places + joint[SHIFT].velocity_start()
        self._dragged = BEHIND[SLIDING] if mechanism.ring_inertia > 0.0 else SLIDING
        self._spin = self._places(plant, self._dragged)[1]
        self._torque = joint[SLIDING].velocity_start()
        if self._linkage is not None:
            actuator = plant.GetJointByName(ACTUATOR)
            self._far = actuator.position_start()
            self._far_rate = places + actuator.velocity_start()
        self._shafts = [
            (ring, shaft, self._places(plant, ring), self._places(plant, BEHIND[ring]))
            for ring, shaft in shafts_of(clutch).items()
        ]
        order = [
            plant.get_joint_actuator(i).joint().name() for i in plant.GetJointActuatorIndices()
        ]
        self._slots = {name: order.index(name) for name in order}
        self.push = self.DeclareVectorInputPort("push", BasicVector(1))
        self.state = self.DeclareVectorInputPort("state", BasicVector(2 * places))
        self.contact = None
        if mechanism.spline_friction > 0.0 and mechanism.ring_inertia == 0.0:
            self.contact = self.DeclareVectorInputPort("contact", BasicVector(places))
        self.DeclareVectorOutputPort("forces", BasicVector(len(order)), self._calculate)

    @staticmethod
    def _places(plant: MultibodyPlant, joint: str) -> tuple[int, int]:
        """Find the places of a joint's angle and of its rate in the state."""
        found = plant.GetJointByName(joint)
        return found.position_start(), plant.num_positions() + found.velocity_start()

    def _calculate(self, context: Context, output: BasicVector) -> None:
        state = self.state.Eval(context).tolist()
        push = float(self.push.Eval(context)[0])
        torque = 0.0
        if self.contact is not None:
            torque = float(self.contact.Eval(context)[self._torque]) * self._spline
        mechanism, share = self._mechanism, self._share
        drive, slots = push, self._slots
        forces = [0.0] * len(slots)
        for ring, shaft, (angle, rate), (far, far_rate) in self._shafts:
            twist = shaft.torque(state[far] - state[angle], state[far_rate] - state[rate])
            forces[slots[ring]] += twist / share
            forces[slots[BEHIND[ring]]] -= twist / share
            if ring == SLIDING:
                torque = twist
        if self._linkage is not None:
            stretch = state[self._far] - state[self._way]
            rate = state[self._far_rate] - state[self._rate]
            drive = mechanism.pull(stretch, rate, *self._linkage) / share
            forces[slots[ACTUATOR]] = push - drive
        held = mechanism.resistance(state[self._way], state[self._rate], torque)
        forces[slots[SHIFT]] = drive - held / share
        forces[slots[self._dragged]] -= mechanism.drag(state[self._spin]) / share
        output.SetFromVector(forces)
