"""Bullet: its height field with its defaults, and at its best a triangle mesh with what it offers for inner edges.

`GEOM_CONCAVE_INTERNAL_EDGE` changes nothing on a height field in PyBullet 3.2.7, and little on a mesh; what helps at
small steps is a short distance at which contacts of the last step are dropped.
"""

from functools import partial

import numpy as np

from comparison.peers.base import Variant
from comparison.peers.bullet import CONTACT_THRESHOLD, BulletRunner, add_map, new_client, set_contact
from comparison.scene import Array
from comparison.surfaces.scene import BodyScene, G

SHORT = 0.001  # m


class BulletBody:
    """`stepSimulation` with 50 iterations, damping off."""

    def __init__(self, scene: BodyScene, time_step: float, *, as_mesh: bool, contact_threshold: float) -> None:
        self.client = c = new_client((0.0, -G, 0.0), time_step, contactBreakingThreshold=contact_threshold)
        if scene.field is None:
            ground = c.createMultiBody(0, c.createCollisionShape(c.GEOM_PLANE, planeNormal=[0, 1, 0]))
        else:
            ground = add_map(c, scene.field, as_mesh=as_mesh)
        if scene.half is None:
            shape = c.createCollisionShape(c.GEOM_SPHERE, radius=scene.radius)
        else:
            shape = c.createCollisionShape(c.GEOM_BOX, halfExtents=scene.half.tolist())
        place = scene.centre.tolist(), c.getQuaternionFromEuler([0.0, scene.heading, 0.0])
        self.body = c.createMultiBody(scene.mass, shape, -1, *place, useMaximalCoordinates=True)
        set_contact(c, ground, 1.0)
        set_contact(c, self.body, scene.friction)
        self.velocity, self.spin = scene.velocity.tolist(), scene.spin.tolist()

    def launch(self, centre: Array) -> None:
        self.client.resetBasePositionAndOrientation(self.body, centre.tolist(), [0.0, 0.0, 0.0, 1.0])
        self.client.resetBaseVelocity(self.body, self.velocity, self.spin)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self.client.stepSimulation()

    def state(self) -> tuple[Array, Array]:
        c = self.client
        return np.array(c.getBasePositionAndOrientation(self.body)[0]), np.array(c.getBaseVelocity(self.body)[0])

    def contacts(self) -> int:
        return len(self.client.getContactPoints(self.body))


HEIGHT_FIELD = {"as_mesh": False, "contact_threshold": CONTACT_THRESHOLD}
MESH = {"as_mesh": True, "contact_threshold": SHORT}
BODIES = {
    ("Bullet", "height field"): partial(BulletBody, **HEIGHT_FIELD),
    ("Bullet", "mesh, inner edges, 1 mm"): partial(BulletBody, **MESH),
}
ROVERS = (
    Variant("Bullet", "height field", partial(BulletRunner, iterations=50, **HEIGHT_FIELD)),
    Variant("Bullet", "mesh, inner edges, 1 mm", partial(BulletRunner, iterations=50, **MESH)),
)
