"""MuJoCo: soft contacts, convex friction.

At its best (integrator "discrete", elliptic cone, impratio 100) stiffness and damping of the steering enter the contact
solve; at its defaults (integrator "implicitfast" instead of "Euler", which a stiff PD needs) they do not.
"""

from functools import partial
from xml.etree import ElementTree

import mujoco
import numpy as np

from comparison.mujoco_rover import rover_xml
from comparison.peers.base import Variant, bodies, held, quaternion_of
from comparison.peers.grid import middle
from comparison.scene import Array, Phase, RoverScene
from rover_gym import HeightField


def model_on(text: str, field: HeightField | None, solref: float | None = None) -> mujoco.MjModel:
    """Compiles a model, with a map as MuJoCo's height field where one is given.

    MuJoCo's rows run along its y, and it cuts a cell from (j, i) to (j + 1, i + 1). With its x along the world's z and
    its y along the world's x the surface is the one of `HeightField`, whose columns are MuJoCo's rows.

    Args:
        text: The model.
        field: The map, which touches what has bit 2 in `contype` or bit 1 in `conaffinity`.
        solref: Time constant of all contacts, s; MuJoCo's default where None.
    """
    root = ElementTree.fromstring(text)  # noqa: S314 - our own text
    if field is not None:
        rows = field.grid.T.astype(float)
        low, high = float(rows.min()), float(rows.max())
        x_min, z_min, x_max, z_max = field.bounds
        x, z = middle(field)
        rise = high - low or 1.0
        ElementTree.SubElement(
            ElementTree.SubElement(root, "asset"),
            "hfield",
            name="map",
            nrow=str(rows.shape[0]),
            ncol=str(rows.shape[1]),
            size=f"{(z_max - z_min) / 2!r} {(x_max - x_min) / 2!r} {rise!r} 1",
        )
        place = {"pos": f"{x!r} {low!r} {z!r}", "xyaxes": "0 0 1 1 0 0", "contype": "1", "conaffinity": "2"}
        world = root.find("worldbody")
        assert world is not None
        ElementTree.SubElement(world, "geom", place, name="ground", type="hfield", hfield="map")
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    if field is not None:
        model.hfield_data[:] = ((rows - low) / rise).ravel()
    if solref is not None:
        model.geom_solref[:] = [solref, 1.0]
    return model


class MuJoCoRunner:
    """`mj_step` behind the common interface."""

    def __init__(
        self,
        scene: RoverScene,
        time_step: float,
        *,
        integrator: str,
        cone: str = "pyramidal",
        impratio: float = 1.0,
        solref_steps: float | None = None,
    ) -> None:
        text = rover_xml(
            scene.machine,
            time_step=time_step,
            normal=scene.normal,
            spheres=scene.spheres,
            friction=scene.friction,
            gravity=scene.gravity,
            thin_wheels=scene.thin_wheels,
            brake=scene.brake,
            integrator=integrator,
            cone=cone,
            impratio=impratio,
        )
        self.model = model_on(text, scene.heights, solref_steps and solref_steps * time_step)
        self.data = mujoco.MjData(self.model)
        self.bodies = bodies(scene.machine)
        self.data.qpos[:3] = scene.q[:3]
        self.data.qpos[3:7] = quaternion_of(scene.q)
        for i, body in enumerate(self.bodies[1:], 1):
            self.data.qpos[self.model.joint(body.name).qposadr[0]] = scene.q[5 + i]
            if held(scene, body):
                self.data.actuator(f"hold_{body.name}").ctrl[0] = scene.q[5 + i]
        mujoco.mj_forward(self.model, self.data)

    def command(self, phase: Phase) -> None:
        for body in self.bodies:
            if body.wheel >= 0:
                torque = body.drive_sign * phase.torques[body.wheel]
                self.data.actuator(f"drive{body.wheel}").ctrl[0] = torque
            if body.steers >= 0:
                self.data.actuator(f"hold_{body.name}").ctrl[0] = phase.steering[body.steers]

    def advance(self, steps: int) -> None:
        mujoco.mj_step(self.model, self.data, nstep=steps)
        if self.data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            raise FloatingPointError("unstable: MuJoCo reset the state")

    def position(self) -> Array:
        return np.array(self.data.qpos[:3])

    def rotation(self) -> Array:
        out = np.zeros(9)
        mujoco.mju_quat2Mat(out, self.data.qpos[3:7])
        return out.reshape(3, 3)

    def speed(self) -> float:
        return float(np.linalg.norm(self.data.qvel[:3]))


SOFT = "contacts are springs and dampers (solref 0.02 s); friction is convex and creeps"

VARIANTS = (
    Variant(
        "MuJoCo",
        "discrete, elliptic",
        partial(MuJoCoRunner, integrator="discrete", cone="elliptic", impratio=100.0),
        "integrator discrete, elliptic cone, impratio 100",
        SOFT,
    ),
    Variant(
        "MuJoCo",
        "defaults",
        partial(MuJoCoRunner, integrator="implicitfast"),
        "pyramidal cone, impratio 1; integrator implicitfast, since Euler is unstable with the steering's gains",
        SOFT + "; the friction cone is a pyramid",
    ),
)
