"""Drake, which has no height field: prisms in point contact, or one mesh in hydroelastic contact."""

from functools import partial

import numpy as np
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, DiscreteContactApproximation
from pydrake.multibody.tree import RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from comparison.peers.base import Variant
from comparison.peers.drake import DrakeRunner, add_map, add_plane, hydroelastic, material
from comparison.scene import Array
from comparison.surfaces.scene import BallScene, G

LAGGED = DiscreteContactApproximation.kLagged
STIFFNESS, DISSIPATION = 1e8, 50.0  # N/m, s/m


class DrakeBall:
    """A discrete plant with the approximation "lagged"."""

    def __init__(self, scene: BallScene, time_step: float, *, is_hydroelastic: bool) -> None:
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, time_step)
        plant = self.plant
        plant.set_contact_model(ContactModel.kHydroelastic if is_hydroelastic else ContactModel.kPoint)
        plant.set_discrete_contact_approximation(LAGGED)
        plant.mutable_gravity_field().set_gravity_vector(np.array([0.0, -G, 0.0]))
        of_ball = of_ground = material(scene.friction, STIFFNESS, DISSIPATION)
        if is_hydroelastic:
            of_ball, of_ground = hydroelastic(scene.friction, scene.radius), hydroelastic(scene.friction)
        if scene.field is None:
            add_plane(plant, np.array([0.0, 1.0, 0.0]), of_ground, is_hydroelastic=is_hydroelastic)
        else:
            add_map(plant, scene.field, of_ground, is_hydroelastic=is_hydroelastic)
        inertia = RotationalInertia(*[scene.inertia] * 3)
        self.ball = plant.AddRigidBody("ball", SpatialInertia.MakeFromCentralInertia(scene.mass, np.zeros(3), inertia))
        plant.RegisterCollisionGeometry(self.ball, RigidTransform(), Sphere(scene.radius), "ball", of_ball)
        plant.Finalize()
        self.simulator = Simulator(builder.Build())
        self.context = plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        plant.SetFreeBodyPose(self.context, self.ball, RigidTransform(scene.centre))
        self.simulator.Initialize()
        self.velocity = SpatialVelocity(scene.spin, scene.velocity)
        self.h, self.steps = time_step, 0

    def launch(self, centre: Array) -> None:
        self.plant.SetFreeBodyPose(self.context, self.ball, RigidTransform(centre))
        self.plant.SetFreeBodySpatialVelocity(context=self.context, body=self.ball, V_JpJc=self.velocity)

    def advance(self, steps: int) -> None:
        self.steps += steps
        self.simulator.AdvanceTo(self.steps * self.h)

    def state(self) -> tuple[Array, Array]:
        place = self.plant.EvalBodyPoseInWorld(self.context, self.ball).translation()
        velocity = self.plant.EvalBodySpatialVelocityInWorld(self.context, self.ball).translational()
        return np.array(place), np.array(velocity)


BALLS = {
    ("Drake", "point contact, prisms"): partial(DrakeBall, is_hydroelastic=False),
    ("Drake", "hydroelastic, mesh"): partial(DrakeBall, is_hydroelastic=True),
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
