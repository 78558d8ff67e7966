r"""The clutch as a Drake multibody plant.

World frame: z along the shaft, pitch plane of the output ring at z = 0. The sliding ring is turned
over about x and starts at z = travel. All dogs see the same contact while the rings stay coaxial,
so one sliding dog with mass, inertia and forces over N moves as N do; it meets the whole output
ring. Beside low dogs of either ring, as many neighbouring sliding dogs as there are slots for each
high dog have mass, inertia and forces over the number of high dogs: a high dog is met once.

An explicit scheme knows the dynamic coefficient alone, ``mu (2/pi) atan(v / stiction_velocity)``.
In ``cenic`` friction falls from the static to the dynamic coefficient about ten stiction
velocities. Drake's contact port has the first law in both schemes, so with ``cenic`` the spline's
torque comes from contact surfaces: over each triangle of area *A*

.. math:: f = A\,p\,(1 - D\,v_n)_+ \left(n - \mu(s)\,v_t/\sqrt{v_s^2 + v_t^2}\right), \quad
   \mu(s) = \mu_d + (\mu_s - \mu_d)\,\tfrac12 \left(1 - g(s - 10)/g(10)\right), \quad
   s = v_t/v_s, \; g(x) = x/\sqrt{1 + x^2}.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np
from pydrake import geometry as geo
from pydrake.common import MemoryFile
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody import tree
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, CoulombFriction
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, EventStatus, LeafSystem
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from dogshape.sim import kernel
from dogshape.sim.elementwise import Array
from dogshape.sim.kernel_layout import (
    ACTUATOR_DISPLACEMENT,
    ACTUATOR_SPEED,
    AXIAL_SPEED,
    DISPLACEMENT,
    INPUT_SIDE_ANGLE,
    INPUT_SIDE_SPEED,
    OUTPUT_ANGLE,
    OUTPUT_SIDE_ANGLE,
    OUTPUT_SIDE_SPEED,
    OUTPUT_SPEED,
    SHAFTED_STATE_SIZE,
    SLIDING_ANGLE,
    SLIDING_SPEED,
    SPINDLE_TRAVEL,
    STATE_SIZE,
)
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, ContactSet, OperatingPoint, require_engine
from dogshape.sim.shift.conclusion import Run, failure_of, states_held
from dogshape.sim.shift.drive import TorqueCourse, TorquePiece
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import compliant_dog, pressure_apex, rigid_dog, ring_of, to_obj, to_vtk
from dogshape.sim.shift.pair import RingDogs

# Joints that forces act on.
ACTUATOR = "actuator"  #: along the shaft
SHIFT = "shift"  #: of the sliding ring along the shaft
SLIDING = "sliding"  #: of the sliding ring about the shaft
OUTPUT = "output"  #: of the output ring about the shaft
#: Joint of the side that a shaft joins to each ring.
SIDE_JOINTS = {SLIDING: "input_side", OUTPUT: "output_side"}
#: Columns of displacement or angle and of its rate in a state, by joint.
COLUMNS = {
    OUTPUT: (OUTPUT_ANGLE, OUTPUT_SPEED),
    SHIFT: (DISPLACEMENT, AXIAL_SPEED),
    SLIDING: (SLIDING_ANGLE, SLIDING_SPEED),
    ACTUATOR: (ACTUATOR_DISPLACEMENT, ACTUATOR_SPEED),
    SIDE_JOINTS[SLIDING]: (INPUT_SIDE_ANGLE, INPUT_SIDE_SPEED),
    SIDE_JOINTS[OUTPUT]: (OUTPUT_SIDE_ANGLE, OUTPUT_SIDE_SPEED),
}
#: Joint that each joint moves with where the clutch has none for it.
CARRIERS = {ACTUATOR: SHIFT, SIDE_JOINTS[SLIDING]: SLIDING, SIDE_JOINTS[OUTPUT]: OUTPUT}
AXIS = np.array([0.0, 0.0, 1.0])
STOP_WIDTH_M = 10e-3  #: of the plate behind the sliding ring
STOP_THICKNESS_M = 5e-3  #: of plate and wall
STOP_DISSIPATION_S_M = 100.0


class _Forces(LeafSystem):  # type: ignore[misc]
    """Forces of the actuators from shift force, drive, state and the contact's torque."""

    def __init__(self, clutch_plant: ClutchPlant) -> None:
        super().__init__()
        plant = clutch_plant.plant
        clutch = clutch_plant.clutch
        rings = clutch.rings
        mechanism = clutch.mechanism
        radius = clutch.dog.mean_radius
        self._mechanism = mechanism
        self._share = clutch_plant.share
        self._order = clutch_plant.order
        self._drive = clutch.drive if clutch.drive.has_torques else None
        #: of ``ACTUATOR_NUMBERS``, set before a shift; None for a force over time
        self.actuator_numbers: np.record | None = None
        if clutch.actuator is not None:
            self.DeclareContinuousState(STATE_SIZE - SHAFTED_STATE_SIZE)
        self._shafts = clutch.shafts
        self._contact_set = clutch.contact
        self._linkage = mechanism.linkage(rings.mass) if mechanism.has_linkage else None
        self._spline_share = mechanism.spline_share(rings.mass, radius, rings.sliding_inertia)
        self._sliding_velocity_index = plant.GetJointByName(SLIDING).velocity_start()
        actuators = plant.GetJointActuatorIndices()
        self._joints = [plant.get_joint_actuator(i).joint().name() for i in actuators]
        places = plant.num_positions()
        self.push = self.DeclareVectorInputPort("push", BasicVector(1))
        self.state = self.DeclareVectorInputPort("state", BasicVector(2 * places))
        # Start of the piece, torques and slopes of ``TorquePiece``.
        self.torques = self.DeclareVectorInputPort("torques", BasicVector(5))
        ring = plant.GetBodyByName("sliding_ring")
        self._dogs = frozenset(plant.GetCollisionGeometriesForBody(ring))
        self.contact = None
        self.shapes = None
        if mechanism.spline_friction > 0.0 and not self._shafts[0].side_inertia:
            if clutch.solver.scheme == "cenic":
                self.shapes = self.DeclareAbstractInputPort("shapes", Value[geo.QueryObject]())
            else:
                self.contact = self.DeclareVectorInputPort("contact", BasicVector(places))
        self.DeclareVectorOutputPort("forces", BasicVector(len(self._joints)), self._calculate)

    def _calculate(self, context: Context, output: BasicVector) -> None:
        state = self.state.Eval(context)[self._order].tolist()
        push = self._push(context, state)
        ring_push = push
        mechanism = self._mechanism
        share = self._share
        displacement = state[DISPLACEMENT]
        speed = state[AXIAL_SPEED]
        input_shaft, output_shaft = self._shafts
        spline_torque = self._contact_torque(context, state) * (self._spline_share * share)
        sliding_drive, output_drive = self._drive_torques(context, state)
        spline_torque -= (1.0 - self._spline_share) * sliding_drive
        forces = dict.fromkeys(self._joints, 0.0)
        for (ring, side), shaft in zip(SIDE_JOINTS.items(), self._shafts, strict=True):
            if not shaft.side_inertia:
                continue
            ring_angle, ring_speed = COLUMNS[ring]
            side_angle, side_speed = COLUMNS[side]
            lead = state[side_angle] - state[ring_angle]
            shaft_torque = shaft.torque(lead, state[side_speed] - state[ring_speed])
            forces[ring] += shaft_torque / share
            forces[side] -= shaft_torque / share
            if ring == SLIDING:  # the shaft drives the ring through the spline
                spline_torque = shaft_torque
        if self._linkage is not None:
            stretch = state[ACTUATOR_DISPLACEMENT] - displacement
            rate = state[ACTUATOR_SPEED] - speed
            ring_push = mechanism.pull(stretch, rate, *self._linkage) / share
            forces[ACTUATOR] = push - ring_push
        resistance = mechanism.resistance(displacement, speed, spline_torque)
        forces[SHIFT] = ring_push - resistance / share
        sliding_joint = SIDE_JOINTS[SLIDING] if input_shaft.side_inertia else SLIDING
        drag = mechanism.drag(state[INPUT_SIDE_SPEED])
        forces[sliding_joint] -= (drag - sliding_drive) / share
        if self._drive:
            output_joint = SIDE_JOINTS[OUTPUT] if output_shaft.side_inertia else OUTPUT
            forces[output_joint] += output_drive / share
        output.SetFromVector([forces[name] for name in self._joints])

    def _actuator_arguments(self, context: Context, state: list[float]) -> list[float]:
        """List time, travel and speed of the fork, and own states, for the actuator's law."""
        travel, speed = state[DISPLACEMENT], state[AXIAL_SPEED]
        if self._linkage is not None:
            travel, speed = state[ACTUATOR_DISPLACEMENT], state[ACTUATOR_SPEED]
        own_states = context.get_continuous_state_vector().CopyToVector().tolist()
        return [context.get_time(), travel, speed, *own_states]

    def _push(self, context: Context, state: list[float]) -> float:
        """Compute the share of the shift force on the modelled dogs, N."""
        if self.actuator_numbers is None:
            return float(self.push.Eval(context)[0])
        arguments = self._actuator_arguments(context, state)
        return float(kernel.actuator_force(*arguments, self.actuator_numbers)) / self._share

    def DoCalcTimeDerivatives(self, context: Context, derivatives: Any) -> None:
        """Write the rates of the actuator's own states, which Drake asks for by this name."""
        if self.actuator_numbers is None:
            return
        state = self.state.Eval(context)[self._order].tolist()
        arguments = self._actuator_arguments(context, state)
        rates = kernel.actuator_rates(*arguments, self.actuator_numbers)
        derivatives.get_mutable_vector().SetFromVector(list(rates))

    def _contact_torque(self, context: Context, state: list[float]) -> float:
        """Compute the contact's torque on one modelled dog, N m; 0 where the spline has no use."""
        if self.shapes is not None:
            surfaces = self.shapes.Eval(context).ComputeContactSurfaces(
                geo.HydroelasticContactRepresentation.kTriangle
            )
            turn = state[SLIDING_SPEED] - state[OUTPUT_SPEED]
            return ring_torque(surfaces, self._dogs, turn, state[AXIAL_SPEED], self._contact_set)
        if self.contact is not None:
            return float(self.contact.Eval(context)[self._sliding_velocity_index])
        return 0.0

    def _drive_torques(self, context: Context, state: list[float]) -> tuple[float, float]:
        """Compute the torques of the drive on sliding and output side, N m."""
        if self._drive is None:
            return 0.0, 0.0
        start, sliding, output, *slopes = self.torques.Eval(context).tolist()
        piece = TorquePiece(start, start, (sliding, output), (slopes[0], slopes[1]))
        table = piece.at(context.get_time())
        partner = self._drive.partner_torques(state[INPUT_SIDE_SPEED], state[OUTPUT_SIDE_SPEED])
        return table[0] + partner[0], table[1] + partner[1]


def ring_torque(
    surfaces: Sequence[geo.ContactSurface],
    dogs: AbstractSet[geo.GeometryId],
    turn: float,
    speed: float,
    contact: ContactSet,
) -> float:
    """Compute the torque of contact surfaces on the sliding ring by the law of ``cenic``, N m.

    ``surfaces``, in triangles, are of the dogs and of the stop, ``dogs`` the geometries of the
    sliding ring; ``turn`` is sliding less output speed, rad/s, ``speed`` along the shaft, m/s.
    """
    torque = 0.0
    stiction = contact.stiction_velocity
    static = contact.static_friction
    dynamic = contact.dynamic_friction
    for surface in surfaces:
        if surface.id_M() not in dogs and surface.id_N() not in dogs:
            continue  # the stop behind the ring
        mesh = surface.tri_mesh_W()
        field = surface.tri_e_MN()
        faces = range(mesh.num_elements())
        x, y, _ = np.array([mesh.element_centroid(face) for face in faces]).T
        sense = 1.0 if surface.id_M() in dogs else -1.0
        normal = sense * np.array([mesh.face_normal(face) for face in faces])
        load = np.array([mesh.area(f) * field.Evaluate(f, _CENTROID) for f in faces])
        velocity = np.column_stack([-turn * y, turn * x, np.full(len(x), -speed)])
        opening_speed = np.sum(velocity * normal, axis=1)
        slip = velocity - opening_speed[:, None] * normal
        load *= np.maximum(1.0 - contact.dissipation * opening_speed, 0.0)
        ratio = np.linalg.norm(slip, axis=1) / stiction
        beyond_fall = ratio - 10.0
        fall = beyond_fall / np.sqrt(1.0 + beyond_fall * beyond_fall)
        fall = fall * math.hypot(1.0, 10.0) / 10.0
        coefficient = dynamic + 0.5 * (static - dynamic) * (1.0 - fall)
        friction = coefficient / (stiction * np.sqrt(1.0 + ratio * ratio))
        force = load[:, None] * (normal - friction[:, None] * slip)
        torque += float(np.sum(x * force[:, 1] - y * force[:, 0]))
    return torque


_CENTROID = np.full(3, 1.0 / 3.0)  # of a triangle, in barycentric coordinates


class ClutchPlant:
    """A diagram of the clutch that can be shifted again and again.

    Plants cannot be pickled: ship the clutch and build in the worker.
    """

    def __init__(self, clutch: Clutch) -> None:
        require_engine(clutch.contact, "drake")
        self.clutch = clutch
        all_dogs = clutch.solver.all_dogs
        #: number of high dogs that touch by a modelled one
        self.share = 1 if all_dogs else clutch.pair.touching_count
        builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        self._add_output_ring()
        self._add_stop(self._add_sliding_ring())
        if clutch.mechanism.has_linkage:
            mass = clutch.mechanism.actuator_mass(clutch.rings.mass) / self.share
            shape = tree.UnitInertia.SolidSphere(0.01)
            self._add_body(ACTUATOR, mass, shape, tree.PrismaticJoint, actuator="actuator_force")
        for name, shaft in zip(SIDE_JOINTS.values(), clutch.shafts, strict=True):
            if shaft.side_inertia:
                inertia = shaft.side_inertia / self.share
                shape = tree.UnitInertia(0.5, 0.5, 1.0)
                self._add_body(name, inertia, shape, tree.RevoluteJoint, actuator=f"{name}_torque")
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        self.plant.set_contact_model(ContactModel.kHydroelastic)
        self.plant.set_stiction_tolerance(clutch.contact.stiction_velocity)
        self.plant.Finalize()
        # Places in Drake's state of each of our columns, and of those that move by themselves.
        self._columns: dict[int, int] = {}
        order = np.zeros(SHAFTED_STATE_SIZE, dtype=int)
        rates = self.plant.num_positions()
        for name, (place, rate) in COLUMNS.items():
            moves = self.plant.HasJointNamed(name)
            joint = self.plant.GetJointByName(name if moves else CARRIERS[name])
            order[place] = joint.position_start()
            order[rate] = rates + joint.velocity_start()
            if moves:
                self._columns[place] = joint.position_start()
                self._columns[rate] = rates + joint.velocity_start()
        self.order = order.tolist()
        self._force = builder.AddSystem(TrajectorySource(_trajectory(ForceProfile(1.0, 1.0), 1)))
        self._forces: _Forces | None = None
        if clutch.has_forces:
            self._forces = self._add_forces(builder)
        else:
            builder.Connect(self._force.get_output_port(), self.plant.get_actuation_input_port())
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)

    def start(self, point: OperatingPoint, relative_angle: float) -> Simulator:
        """Set time, state and force for a shift and return its simulator.

        ``relative_angle`` (rad) is the output ring's lead over the position in
        which dogs face dogs; it grows with the mismatch. The integrator is
        configured again, or its step size would carry over. Where friction alone holds the
        sliding ring at first, the run begins when it lets go, after the states ``held``.
        """
        solver = self.clutch.solver
        config = SimulatorConfig(
            integration_scheme=solver.scheme,
            accuracy=solver.accuracy,
            max_step_size=solver.max_step,
            use_error_control=True,
        )
        ApplySimulatorConfig(config, self.simulator)
        self._force.UpdateTrajectory(_trajectory(point.profile, self.share))
        self.held = states_held(self.clutch, point, relative_angle)
        times, states = self.held
        self.context.SetTime(float(times[-1]))
        values = np.zeros(2 * self.plant.num_positions())
        for column, place in self._columns.items():
            values[place] = states[-1, column]
        self.plant.SetPositionsAndVelocities(self.plant_context, values)
        numbers = self.clutch.shift_numbers(point.profile)
        if self._forces is not None and self.clutch.actuator is not None:
            self._forces.actuator_numbers = numbers.actuator
            own_context = self._forces.GetMyMutableContextFromRoot(self.context)
            own_context.SetContinuousState(states[-1, SPINDLE_TRAVEL:])
        self.simulator.Initialize()
        return self.simulator

    def run(self, point: OperatingPoint, angle: float) -> Run:
        """Integrate up to the end of the travel or the time-out; the monitor records every step."""
        simulator = self.start(point, angle)
        clutch = self.clutch
        numbers = clutch.shift_numbers(point.profile)
        course = TorqueCourse(clutch.drive, clutch.timeout) if clutch.drive.has_torques else None
        # Columns of ring and actuator, until they have made the travel.
        under_way = {DISPLACEMENT}
        if clutch.mechanism.has_linkage:
            under_way.add(ACTUATOR_DISPLACEMENT)
        held_times, held_states = self.held
        times = held_times[:-1].tolist()
        states = [*held_states[:-1]]
        blocked = False
        failure = ""
        look_state = np.full(STATE_SIZE, np.nan)
        next_look = kernel.STILL_WINDOW_S
        deadline = time.monotonic() + clutch.solver.time_limit

        def record(context: Context) -> EventStatus | None:
            """Record a step; end the run at the end of the travel, held rings or a failure."""
            nonlocal blocked, failure, look_state, next_look
            step_time = context.get_time()
            state = self.state()
            times.append(step_time)
            states.append(state)
            arrived = {column for column in under_way if state[column] >= clutch.shift_travel}
            under_way.difference_update(arrived)
            if under_way and len(times) > 1:
                failure = failure_of(clutch, step_time, state, len(times), deadline)
            if course is not None and not course.settled(step_time):
                look_state = np.full(STATE_SIZE, np.nan)
                next_look = step_time + kernel.STILL_WINDOW_S
            if under_way and not failure and step_time >= next_look:
                blocked = kernel.stands_still(
                    step_time,
                    look_state,
                    state,
                    remaining=clutch.timeout - step_time,
                    numbers=numbers,
                    knots=point.profile.knots,
                )
                look_state = state
                next_look = step_time + kernel.STILL_WINDOW_S
            if blocked or failure or not under_way:
                return EventStatus.ReachedTermination(self.plant, "ended")
            return None

        simulator.set_monitor(record)
        try:
            record(self.context)
            pause = self.context.get_time()
            while pause < clutch.timeout and under_way and not blocked and not failure:
                pause = clutch.timeout if course is None else self._set_torques(course, pause)
                simulator.AdvanceTo(pause)
        except RuntimeError as error:
            if len(times) < 2:
                raise  # not a step was made: the model is wrong, not the motion
            failure = str(error).split("\n")[0]
        finally:
            simulator.clear_monitor()
        is_later = np.diff(times, prepend=-1.0) > 0.0
        return Run(
            np.array(times)[is_later],
            np.array(states)[is_later],
            blocked,
            failure=failure,
            evaluations=simulator.get_integrator().get_num_derivative_evaluations(),
            torques=None if course is None else course.knots,
        )

    def _set_torques(self, course: TorqueCourse, start: float) -> float:
        """Set the torques of the drive from ``start`` on; return the end of the piece, s."""
        assert self._forces is not None
        state = self.state()
        piece = course.piece(start, float(state[OUTPUT_SIDE_SPEED] - state[INPUT_SIDE_SPEED]))
        context = self._forces.GetMyMutableContextFromRoot(self.context)
        self._forces.torques.FixValue(context, [piece.start, *piece.torques, *piece.slopes])
        return piece.end

    def state(self) -> Array:
        """Read the state in the columns of ``sim.kernel_layout``, (14,)."""
        state = np.zeros(STATE_SIZE)
        motion = self.plant.GetPositionsAndVelocities(self.plant_context)
        state[:SHAFTED_STATE_SIZE] = motion[self.order]
        if self._forces is not None and self.clutch.actuator is not None:
            own_context = self._forces.GetMyContextFromRoot(self.context)
            state[SPINDLE_TRAVEL:] = own_context.get_continuous_state_vector().CopyToVector()
        return state

    def _add_body(self, name: str, mass: float, shape: Any, joint_type: Any, actuator: str) -> None:
        """Add a body of a mass in kg, or an inertia in kg m2, on a joint with an actuator."""
        plant = self.plant
        axis = -AXIS if name == ACTUATOR else AXIS
        body = plant.AddRigidBody(name, tree.SpatialInertia(mass, np.zeros(3), shape))
        joint = joint_type(name, plant.world_frame(), body.body_frame(), axis, damping=0.0)
        plant.AddJointActuator(actuator, plant.AddJoint(joint))

    def _add_forces(self, builder: DiagramBuilder) -> _Forces:
        plant = self.plant
        forces = builder.AddSystem(_Forces(self))
        builder.Connect(self._force.get_output_port(), forces.push)
        builder.Connect(plant.get_state_output_port(), forces.state)
        if forces.shapes is not None:
            builder.Connect(self._scene_graph.get_query_output_port(), forces.shapes)
        elif forces.contact is not None:
            world = plant.GetBodyByName("carriage").model_instance()
            builder.Connect(plant.get_generalized_contact_forces_output_port(world), forces.contact)
        builder.Connect(forces.get_output_port(), plant.get_actuation_input_port())
        return forces

    def _add_output_ring(self) -> None:
        clutch = self.clutch
        plant = self.plant
        _, shaft = clutch.shafts
        inertia = shaft.ring_inertia / self.share
        body = plant.AddRigidBody("output_ring", _ring_inertia(1.0 / self.share, inertia))
        joint = plant.AddJoint(
            tree.RevoluteJoint(OUTPUT, plant.world_frame(), body.body_frame(), AXIS, damping=0.0)
        )
        if shaft.side_inertia or clutch.drive.has_torques:
            plant.AddJointActuator("output_torque", joint)
        dogs = clutch.pair.output_dogs
        if clutch.pair.low is None and not clutch.solver.all_dogs:
            # A single sliding dog meets the next dogs of a full ring, whichever they are.
            dogs = RingDogs(clutch.pair.output)
        for dog, places in _placed_dogs(dogs, clutch.dog.count):
            if clutch.pair.is_sliding_rigid:
                self._add_compliant_dogs(body, RigidTransform(), dog, places)
            else:
                self._add_rigid_dogs(body, RigidTransform(), dog, places)

    def _add_stop(self, carriage: tree.RigidBody) -> None:
        """Set a stop behind the sliding ring: a plate on its carriage meets a fixed one.

        Without friction, as stiff as all faces on each other and with a
        dissipation that leaves next to no restitution. The plates see only each
        other, wherever they stand.
        """
        dog = self.clutch.dog
        plant = self.plant
        width = STOP_WIDTH_M
        thickness = STOP_THICKNESS_M
        count = self.clutch.pair.touching_count
        face_area = count * dog.tip_width * dog.radial_width / self.share
        modulus = self.clutch.contact.stiffness * face_area / width**2 * (0.5 * thickness)
        plate_properties = geo.ProximityProperties()
        wall_properties = geo.ProximityProperties()
        geo.AddCompliantHydroelasticProperties(width, modulus, plate_properties)
        geo.AddRigidHydroelasticProperties(width, wall_properties)
        for properties in (plate_properties, wall_properties):
            geo.AddContactMaterial(
                dissipation=STOP_DISSIPATION_S_M,
                friction=CoulombFriction(),
                properties=properties,
            )
        plate_z = 10.0 * dog.height + 0.5 * thickness  # behind the dogs
        wall_z = plate_z + thickness + self.clutch.rebound
        dogs = [
            *plant.GetCollisionGeometriesForBody(plant.GetBodyByName("output_ring")),
            *plant.GetCollisionGeometriesForBody(plant.GetBodyByName("sliding_ring")),
        ]
        plate = plant.RegisterCollisionGeometry(
            carriage,
            RigidTransform([0, 0, plate_z]),
            geo.Box(width, width, thickness),
            "plate",
            plate_properties,
        )
        wall = plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform([0, 0, wall_z]),
            geo.Box(2 * width, 2 * width, thickness),
            "stop",
            wall_properties,
        )
        collision_filter = geo.CollisionFilterDeclaration().ExcludeBetween(
            geo.GeometrySet(dogs), geo.GeometrySet([plate, wall])
        )
        self._scene_graph.collision_filter_manager().Apply(collision_filter)

    def _add_sliding_ring(self) -> tree.RigidBody:
        """Add both bodies of the sliding ring and return the one that does not turn.

        Its frame starts at the origin of the world, one travel from its dogs.
        """
        clutch = self.clutch
        plant = self.plant
        # Only the sum of both masses acts; Drake wants one at either joint.
        mass = 0.5 * clutch.mechanism.sleeve_mass(clutch.rings.mass) / self.share
        inertia = clutch.shafts[0].ring_inertia / self.share
        carriage = plant.AddRigidBody("carriage", _ring_inertia(mass, inertia))
        body = plant.AddRigidBody("sliding_ring", _ring_inertia(mass, inertia))
        damping = clutch.mechanism.damping / self.share
        world = plant.world_frame()
        frame = carriage.body_frame()
        joint = plant.AddJoint(tree.PrismaticJoint(SHIFT, world, frame, -AXIS, damping=damping))
        turning = plant.AddJoint(
            tree.RevoluteJoint(SLIDING, frame, body.body_frame(), AXIS, damping=0.0)
        )
        plant.AddJointActuator("shift_force", joint)
        if clutch.has_forces:
            plant.AddJointActuator("drag_torque", turning)
        start = [0.0, 0.0, clutch.pair.travel]
        turned_over = RigidTransform(RotationMatrix.MakeXRotation(np.pi), start)
        pair = clutch.pair
        pitches = 1
        if clutch.solver.all_dogs:
            pitches = clutch.dog.count
        elif pair.low is not None:
            pitches = pair.slots_per_dog
        for dog, places in _placed_dogs(pair.sliding_dogs, pitches):
            if pair.is_sliding_rigid:
                self._add_rigid_dogs(body, turned_over, dog, places)
            else:
                self._add_compliant_dogs(body, turned_over, dog, places)
        return carriage

    def _add_rigid_dogs(
        self, body: tree.RigidBody, pose: RigidTransform, dog: Dog, places: Sequence[int]
    ) -> None:
        """Add rigid dogs of a ring at ``places``, in pitches, to its body as one surface."""
        properties = geo.ProximityProperties()
        geo.AddRigidHydroelasticProperties(properties)
        self._add_contact(properties)
        shape = _in_memory(to_obj(ring_of(dog, rigid_dog(dog), places)), ".obj")
        name = f"rigid_dogs_{places[0]}"
        self.plant.RegisterCollisionGeometry(body, pose, shape, name, properties)

    def _add_compliant_dogs(
        self, body: tree.RigidBody, pose: RigidTransform, dog: Dog, places: Sequence[int]
    ) -> None:
        """Add compliant dogs of a ring at ``places``, in pitches, to its body, a volume each."""
        properties = geo.ProximityProperties()
        modulus = self.clutch.contact.stiffness * pressure_apex(dog)[1]
        geo.AddCompliantHydroelasticProperties(1.0, modulus, properties)
        self._add_contact(properties)
        shape = _in_memory(to_vtk(compliant_dog(dog)), ".vtk")
        for place in places:
            turn = RotationMatrix.MakeZRotation(place * dog.pitch_angle)
            dog_pose = pose @ RigidTransform(turn, [0.0, 0.0, 0.0])
            self.plant.RegisterCollisionGeometry(body, dog_pose, shape, f"dog_{place}", properties)

    def _add_contact(self, properties: geo.ProximityProperties) -> None:
        """Add dissipation and friction of the dogs to the properties of a geometry."""
        contact = self.clutch.contact
        friction = CoulombFriction(contact.static_friction, contact.dynamic_friction)
        geo.AddContactMaterial(
            dissipation=contact.dissipation, friction=friction, properties=properties
        )


def _placed_dogs(dogs: RingDogs, pitches: int) -> Iterator[tuple[Dog, list[int]]]:
    """Yield the dogs of ``pitches`` of a ring with the pitches at which they stand."""
    yield dogs.dog, list(range(0, pitches, dogs.pitches))
    low_places = [place for place in range(pitches) if place % dogs.pitches]
    if dogs.low is not None and low_places:
        yield dogs.low, low_places


def _in_memory(text: str, extension: str) -> geo.Mesh:
    return geo.Mesh(geo.InMemoryMesh(mesh_file=MemoryFile(text.encode(), extension, "dog")), 1.0)


def _ring_inertia(mass: float, polar: float) -> tree.SpatialInertia:
    """Build the inertia of a thin ring; only mass and polar inertia act here."""
    unit = polar / mass
    return tree.SpatialInertia(mass, np.zeros(3), tree.UnitInertia(0.5 * unit, 0.5 * unit, unit))


def _trajectory(profile: ForceProfile, share: int) -> PiecewisePolynomial:
    times, values, slopes = profile.knots
    return PiecewisePolynomial.CubicHermite(times, values[None] / share, slopes[None] / share)
