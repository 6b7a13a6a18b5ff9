"""MuJoCo. Its contacts are springs and dampers; there is no coefficient of restitution."""

from functools import partial

import mujoco

from comparison.mujoco_rover import text_of
from comparison.peers.base import LeftOut
from comparison.spheres.scene import Array, FreeScene, G


class MuJoCoSpheres:
    """`mj_step`. Of two frictions it takes the larger one, unless one geometry has priority: the spheres have."""

    def __init__(self, scene: FreeScene, time_step: float, *, is_stiff: bool) -> None:
        if scene.restitution > 0.0:
            raise LeftOut("MuJoCo has no coefficient of restitution")
        slab = scene.slab
        condim = 1 if slab is None else 3
        solref = f'solref="{2.0 * time_step!r} 1"' if is_stiff else ""
        cone = 'cone="elliptic" impratio="100"' if is_stiff else ""
        on_slab = f'friction="{slab.friction!r}" priority="1"' if slab else ""
        sphere = f'<freejoint/><geom type="sphere" size="{scene.radius!r}" mass="{scene.mass!r}" {on_slab}/>'
        bodies = "".join(f'<body pos="{text_of(x)}">{sphere}</body>' for x in scene.centres)
        if slab is not None:
            box = f'<freejoint/><geom type="box" size="{text_of(slab.half)}" mass="{slab.mass!r}"/>'
            bodies += f'<body pos="{text_of(slab.centre)}">{box}</body>'
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{time_step!r}" gravity="0 {-G} 0" {cone}/><size memory="200M"/>'
            f'<default><geom condim="{condim}" friction="{scene.friction!r}" {solref}/></default><worldbody>'
            f'<geom type="plane" size="0 0 1" zaxis="0 1 0"/>{bodies}</worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        self.slab = slab

    def push(self) -> None:
        if self.slab is not None:
            self.data.xfrc_applied[-1, :3] = self.slab.push

    def advance(self, steps: int) -> None:
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[Array, Array]:
        return self.data.qpos.reshape(-1, 7)[:, :3].copy(), self.data.qvel.reshape(-1, 6)[:, :3].copy()


VARIANTS = {
    ("MuJoCo", "defaults"): partial(MuJoCoSpheres, is_stiff=False),
    ("MuJoCo", "stiff, solref 2 h"): partial(MuJoCoSpheres, is_stiff=True),
}
