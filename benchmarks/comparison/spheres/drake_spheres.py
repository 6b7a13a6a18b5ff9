"""Drake. Contacts are springs: solved implicitly in a discrete plant, integrated in a continuous one.

A discrete plant has no restitution, so the elastic scenes run in a continuous one without dissipation, whose springs
give back what they take as far as the step resolves them. The ground is a box: a half-space with 300 spheres or more
crashes Drake 1.51. Two boxes have one point of contact, so a slab stands on four small spheres at its corners.
"""

from functools import partial

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Box, CollisionFilterDeclaration, GeometrySet, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import DiscreteContactApproximation, ExternallyAppliedSpatialForce
from pydrake.systems.analysis import ApplySimulatorConfig, SimulatorConfig

from comparison.peers.base import LeftOut
from comparison.peers.drake import GROUND, DrakePlant, add_body, material as properties_of
from comparison.spheres.scene import Array, FreeScene, G

FOOT = 0.05  # m, radius of a slab's feet
#: Point stiffness, N/m. Under a slab stiffer is better; in the block 1e8 left more penetration and cost thrice as much.
STIFFNESS_OF_SLAB, STIFFNESS = 1e8, 1e6
DISSIPATION = 50.0  # s/m
#: A continuous plant's springs are as stiff as a step resolves (angular frequency times step), but no softer than this.
RESOLVED, SOFTEST = 0.3, 1e5


class DrakeSpheres(DrakePlant):
    """A `MultibodyPlant` of free bodies: discrete with an approximation, else continuous with Runge-Kutta 3."""

    def __init__(
        self, scene: FreeScene, time_step: float, *, approximation: DiscreteContactApproximation | None
    ) -> None:
        is_elastic, is_discrete = scene.restitution > 0.0, approximation is not None
        if is_elastic and is_discrete:
            raise LeftOut("a discrete plant has no restitution")
        if not is_elastic and not is_discrete:
            raise LeftOut("the continuous plant is for elastic scenes")
        slab = scene.slab
        stiffness, dissipation = STIFFNESS_OF_SLAB if slab else STIFFNESS, DISSIPATION
        if not is_discrete:
            stiffness, dissipation = max(scene.mass * (RESOLVED / time_step) ** 2, SOFTEST), 0.0
        super().__init__((0.0, -G, 0.0), time_step, approximation)
        plant = self.plant
        # Of two frictions f and g it takes 2 f g/(f + g); stiffnesses act in series.
        ground = properties_of(scene.friction, stiffness, dissipation)
        below = RigidTransform(np.array([0.0, -5.0, 0.0]))
        plant.RegisterCollisionGeometry(plant.world_body(), below, Box(GROUND, 10.0, GROUND), "ground", ground)
        material = properties_of(slab.friction if slab else scene.friction, stiffness, dissipation)
        inertia = np.full(3, 0.4 * scene.mass * scene.radius**2)
        self.bodies = [
            add_body(plant, f"sphere{k}", scene.mass, inertia, Sphere(scene.radius), material)
            for k in range(len(scene.centres))
        ]
        if slab is not None:
            body = add_body(plant, "slab", slab.mass, slab.inertia, Box(*(2.0 * slab.half)), material)
            for k, (sx, sz) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
                corner = np.array([sx * (slab.half[0] - FOOT), FOOT - slab.half[1], sz * (slab.half[2] - FOOT)])
                plant.RegisterCollisionGeometry(body, RigidTransform(corner), Sphere(FOOT), f"foot{k}", ground)
            self.bodies.append(body)
        plant.Finalize()
        if slab is not None:
            world = GeometrySet(plant.GetCollisionGeometriesForBody(plant.world_body()))
            box = GeometrySet(plant.GetCollisionGeometriesForBody(self.bodies[-1])[:1])  # not its feet
            apart = CollisionFilterDeclaration().ExcludeBetween(box, world)
            self.graph.collision_filter_manager().Apply(apart)
        self.finish()
        places = [*scene.centres, *([slab.centre] if slab else [])]
        for body, place in zip(self.bodies, places, strict=True):
            plant.SetFreeBodyPose(self.context, body, RigidTransform(place))
        self.slab = slab
        if not is_discrete:
            fixed = {"max_step_size": time_step, "use_error_control": False}
            ApplySimulatorConfig(SimulatorConfig(integration_scheme="runge_kutta3", **fixed), self.simulator)
        self.simulator.Initialize()

    def push(self) -> None:
        if self.slab is not None:
            force = ExternallyAppliedSpatialForce()
            force.body_index = self.bodies[-1].index()
            force.F_Bq_W = SpatialForce(np.zeros(3), self.slab.push)
            port = self.plant.get_applied_spatial_force_input_port()
            port.FixValue(self.context, Value[list[ExternallyAppliedSpatialForce]]([force]))

    def state(self) -> tuple[Array, Array]:
        at = self.context
        poses = [self.plant.EvalBodyPoseInWorld(at, body).translation() for body in self.bodies]
        velocities = [self.plant.EvalBodySpatialVelocityInWorld(at, body).translational() for body in self.bodies]
        return np.array(poses), np.array(velocities)


VARIANTS = {
    ("Drake", "lagged"): partial(DrakeSpheres, approximation=DiscreteContactApproximation.kLagged),
    ("Drake", "SAP"): partial(DrakeSpheres, approximation=DiscreteContactApproximation.kSap),
    ("Drake", "continuous, Runge-Kutta 3"): partial(DrakeSpheres, approximation=None),
}
