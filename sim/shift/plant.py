"""The clutch as a Drake multibody plant.

World frame: z along the shaft, median plane of the output ring at z = 0. The
sliding ring is turned over about x and starts at z = travel; its prismatic
joint runs towards the output ring, its revolute joint turns about z.

All dogs see the same contact as long as the rings stay coaxial. So one dog on
the sliding ring, with mass, inertia and force divided by N, moves as N dogs
do; it meets the whole output ring, whose body carries 1/N of its inertia.

Friction, as Drake's modes treat it: with an explicit scheme the continuous
plant knows the dynamic coefficient alone and the law
``mu (2/pi) atan(v / stiction_velocity)``; with ``cenic`` it falls from the static to
the dynamic one about ten stiction velocities. ``solver_for`` chooses by the set.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    CollisionFilterDeclaration,
    GeometrySet,
    InMemoryMesh,
    ProximityProperties,
)
from pydrake.geometry import Mesh as MeshShape
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
)
from pydrake.multibody.tree import (
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.linkage import (
    ACTUATOR,
    BEHIND,
    OUTPUT,
    SHIFT,
    SLIDING,
    add_actuator,
    add_behind,
    add_forces,
    shafts_of,
)
from dogshape.sim.shift.mechanism import Shaft
from dogshape.sim.shift.mesh import compliant_dog, pressure_apex, rigid_dog, ring_of, to_obj, to_vtk
from dogshape.sim.shift.release import release

_AXIS = np.array([0.0, 0.0, 1.0])


class ClutchPlant:
    """A diagram of the clutch that can be shifted again and again.

    Plants cannot be pickled: ship the clutch and build in the worker.
    """

    def __init__(self, clutch: Clutch) -> None:
        self.clutch = clutch
        self.share = clutch.dog.count  # dogs that one modelled dog stands for
        if clutch.solver.all_dogs:
            self.share = 1
        builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        self._add_output_ring()
        self._add_stop(self._add_sliding_ring())
        if clutch.mechanism.has_linkage:
            add_actuator(self.plant, clutch, self.share, -_AXIS)
        shafts = shafts_of(clutch)
        for ring, shaft in shafts.items():
            add_behind(self.plant, ring, shaft, self.share, _AXIS)
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        self.plant.set_contact_model(ContactModel.kHydroelastic)
        self.plant.set_stiction_tolerance(clutch.contact.stiction_velocity)
        self.plant.Finalize()
        self._columns = self._columns_of(shafts)
        self.state_size = len(self._order)  #: numbers of a state
        self._force = builder.AddSystem(TrajectorySource(_trajectory(ForceProfile(1.0, 1.0), 1)))
        if clutch.mechanism.has_forces:
            scene = self.plant, self._scene_graph
            add_forces(builder, scene, clutch, self.share, self._force)
        else:
            port = self.plant.get_actuation_input_port()
            builder.Connect(self._force.get_output_port(), port)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)

    def start(self, point: OperatingPoint, relative_angle: float) -> Simulator:
        """Set time, state and force for a shift and return its simulator.

        ``relative_angle`` (rad) is the output ring's lead over the position in
        which dogs face dogs; it grows with the mismatch. The integrator is
        configured again, or its step size would carry over. Where friction alone holds the
        sliding ring at first, the run begins when it lets go; ``held`` has what was before.
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
        sliding = self.clutch.rings.initial_speed
        output = sliding + point.mismatch
        self.held = release(self.clutch, point.profile)
        begin, way, speed = (
            float(series[-1])
            for series in (self.held.time, self.held.displacement, self.held.speed)
        )
        turned, led = sliding * begin, relative_angle + output * begin
        state = [led, 0.0, turned, output, 0.0, sliding, way, speed, turned, sliding, led, output]
        self.context.SetTime(begin)
        values = np.zeros(2 * self.plant.num_positions())
        for column, place in self._columns.items():
            values[place] = state[column]
        self.plant.SetPositionsAndVelocities(self.plant_context, values)
        self.simulator.Initialize()
        return self.simulator

    def state(self) -> NDArray[np.float64]:
        """Return (output angle, displacement, sliding angle) and their rates, (6,), SI.

        With a linkage displacement and speed of the actuator follow, (8,), with shafts that give
        way angles and rates of what is behind the sliding and the output ring, (12,); what is not
        there moves as the ring does.
        """
        state: NDArray[np.float64] = self.plant.GetPositionsAndVelocities(self.plant_context)
        return state[self._order]

    def _columns_of(self, shafts: Mapping[str, Shaft]) -> dict[int, int]:
        """Find where Drake's state has each column of ours; sets the order of reading, too."""
        rings = ((OUTPUT, 0, 3), (SHIFT, 1, 4), (SLIDING, 2, 5))
        more = [(ACTUATOR, 6, 7)] if self.clutch.mechanism.has_linkage else []
        columns, behind = ((SLIDING, 8, 9), (OUTPUT, 10, 11)), self.plant.num_positions()
        more += [(BEHIND[ring], place, rate) for ring, place, rate in columns if ring in shafts]
        found = {}
        for name, place, rate in (*rings, *more):
            joint = self.plant.GetJointByName(name)
            found[place], found[rate] = joint.position_start(), behind + joint.velocity_start()
        size = 12 if shafts else 6 + 2 * self.clutch.mechanism.has_linkage
        same = {6: 1, 7: 4, 8: 2, 9: 5, 10: 0, 11: 3}
        self._order = [found.get(k, found[same.get(k, k)]) for k in range(size)]
        return found

    def _add_output_ring(self) -> None:
        clutch, plant = self.clutch, self.plant
        shaft = shafts_of(clutch).get(OUTPUT)
        inertia = (clutch.rings.output_inertia if shaft is None else shaft.near) / self.share
        body = plant.AddRigidBody("output_ring", _ring_inertia(1.0 / self.share, inertia))
        joint = plant.AddJoint(
            RevoluteJoint(OUTPUT, plant.world_frame(), body.body_frame(), _AXIS, damping=0.0)
        )
        if OUTPUT in shafts_of(clutch):
            plant.AddJointActuator("output_torque", joint)
        surface = ring_of(clutch.dog, rigid_dog(clutch.dog))
        properties = ProximityProperties()
        AddRigidHydroelasticProperties(properties)
        self._add_contact(properties)
        shape = _in_memory(to_obj(surface), ".obj")
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "output_dogs", properties)

    def _add_stop(self, carriage: RigidBody) -> None:
        """Set a stop behind the sliding ring: a plate on its carriage meets a fixed one.

        Without friction, as stiff as all faces on each other and with a
        dissipation that leaves next to no restitution. The plates see only each
        other, wherever they stand.
        """
        dog, plant = self.clutch.dog, self.plant
        side, thick = 10e-3, 5e-3
        behind = 10.0 * dog.height
        faces = dog.count * dog.tip_width * dog.radial_width / self.share
        plate, fixed = ProximityProperties(), ProximityProperties()
        modulus = self.clutch.contact.stiffness * faces / side**2 * (0.5 * thick)
        AddCompliantHydroelasticProperties(side, modulus, plate)
        AddRigidHydroelasticProperties(side, fixed)
        for properties in (plate, fixed):
            AddContactMaterial(dissipation=100.0, friction=CoulombFriction(), properties=properties)
        middle = behind + 0.5 * thick
        far = middle + thick + self.clutch.rebound
        shape, wall = Box(side, side, thick), Box(2 * side, 2 * side, thick)
        dogs = GeometrySet(
            [
                geometry
                for name in ("output_ring", "sliding_ring")
                for geometry in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))
            ]
        )
        moving = plant.RegisterCollisionGeometry(
            carriage, RigidTransform(np.array([0, 0, middle])), shape, "plate", plate
        )
        still = plant.RegisterCollisionGeometry(
            plant.world_body(), RigidTransform(np.array([0, 0, far])), wall, "stop", fixed
        )
        apart = CollisionFilterDeclaration().ExcludeBetween(dogs, GeometrySet([moving, still]))
        self._scene_graph.collision_filter_manager().Apply(apart)

    def _add_sliding_ring(self) -> RigidBody:
        """Add both bodies of the sliding ring and return the one that does not turn.

        Its frame starts at the origin of the world, one travel from its dogs.
        """
        clutch, plant = self.clutch, self.plant
        # Only the sum of both masses acts; Drake wants one at either joint.
        mass = 0.5 * clutch.mechanism.sleeve_mass(clutch.rings.mass) / self.share
        shaft = shafts_of(clutch).get(SLIDING)
        inertia = (clutch.rings.sliding_inertia if shaft is None else shaft.near) / self.share
        carriage = plant.AddRigidBody("carriage", _ring_inertia(mass, inertia))
        body = plant.AddRigidBody("sliding_ring", _ring_inertia(mass, inertia))
        start = RigidTransform([0.0, 0.0, clutch.dog.travel])
        damping = clutch.mechanism.damping / self.share
        world, frame = plant.world_frame(), carriage.body_frame()
        joint = plant.AddJoint(PrismaticJoint(SHIFT, world, frame, -_AXIS, damping=damping))
        turning = plant.AddJoint(
            RevoluteJoint(SLIDING, frame, body.body_frame(), _AXIS, damping=0.0)
        )
        plant.AddJointActuator("shift_force", joint)
        if clutch.mechanism.has_forces:
            plant.AddJointActuator("drag_torque", turning)
        one = compliant_dog(clutch.dog)
        properties = ProximityProperties()
        modulus = clutch.contact.stiffness * pressure_apex(clutch.dog)[1]
        AddCompliantHydroelasticProperties(1.0, modulus, properties)
        self._add_contact(properties)
        turned_over = RigidTransform(RotationMatrix.MakeXRotation(np.pi), start.translation())
        count = clutch.dog.count if clutch.solver.all_dogs else 1
        for index in range(count):
            turn = RotationMatrix.MakeZRotation(index * clutch.dog.pitch_angle)
            pose = turned_over @ RigidTransform(turn, [0.0, 0.0, 0.0])
            shape = _in_memory(to_vtk(one), ".vtk")
            plant.RegisterCollisionGeometry(body, pose, shape, f"dog_{index}", properties)
        return carriage

    def _add_contact(self, properties: ProximityProperties) -> None:
        contact = self.clutch.contact
        friction = CoulombFriction(contact.static_friction, contact.dynamic_friction)
        AddContactMaterial(
            dissipation=contact.dissipation, friction=friction, properties=properties
        )


def _in_memory(text: str, extension: str) -> MeshShape:
    return MeshShape(InMemoryMesh(mesh_file=MemoryFile(text.encode(), extension, "dog")), 1.0)


def _ring_inertia(mass: float, polar: float) -> SpatialInertia:
    """Return the inertia of a thin ring; only mass and polar inertia act here."""
    unit = polar / mass
    return SpatialInertia(mass, np.zeros(3), UnitInertia(0.5 * unit, 0.5 * unit, unit))


def _trajectory(profile: ForceProfile, share: int) -> PiecewisePolynomial:
    """Return the shift force of one modelled dog; Drake holds the last value beyond."""
    times, values, slopes = profile.knots()
    return PiecewisePolynomial.CubicHermite(times, values[None] / share, slopes[None] / share)
