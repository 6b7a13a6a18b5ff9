"""Drake, which has no height field: prisms in point contact, or one mesh in hydroelastic contact."""

from functools import partial

import numpy as np
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, DiscreteContactApproximation
from pydrake.multibody.tree import RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from comparison.peers.base import Variant
from comparison.peers.drake import DrakeRunner, add_map, add_plane, hydroelastic, material
from comparison.scene import Array
from comparison.surfaces.scene import BodyScene, G

LAGGED = DiscreteContactApproximation.kLagged
STIFFNESS, DISSIPATION = 1e8, 50.0  # N/m, s/m
FINE = 1.0  # m, radius of a ball whose tetrahedra are as large as a box needs them


class DrakeBody:
    """A discrete plant with the approximation "lagged"."""

    def __init__(self, scene: BodyScene, time_step: float, *, is_hydroelastic: bool) -> None:
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, time_step)
        plant = self.plant
        plant.set_contact_model(ContactModel.kHydroelastic if is_hydroelastic else ContactModel.kPoint)
        plant.set_discrete_contact_approximation(LAGGED)
        plant.mutable_gravity_field().set_gravity_vector(np.array([0.0, -G, 0.0]))
        of_body = of_ground = material(scene.friction, STIFFNESS, DISSIPATION)
        if is_hydroelastic:
            of_body, of_ground = hydroelastic(scene.friction, scene.radius or FINE), hydroelastic(scene.friction)
        if scene.field is None:
            add_plane(plant, np.array([0.0, 1.0, 0.0]), of_ground, is_hydroelastic=is_hydroelastic)
        else:
            add_map(plant, scene.field, of_ground, is_hydroelastic=is_hydroelastic)
        inertia = RotationalInertia(*scene.inertia.tolist())
        shape = Sphere(scene.radius) if scene.half is None else Box(*(2.0 * scene.half))
        self.body = plant.AddRigidBody("body", SpatialInertia.MakeFromCentralInertia(scene.mass, np.zeros(3), inertia))
        plant.RegisterCollisionGeometry(self.body, RigidTransform(), shape, "body", of_body)
        plant.Finalize()
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        pose = RigidTransform(RotationMatrix.MakeYRotation(scene.heading), scene.centre)
        plant.SetFreeBodyPose(self.context, self.body, pose)
        self.simulator.Initialize()
        self.velocity = SpatialVelocity(scene.spin, scene.velocity)
        self.h, self.steps = time_step, 0

    def launch(self, centre: Array) -> None:
        self.plant.SetFreeBodyPose(self.context, self.body, RigidTransform(centre))
        self.plant.SetFreeBodySpatialVelocity(context=self.context, body=self.body, V_JpJc=self.velocity)

    def advance(self, steps: int) -> None:
        self.steps += steps
        self.simulator.AdvanceTo(self.steps * self.h)

    def state(self) -> tuple[Array, Array]:
        place = self.plant.EvalBodyPoseInWorld(self.context, self.body).translation()
        velocity = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.body).translational()
        return np.array(place), np.array(velocity)

    def contacts(self) -> int:
        found = self.plant.get_contact_results_output_port().Eval(self.context)
        return int(found.num_point_pair_contacts() + found.num_hydroelastic_contacts())


BODIES = {
    ("Drake", "point contact, prisms"): partial(DrakeBody, is_hydroelastic=False),
    ("Drake", "hydroelastic, mesh"): partial(DrakeBody, is_hydroelastic=True),
}
ROVERS = (
    Variant(
        "Drake",
        "point contact, prisms",
        partial(DrakeRunner, approximation=LAGGED, stiffness=STIFFNESS, dissipation=DISSIPATION),
        "",
        "",
    ),
    Variant(
        "Drake",
        "hydroelastic, mesh",
        partial(DrakeRunner, approximation=LAGGED, stiffness=None, dissipation=0.0, is_hydroelastic=True),
        "",
        "",
    ),
)
