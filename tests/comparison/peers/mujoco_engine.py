"""MuJoCo: soft contacts, convex friction.

At its best (integrator "discrete", elliptic cone, impratio 100) stiffness and damping of the steering enter the contact
solve; at its defaults (integrator "implicitfast" instead of "Euler", which a stiff PD needs) they do not.
"""

from functools import partial
from xml.etree import ElementTree

import mujoco
import numpy as np

from comparison.peers.base import Variant, bodies, held, quaternion_of, rotation_of, turn_z_to
from comparison.scene import Array, Phase, RoverScene

#: Half the width of a wheel that must not be a sphere, m.
HALF_WIDTH = 0.002


def _text(values: Array) -> str:
    return " ".join(repr(float(v)) for v in np.atleast_1d(values))


def description(scene: RoverScene, time_step: float, *, integrator: str, cone: str, impratio: float) -> str:
    """The scene in MuJoCo's XML."""
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(
        root,
        "option",
        timestep=repr(time_step),
        gravity=_text(np.array(scene.gravity)),
        integrator=integrator,
        cone=cone,
        impratio=repr(impratio),
    )
    default = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(default, "geom", friction=f"{scene.friction} 0 0", condim="3")
    world = ElementTree.SubElement(root, "worldbody")
    if scene.normal is not None:
        quat = _text(quaternion_of(turn_z_to(np.array(scene.normal))))
        ElementTree.SubElement(world, "geom", type="plane", size="0 0 1", quat=quat)
    for x, y, z, r in scene.spheres:
        ElementTree.SubElement(world, "geom", type="sphere", size=repr(float(r)), pos=_text(np.array([x, y, z])))
    actuator = ElementTree.SubElement(root, "actuator")
    nodes = []
    for body in bodies(scene.machine):
        parent = world if body.parent < 0 else nodes[body.parent]
        node = ElementTree.SubElement(parent, "body", name=body.name, pos=_text(body.position))
        nodes.append(node)
        ElementTree.SubElement(
            node, "inertial", pos=_text(body.centre), mass=repr(body.mass), diaginertia=_text(body.inertia)
        )
        if body.parent < 0:
            ElementTree.SubElement(node, "freejoint")
        else:
            ElementTree.SubElement(node, "joint", name=body.name, type="hinge", axis=_text(body.axis))
        if body.wheel >= 0:
            if scene.thin_wheels:
                ElementTree.SubElement(node, "geom", type="cylinder", size=f"{body.radius} {HALF_WIDTH}", mass="0")
            else:
                ElementTree.SubElement(node, "geom", type="sphere", size=repr(body.radius), mass="0")
            ElementTree.SubElement(actuator, "motor", name=f"drive{body.wheel}", joint=body.name)
        if held(scene, body):
            kp, kv = body.hold
            name = f"hold_{body.name}"
            ElementTree.SubElement(actuator, "position", name=name, joint=body.name, kp=repr(kp), kv=repr(kv))
    return ElementTree.tostring(root, encoding="unicode")


class MuJoCoRunner:
    """`mj_step` behind the common interface."""

    def __init__(
        self, scene: RoverScene, time_step: float, *, integrator: str, cone: str = "pyramidal", impratio: float = 1.0
    ) -> None:
        text = description(scene, time_step, integrator=integrator, cone=cone, impratio=impratio)
        self.model = mujoco.MjModel.from_xml_string(text)
        # The links do not touch each other.
        wheels = self.model.geom_bodyid > 0
        self.model.geom_contype[:] = np.where(wheels, 2, 1)
        self.model.geom_conaffinity[:] = np.where(wheels, 1, 2)
        self.data = mujoco.MjData(self.model)
        self.bodies = bodies(scene.machine)
        self.data.qpos[:3] = scene.q[:3]
        self.data.qpos[3:7] = quaternion_of(rotation_of(scene.q))
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

#: Between the two: the integrator of the defaults with the friction of the best. It is cheaper than the best, and as
#: soft in its steering as the defaults, so the chart does without it.
ELLIPTIC = Variant(
    "MuJoCo",
    "elliptic",
    partial(MuJoCoRunner, integrator="implicitfast", cone="elliptic", impratio=100.0),
    "integrator implicitfast, elliptic cone, impratio 100",
    SOFT,
)
