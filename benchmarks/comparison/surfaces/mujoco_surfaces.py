"""MuJoCo's height field: under each cell two prisms, which a body meets one by one; at most 50 contacts a pair."""

from functools import partial

import mujoco
import numpy as np

from comparison.mujoco_rover import text_of
from comparison.peers.base import Variant
from comparison.peers.mujoco_engine import MuJoCoRunner, model_on
from comparison.scene import Array
from comparison.surfaces.scene import BodyScene, G

#: As stiff as MuJoCo allows, in steps; and its best settings for friction and convex shapes.
STIFF = 2.0
BEST = 'cone="elliptic" impratio="100"><flag multiccd="enable"/></option>'


class MuJoCoBody:
    """`mj_step`."""

    def __init__(self, scene: BodyScene, time_step: float, *, is_stiff: bool) -> None:
        plane = "" if scene.field is not None else '<geom type="plane" size="0 0 1" zaxis="0 1 0"/>'
        shape = f'type="sphere" size="{scene.radius!r}"'
        if scene.half is not None:
            shape = f'type="box" size="{text_of(scene.half)}"'
        body = f'<freejoint/><geom {shape} mass="{scene.mass!r}"/>'
        place = f'pos="{text_of(scene.centre)}" euler="0 {scene.heading!r} 0"'
        text = (
            '<mujoco><compiler angle="radian"/><size memory="100M"/>'
            f'<option timestep="{time_step!r}" gravity="0 {-G} 0" {BEST if is_stiff else "/>"}'
            f'<default><geom friction="{scene.friction!r} 0 0"/></default>'
            f"<worldbody>{plane}<body {place}>{body}</body></worldbody></mujoco>"
        )
        self.model = model_on(text, scene.field, STIFF * time_step if is_stiff else None)
        self.data = mujoco.MjData(self.model)
        self.velocity = np.concatenate([scene.velocity, scene.spin])

    def launch(self, centre: Array) -> None:
        self.data.qpos[:] = [*centre, 1.0, 0.0, 0.0, 0.0]
        self.data.qvel[:] = self.velocity

    def advance(self, steps: int) -> None:
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[Array, Array]:
        return self.data.qpos[:3].copy(), self.data.qvel[:3].copy()

    def contacts(self) -> int:
        return int(self.data.ncon)


BODIES = {
    ("MuJoCo", "defaults"): partial(MuJoCoBody, is_stiff=False),
    ("MuJoCo", "stiff, solref 2 h"): partial(MuJoCoBody, is_stiff=True),
}
ELLIPTIC = {"integrator": "discrete", "cone": "elliptic", "impratio": 100.0}
ROVERS = (
    Variant("MuJoCo", "defaults", partial(MuJoCoRunner, integrator="implicitfast")),
    Variant("MuJoCo", "stiff, solref 2 h", partial(MuJoCoRunner, solref_steps=STIFF, **ELLIPTIC)),
)
