r"""The mechanism of a clutch in its Drake plant: bodies of actuator and shafts, and the forces.

Everything is that of one modelled dog: masses and forces over the number of dogs it stands for.

Friction of the spline needs the contact's torque on the sliding ring. Drake's contact port
evaluates the law of its continuous plant, with the dynamic coefficient alone. ``cenic`` moves the
rings by another one, so with that scheme the torque comes from Drake's contact surfaces: over each
triangle with area *A*, normal *n* into the ring and pressure *p* at the centroid

.. math:: f = A\,p\,(1 - D\,v_n)_+ \left(n - \mu(s)\,v_t/\sqrt{v_s^2 + v_t^2}\right), \qquad
   \mu(s) = \mu_d + (\mu_s - \mu_d)\,\tfrac12 \left(1 - g(s - 10)/g(10)\right)

with the ring's velocity against the other one, :math:`v_n = v \cdot n`, the slip :math:`v_t`,
:math:`s = v_t/v_s` and :math:`g(x) = x/\sqrt{1 + x^2}`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import (
    ContactSurface,
    GeometryId,
    HydroelasticContactRepresentation,
    QueryObject,
    SceneGraph,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem, System

from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.contact import ContactSet
from dogshape.sim.shift.mechanism import Shaft

Floats = NDArray[np.float64]

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
    builder: DiagramBuilder,
    scene: tuple[MultibodyPlant, SceneGraph],
    clutch: Clutch,
    share: int,
    source: System,
) -> None:
    """Connect the forces of the mechanism; ``source`` is that of the shift force."""
    plant, scene_graph = scene
    forces = builder.AddSystem(_Forces(plant, clutch, share))
    builder.Connect(source.get_output_port(), forces.push)
    builder.Connect(plant.get_state_output_port(), forces.state)
    if forces.shapes is not None:
        builder.Connect(scene_graph.get_query_output_port(), forces.shapes)
    elif forces.contact is not None:
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
        self._contact_set = clutch.contact
        ring = plant.GetBodyByName("sliding_ring")
        self._dogs = frozenset(plant.GetCollisionGeometriesForBody(ring))
        self._ring_rate, self._output_rate = (
            self._places(plant, name)[1] for name in (SLIDING, OUTPUT)
        )
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
        self.shapes = None
        if mechanism.spline_friction > 0.0 and mechanism.ring_inertia == 0.0:
            if clutch.solver.scheme == "cenic":
                self.shapes = self.DeclareAbstractInputPort("shapes", Value[QueryObject]())
            else:
                self.contact = self.DeclareVectorInputPort("contact", BasicVector(places))
        self.DeclareVectorOutputPort("forces", BasicVector(len(order)), self._calculate)

    @staticmethod
    def _places(plant: MultibodyPlant, joint: str) -> tuple[int, int]:
        """Find the places of a joint's angle and of its rate in the state."""
        found = plant.GetJointByName(joint)
        return found.position_start(), plant.num_positions() + found.velocity_start()

    def _contact_torque(self, context: Context, state: list[float]) -> float:
        """Compute the contact's torque on one modelled sliding dog, N m; 0 where none is needed."""
        if self.shapes is not None:
            turn = state[self._ring_rate] - state[self._output_rate]
            surfaces = self.shapes.Eval(context).ComputeContactSurfaces(
                HydroelasticContactRepresentation.kTriangle
            )
            speed = state[self._rate]
            return ring_torque(surfaces, self._dogs, turn, speed, self._contact_set)
        if self.contact is not None:
            return float(self.contact.Eval(context)[self._torque])
        return 0.0

    def _calculate(self, context: Context, output: BasicVector) -> None:
        state = self.state.Eval(context).tolist()
        push = float(self.push.Eval(context)[0])
        torque = self._contact_torque(context, state) * self._spline
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


def ring_torque(
    surfaces: Sequence[ContactSurface],
    dogs: AbstractSet[GeometryId],
    turn: float,
    speed: float,
    contact: ContactSet,
) -> float:
    """Compute the torque of contact surfaces on the sliding ring by the law of ``cenic``, N m.

    Parameters
    ----------
    surfaces : of the dogs and of the stop, as triangles.
    dogs : geometries of the sliding ring.
    turn : sliding less output speed, rad/s.
    speed : of the sliding ring into engagement, m/s.
    contact : coefficients, stiction velocity and dissipation.
    """
    torque = 0.0
    for surface in surfaces:
        if surface.id_M() not in dogs and surface.id_N() not in dogs:
            continue  # the stop behind the ring
        mesh, field = surface.tri_mesh_W(), surface.tri_e_MN()
        faces = range(mesh.num_elements())
        x, y, _ = np.array([mesh.element_centroid(face) for face in faces]).T
        into = 1.0 if surface.id_M() in dogs else -1.0
        normal = into * np.array([mesh.face_normal(face) for face in faces])
        load = np.array([mesh.area(f) * field.Evaluate(f, _MIDDLE) for f in faces])
        velocity = np.column_stack([-turn * y, turn * x, np.full(len(x), -speed)])
        parting = np.sum(velocity * normal, axis=1)
        across = velocity - parting[:, None] * normal
        load *= np.maximum(1.0 - contact.dissipation * parting, 0.0)
        rub = _friction_over_slip(np.linalg.norm(across, axis=1), contact)
        force = load[:, None] * (normal - rub[:, None] * across)
        torque += float(np.sum(x * force[:, 1] - y * force[:, 0]))
    return torque


_MIDDLE = np.full(3, 1.0 / 3.0)  # of a triangle, in barycentric coordinates


def _friction_over_slip(slip: Floats, contact: ContactSet) -> Floats:
    """Compute the coefficient of friction by ``cenic`` over the slip, s/m; slip in m/s, (n,)."""
    static, dynamic = contact.static_friction, contact.dynamic_friction
    ratio = slip / contact.stiction_velocity
    late = ratio - 10.0
    fall = late / np.sqrt(1.0 + late * late) * math.hypot(1.0, 10.0) / 10.0
    coefficient = dynamic + 0.5 * (static - dynamic) * (1.0 - fall)
    found: Floats = coefficient / (contact.stiction_velocity * np.sqrt(1.0 + ratio * ratio))
    return found
