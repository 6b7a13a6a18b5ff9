"""Drake's discrete `MultibodyPlant`: compliant contact solved implicitly."""

from functools import partial

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    GeometrySet,
    HalfSpace,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from comparison.mujoco_rover import HALF_WIDTH
from comparison.peers.base import LeftOut, Variant, bodies, held, rotation_of
from comparison.peers.grid import corners, triangles, wavefront
from comparison.scene import Array, Phase, RoverScene
from rover_gym import HeightField

GROUND = 500.0  # m, edge of the box that is the plane: a half-space with many spheres beside it crashed
#: A sphere's pressure field: tetrahedra of this share of its radius, and a modulus.
TETRAHEDRON, MODULUS = 0.1, 1e8  # 1, Pa
#: Registering prisms takes time with the square of their number: these take ten seconds.
MOST_PRISMS = 2000
DEPTH = 1.0  # m, of a prism


def material(friction: float, stiffness: float | None, dissipation: float) -> ProximityProperties:
    """Of point contact."""
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=dissipation,
        point_stiffness=stiffness,
        friction=CoulombFriction(friction, friction),
        properties=properties,
    )
    return properties


def hydroelastic(friction: float, radius: float | None = None) -> ProximityProperties:
    """Of hydroelastic contact: a compliant sphere, or rigid ground. Dissipation is 0, as it would resist rolling."""
    properties = material(friction, None, 0.0)
    if radius is None:
        AddRigidHydroelasticProperties(properties)
    else:
        AddCompliantHydroelasticProperties(TETRAHEDRON * radius, MODULUS, properties)
    return properties


def add_plane(plant: MultibodyPlant, normal: Array, properties: ProximityProperties, *, is_hydroelastic: bool) -> None:
    """The plane through the origin: a half-space, or in point contact a large box."""
    turn = RotationMatrix.MakeFromOneVector(normal, axis_index=2)
    pose, shape = RigidTransform(turn, -5.0 * normal), Box(GROUND, GROUND, 10.0)
    if is_hydroelastic:
        pose, shape = RigidTransform(turn, np.zeros(3)), HalfSpace()
    plant.RegisterCollisionGeometry(plant.world_body(), pose, shape, "ground", properties)


def add_map(
    plant: MultibodyPlant, field: HeightField, properties: ProximityProperties, *, is_hydroelastic: bool
) -> None:
    """A map as one mesh in hydroelastic contact; in point contact, where a mesh counts as its hull, as prisms."""
    places, faces, world = corners(field), triangles(field), plant.world_body()
    if is_hydroelastic:
        file = MemoryFile(wavefront(places, faces.tolist()), ".obj", "map")
        plant.RegisterCollisionGeometry(
            world, RigidTransform(), Mesh(InMemoryMesh(mesh_file=file)), "ground", properties
        )
        return
    if len(faces) > MOST_PRISMS:
        raise LeftOut(f"{len(faces)} prisms")
    sides = [(0, 1, 2), (5, 4, 3), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)]
    for k, face in enumerate(faces):
        top = places[face]
        centre = top.mean(axis=0)
        text = wavefront(np.concatenate([top, top - [0.0, DEPTH, 0.0]]) - centre, sides)
        prism = Convex(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "prism")))
        plant.RegisterCollisionGeometry(world, RigidTransform(centre), prism, f"prism{k}", properties)


def add_body(
    plant: MultibodyPlant, name: str, mass: float, inertia: Array, shape: Shape, properties: ProximityProperties
) -> RigidBody:
    """A free body about its mass centre, from its (3,) principal moments."""
    moments = RotationalInertia(*inertia.tolist())
    body = plant.AddRigidBody(name, SpatialInertia.MakeFromCentralInertia(mass, np.zeros(3), moments))
    plant.RegisterCollisionGeometry(body, RigidTransform(), shape, name, properties)
    return body


class DrakePlant:
    """A `MultibodyPlant` that steps: discrete with an approximation, else continuous."""

    def __init__(
        self,
        gravity: tuple[float, float, float],
        time_step: float,
        approximation: DiscreteContactApproximation | None,
        *,
        is_hydroelastic: bool = False,
    ) -> None:
        self.h, self.steps, self.builder = time_step, 0, DiagramBuilder()
        self.plant, self.graph = AddMultibodyPlantSceneGraph(self.builder, time_step if approximation else 0.0)
        self.plant.set_contact_model(ContactModel.kHydroelastic if is_hydroelastic else ContactModel.kPoint)
        if approximation:
            self.plant.set_discrete_contact_approximation(approximation)
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(gravity))

    def finish(self) -> None:
        """After all bodies are there: makes simulator and context."""
        if not self.plant.is_finalized():
            self.plant.Finalize()
        self.simulator = Simulator(self.builder.Build())
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())

    def advance(self, steps: int) -> None:
        self.steps += steps
        self.simulator.AdvanceTo(self.steps * self.h)


class DrakeRunner(DrakePlant):
    """A discrete plant behind the common interface."""

    def __init__(
        self,
        scene: RoverScene,
        time_step: float,
        *,
        approximation: DiscreteContactApproximation,
        stiffness: float | None,
        dissipation: float = 50.0,
        is_hydroelastic: bool = False,
    ) -> None:
        super().__init__(scene.gravity, time_step, approximation, is_hydroelastic=is_hydroelastic)
        plant = self.plant
        properties = of_ground = material(scene.friction, stiffness, dissipation)
        if is_hydroelastic:
            of_ground = hydroelastic(scene.friction)
        world = plant.world_body()
        if scene.normal is not None:
            n = np.array(scene.normal) / np.linalg.norm(scene.normal)
            add_plane(plant, n, of_ground, is_hydroelastic=is_hydroelastic)
        if scene.heights is not None:
            add_map(plant, scene.heights, of_ground, is_hydroelastic=is_hydroelastic)
        for k, (x, y, z, r) in enumerate(scene.spheres):
            plant.RegisterCollisionGeometry(world, RigidTransform([x, y, z]), Sphere(r), f"rock{k}", properties)
        self.bodies = bodies(scene.machine)
        solids, self.joints, self.actuators = [], {}, []
        for i, body in enumerate(self.bodies):
            inertia = SpatialInertia.MakeFromCentralInertia(
                body.mass, body.centre, RotationalInertia(*(float(v) for v in body.inertia))
            )
            solid = plant.AddRigidBody(body.name, inertia)
            solids.append(solid)
            if body.parent >= 0:
                parent = solids[body.parent]
                frame = plant.AddFrame(
                    FixedOffsetFrame(f"{body.name}_carrier", parent.body_frame(), RigidTransform(body.position))
                )
                joint = plant.AddJoint(RevoluteJoint(body.name, frame, solid.body_frame(), body.axis, 0.0))
                self.joints[i] = joint
            if body.wheel >= 0:
                shape = Cylinder(body.radius, 2.0 * HALF_WIDTH) if scene.thin_wheels else Sphere(body.radius)
                own = hydroelastic(scene.friction, body.radius) if is_hydroelastic else properties
                plant.RegisterCollisionGeometry(solid, RigidTransform(), shape, f"tyre_{body.name}", own)
            if held(scene, body) or body.wheel >= 0:
                actuator = plant.AddJointActuator(body.name, self.joints[i])
                if held(scene, body):
                    actuator.set_controller_gains(PdControllerGains(p=body.hold[0], d=body.hold[1]))
                self.actuators.append((i, actuator))
        plant.Finalize()
        rover = GeometrySet([g for s in solids for g in plant.GetCollisionGeometriesForBody(s)])
        self.graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(rover))
        self.finish()
        self.trunk = solids[0]
        pose = RigidTransform(RotationMatrix(rotation_of(scene.q)), scene.q[:3])
        plant.SetFreeBodyPose(self.context, self.trunk, pose)
        for i, joint in self.joints.items():
            joint.set_angle(self.context, scene.q[5 + i])
        self.instance = self.trunk.model_instance()
        self.held = [(k, i) for k, (i, _) in enumerate(self.actuators) if held(scene, self.bodies[i])]
        self.only_held = {i: k for k, (_, i) in enumerate(self.held)}
        self.start = {i: scene.q[5 + i] for _, i in self.held}
        self.command(Phase(0.0))
        self.simulator.Initialize()

    def command(self, phase: Phase) -> None:
        torques = np.zeros(len(self.actuators))
        desired = np.zeros(self.plant.get_desired_state_input_port(self.instance).size())
        place = {i: k for k, i in self.held} if len(desired) == 2 * len(self.actuators) else self.only_held
        for k, (i, _) in enumerate(self.actuators):
            body = self.bodies[i]
            if body.wheel >= 0:
                torques[k] = body.drive_sign * phase.torques[body.wheel]
        for _, i in self.held:
            body = self.bodies[i]
            desired[place[i]] = phase.steering[body.steers] if body.steers >= 0 else self.start[i]
        self.plant.get_actuation_input_port(self.instance).FixValue(self.context, torques)
        self.plant.get_desired_state_input_port(self.instance).FixValue(self.context, desired)

    def position(self) -> Array:
        return np.array(self.plant.EvalBodyPoseInWorld(self.context, self.trunk).translation())

    def rotation(self) -> Array:
        return np.array(self.plant.EvalBodyPoseInWorld(self.context, self.trunk).rotation().matrix())

    def speed(self) -> float:
        velocity = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.trunk)
        return float(np.linalg.norm(velocity.translational()))


VARIANTS = (
    Variant(
        "Drake",
        "lagged, stiff",
        partial(DrakeRunner, approximation=DiscreteContactApproximation.kLagged, stiffness=1e8),
        "discrete plant, contact approximation lagged, point stiffness 1e8 N/m, dissipation 50 s/m",
        "contacts are stiff springs; regularised friction creeps below 1e-4 m/s",
    ),
    Variant(
        "Drake",
        "SAP, stiff",
        partial(DrakeRunner, approximation=DiscreteContactApproximation.kSap, stiffness=1e8),
        "discrete plant, contact approximation SAP, point stiffness 1e8 N/m",
        "convex friction: a sliding contact lifts off by h mu u_T",
    ),
)
