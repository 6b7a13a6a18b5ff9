"""MuJoCo's height field: under each cell two prisms, which a body meets one by one; at most 50 contacts a pair."""

from functools import partial

import mujoco
import numpy as np

from comparison.peers.base import Variant
from comparison.peers.mujoco_engine import MuJoCoRunner, model_on
from comparison.scene import Array
from comparison.surfaces.scene import BallScene, G

#: As stiff as MuJoCo allows, in steps; and its best settings for friction and convex shapes.
STIFF = 2.0
BEST = 'cone="elliptic" impratio="100"><flag multiccd="enable"/></option>'


class MuJoCoBall:
    """`mj_step`."""

    def __init__(self, scene: BallScene, time_step: float, *, is_stiff: bool) -> None:
        plane = "" if scene.field is not None else '<geom type="plane" size="0 0 1" zaxis="0 1 0"/>'
        centre = " ".join(repr(float(x)) for x in scene.centre)
        ball = f'<freejoint/><geom type="sphere" size="{scene.radius!r}" mass="{scene.mass!r}"/>'
        text = (
            f'<mujoco><option timestep="{time_step!r}" gravity="0 {-G} 0" {BEST if is_stiff else "/>"}'
            f'<default><geom friction="{scene.friction!r} 0 0"/></default>'
            f'<worldbody>{plane}<body pos="{centre}">{ball}</body></worldbody></mujoco>'
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


BALLS = {
    ("MuJoCo", "defaults"): partial(MuJoCoBall, is_stiff=False),
    ("MuJoCo", "stiff, solref 2 h"): partial(MuJoCoBall, is_stiff=True),
}
ROVERS = (
    Variant("MuJoCo", "defaults", partial(MuJoCoRunner, integrator="implicitfast"), "", ""),
    Variant(
        "MuJoCo",
        "stiff, solref 2 h",
        partial(MuJoCoRunner, integrator="discrete", cone="elliptic", impratio=100.0, solref_steps=STIFF),
        "",
        "",
    ),
)
