"""Drake, which has no height field: prisms in point contact, or one mesh in hydroelastic contact."""

from functools import partial

import numpy as np
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import DiscreteContactApproximation

from comparison.peers.base import Variant
from comparison.peers.drake import DrakePlant, DrakeRunner, add_body, add_map, add_plane, hydroelastic, material
from comparison.scene import Array
from comparison.surfaces.scene import BodyScene, G

LAGGED = DiscreteContactApproximation.kLagged
STIFFNESS, DISSIPATION = 1e8, 50.0  # N/m, s/m
FINE = 1.0  # m, radius of a ball whose tetrahedra are as large as a box needs them


class DrakeBody(DrakePlant):
    """A discrete plant with the approximation "lagged"."""

    def __init__(self, scene: BodyScene, time_step: float, *, is_hydroelastic: bool) -> None:
        super().__init__((0.0, -G, 0.0), time_step, LAGGED, is_hydroelastic=is_hydroelastic)
        of_body = of_ground = material(scene.friction, STIFFNESS, DISSIPATION)
        if is_hydroelastic:
            of_body, of_ground = hydroelastic(scene.friction, scene.radius or FINE), hydroelastic(scene.friction)
        if scene.field is None:
            add_plane(self.plant, np.array([0.0, 1.0, 0.0]), of_ground, is_hydroelastic=is_hydroelastic)
        else:
            add_map(self.plant, scene.field, of_ground, is_hydroelastic=is_hydroelastic)
        shape = Sphere(scene.radius) if scene.half is None else Box(*(2.0 * scene.half))
        self.body = add_body(self.plant, "body", scene.mass, scene.inertia, shape, of_body)
        self.finish()
        pose = RigidTransform(RotationMatrix.MakeYRotation(scene.heading), scene.centre)
        self.plant.SetFreeBodyPose(self.context, self.body, pose)
        self.simulator.Initialize()
        self.velocity = SpatialVelocity(scene.spin, scene.velocity)

    def launch(self, centre: Array) -> None:
        self.plant.SetFreeBodyPose(self.context, self.body, RigidTransform(centre))
        self.plant.SetFreeBodySpatialVelocity(context=self.context, body=self.body, V_JpJc=self.velocity)

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
POINT = {"stiffness": STIFFNESS, "dissipation": DISSIPATION}
HYDROELASTIC = {"stiffness": None, "dissipation": 0.0, "is_hydroelastic": True}
ROVERS = (
    Variant("Drake", "point contact, prisms", partial(DrakeRunner, approximation=LAGGED, **POINT)),
    Variant("Drake", "hydroelastic, mesh", partial(DrakeRunner, approximation=LAGGED, **HYDROELASTIC)),
)
