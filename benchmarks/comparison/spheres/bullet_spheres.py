"""Bullet: rigid bodies in maximal coordinates, 50 iterations, damping and sleeping off."""

import numpy as np

from comparison.peers.bullet import new_client, set_contact
from comparison.spheres.scene import Array, FreeScene, G

#: Of the spheres in a scene with a slab: Bullet multiplies the frictions of the two that touch.
BALL = 1.0


class BulletSpheres:
    """`stepSimulation`."""

    def __init__(self, scene: FreeScene, time_step: float) -> None:
        self.client = c = new_client((0.0, -G, 0.0), time_step)
        plane = c.createMultiBody(0, c.createCollisionShape(c.GEOM_PLANE, planeNormal=[0, 1, 0]))
        shape = c.createCollisionShape(c.GEOM_SPHERE, radius=scene.radius)
        self.bodies = [
            c.createMultiBody(scene.mass, shape, basePosition=x, useMaximalCoordinates=True)
            for x in scene.centres.tolist()
        ]
        frictions = dict.fromkeys([plane, *self.bodies], 0.0)
        self.slab, self.is_pushed = scene.slab, False
        if self.slab is not None:
            box = c.createCollisionShape(c.GEOM_BOX, halfExtents=self.slab.half.tolist())
            place = self.slab.centre.tolist()
            self.bodies.append(c.createMultiBody(self.slab.mass, box, basePosition=place, useMaximalCoordinates=True))
            frictions = dict.fromkeys(self.bodies, BALL)
            frictions |= {self.bodies[-1]: self.slab.friction / BALL, plane: scene.friction * BALL / self.slab.friction}
        for body, friction in frictions.items():
            set_contact(c, body, friction, scene.restitution)

    def push(self) -> None:
        self.is_pushed = self.slab is not None

    def advance(self, steps: int) -> None:
        c = self.client
        for _ in range(steps):
            if self.is_pushed and self.slab is not None:  # a force lasts for a step
                place = c.getBasePositionAndOrientation(self.bodies[-1])[0]
                c.applyExternalForce(self.bodies[-1], -1, self.slab.push.tolist(), place, c.WORLD_FRAME)
            c.stepSimulation()

    def state(self) -> tuple[Array, Array]:
        c = self.client
        centres = [c.getBasePositionAndOrientation(body)[0] for body in self.bodies]
        return np.array(centres), np.array([c.getBaseVelocity(body)[0] for body in self.bodies])


VARIANTS = {("Bullet", "50 iterations"): BulletSpheres}
