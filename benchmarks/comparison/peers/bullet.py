"""PyBullet: sequential impulses on a reduced-coordinate multibody.

Bullet has no implicit PD of given gains. Its position motor with gain h K_p / (K_d + h K_p) has the rate that the
implicit PD would have without load, and is stiff against load; the steering's load is small.
"""

import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient

from comparison.mujoco_rover import HALF_WIDTH, text_of
from comparison.peers.base import Variant, bodies, held, quaternion_of
from comparison.peers.grid import corners, middle, triangles, wavefront
from comparison.scene import Array, Phase, RoverScene
from rover_gym import HeightField

SERVO_TORQUE = 1e6  # N m
#: Distance at which Bullet drops a contact of the last step, its default; the last world that sets it sets it for all.
CONTACT_THRESHOLD = 0.02  # m


def new_client(gravity: Sequence[float], time_step: float, *, iterations: int = 50, **more: float) -> BulletClient:
    """A world whose impulses take so many iterations and no shortcuts."""
    c = BulletClient(pybullet.DIRECT)
    c.setGravity(*gravity)
    exact = {"numSubSteps": 0, "solverResidualThreshold": 0.0, "restitutionVelocityThreshold": 0.0}
    c.setPhysicsEngineParameter(fixedTimeStep=time_step, numSolverIterations=iterations, **exact, **more)
    return c


def set_contact(c: BulletClient, body: int, friction: float, restitution: float = 0.0) -> None:
    """Friction and restitution of a body, and no damping: Bullet multiplies those of the two that touch."""
    # one call each: a combined call left the friction at its default
    c.changeDynamics(body, -1, restitution=restitution)
    c.changeDynamics(body, -1, lateralFriction=friction)
    c.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)


def description(scene: RoverScene) -> str:
    """The machine as URDF."""
    root = ElementTree.Element("robot", name="rover")
    all_bodies = bodies(scene.machine)
    for body in all_bodies:
        link = ElementTree.SubElement(root, "link", name=body.name)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=text_of(body.centre), rpy="0 0 0")
        ElementTree.SubElement(inertial, "mass", value=repr(body.mass))
        ixx, iyy, izz = (repr(float(v)) for v in body.inertia)
        ElementTree.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
        if body.wheel >= 0:
            geometry = ElementTree.SubElement(ElementTree.SubElement(link, "collision"), "geometry")
            if scene.thin_wheels:
                ElementTree.SubElement(geometry, "cylinder", radius=repr(body.radius), length=repr(2 * HALF_WIDTH))
            else:
                ElementTree.SubElement(geometry, "sphere", radius=repr(body.radius))
        if body.parent >= 0:
            joint = ElementTree.SubElement(root, "joint", name=body.name, type="continuous")
            ElementTree.SubElement(joint, "origin", xyz=text_of(body.position), rpy="0 0 0")
            ElementTree.SubElement(joint, "axis", xyz=text_of(body.axis))
            ElementTree.SubElement(joint, "parent", link=all_bodies[body.parent].name)
            ElementTree.SubElement(joint, "child", link=body.name)
    return ElementTree.tostring(root, encoding="unicode")


def add_map(c: BulletClient, field: HeightField, *, as_mesh: bool) -> int:
    """A map as Bullet's height field, or as a triangle mesh that knows its inner edges; the body.

    Bullet's rows run along its y, and it cuts a cell from (j + 1, i) to (j, i + 1). With its y along the world's -z the
    surface is the one of `HeightField`.
    """
    if as_mesh:
        with tempfile.NamedTemporaryFile("w", suffix=".obj", encoding="utf-8") as file:  # a new name: Bullet caches
            file.write(wavefront(corners(field), triangles(field).tolist()))
            file.flush()
            flags = pybullet.GEOM_FORCE_CONCAVE_TRIMESH | pybullet.GEOM_CONCAVE_INTERNAL_EDGE
            return int(c.createMultiBody(0, c.createCollisionShape(c.GEOM_MESH, fileName=file.name, flags=flags)))
    rows = field.grid[::-1].astype(float)
    shape = c.createCollisionShape(
        c.GEOM_HEIGHTFIELD,
        meshScale=[*field.spacing, 1.0],
        heightfieldData=rows.ravel().tolist(),
        numHeightfieldRows=rows.shape[1],
        numHeightfieldColumns=rows.shape[0],
    )
    x, z = middle(field)
    place = [x, 0.5 * float(rows.min() + rows.max()), z]
    turn = c.getQuaternionFromEuler([-0.5 * np.pi, 0.0, 0.0])
    return int(c.createMultiBody(0, shape, basePosition=place, baseOrientation=turn))


class BulletRunner:
    """`stepSimulation` behind the common interface."""

    def __init__(
        self,
        scene: RoverScene,
        time_step: float,
        *,
        iterations: int,
        as_mesh: bool = False,
        contact_threshold: float = CONTACT_THRESHOLD,
    ) -> None:
        more = {"iterations": iterations, "contactBreakingThreshold": contact_threshold}
        self.client = c = new_client(scene.gravity, time_step, **more)
        grounds = []
        if scene.normal is not None:
            n = np.array(scene.normal) / np.linalg.norm(scene.normal)
            shape = c.createCollisionShape(c.GEOM_PLANE, planeNormal=list(n))
            grounds.append(c.createMultiBody(0, shape))
        if scene.heights is not None:
            grounds.append(add_map(c, scene.heights, as_mesh=as_mesh))
        for x, y, z, r in scene.spheres:
            shape = c.createCollisionShape(c.GEOM_SPHERE, radius=float(r))
            grounds.append(c.createMultiBody(0, shape, basePosition=[x, y, z]))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "rover.urdf"
            path.write_text(description(scene), encoding="utf-8")
            w, x, y, z = quaternion_of(scene.q)
            self.rover = c.loadURDF(str(path), list(scene.q[:3]), [x, y, z, w], flags=c.URDF_USE_INERTIA_FROM_FILE)
        for ground in grounds:
            c.changeDynamics(ground, -1, lateralFriction=1.0)  # Bullet multiplies the two
        self.joint = {c.getJointInfo(self.rover, j)[12].decode(): j for j in range(c.getNumJoints(self.rover))}
        c.changeDynamics(self.rover, -1, linearDamping=0.0, angularDamping=0.0)
        for j in self.joint.values():
            # one call each: a combined call left the friction at its default
            c.changeDynamics(self.rover, j, lateralFriction=scene.friction)
            c.changeDynamics(self.rover, j, linearDamping=0.0, angularDamping=0.0)
            c.changeDynamics(self.rover, j, jointDamping=0.0)
            c.changeDynamics(self.rover, j, maxJointVelocity=1e4)
            c.setJointMotorControl2(self.rover, j, c.VELOCITY_CONTROL, force=0.0)
        self.h = time_step
        self.bodies = bodies(scene.machine)
        self.wheels: list[int] = []
        self.torques: list[float] = []
        for i, body in enumerate(self.bodies[1:], 1):
            c.resetJointState(self.rover, self.joint[body.name], scene.q[5 + i])
            if held(scene, body):
                self._hold(i, scene.q[5 + i])

    def _hold(self, index: int, target: float) -> None:
        kp, kd = self.bodies[index].hold
        self.client.setJointMotorControl2(
            self.rover,
            self.joint[self.bodies[index].name],
            pybullet.POSITION_CONTROL,
            targetPosition=target,
            positionGain=self.h * kp / (kd + self.h * kp),
            velocityGain=1.0,
            force=SERVO_TORQUE,
        )

    def command(self, phase: Phase) -> None:
        self.wheels, self.torques = [], []
        for i, body in enumerate(self.bodies):
            if body.steers >= 0:
                self._hold(i, phase.steering[body.steers])
            if body.wheel >= 0 and phase.torques[body.wheel]:
                self.wheels.append(self.joint[body.name])
                self.torques.append(body.drive_sign * phase.torques[body.wheel])

    def advance(self, steps: int) -> None:
        c, rover, wheels, torques = self.client, self.rover, self.wheels, self.torques
        for _ in range(steps):
            if wheels:  # torques last for one step
                c.setJointMotorControlArray(rover, wheels, pybullet.TORQUE_CONTROL, forces=torques)
            c.stepSimulation()

    def position(self) -> Array:
        return np.array(self.client.getBasePositionAndOrientation(self.rover)[0])

    def rotation(self) -> Array:
        quaternion = self.client.getBasePositionAndOrientation(self.rover)[1]
        return np.array(self.client.getMatrixFromQuaternion(quaternion)).reshape(3, 3)

    def speed(self) -> float:
        return float(np.linalg.norm(self.client.getBaseVelocity(self.rover)[0]))


VARIANTS = (
    Variant(
        "Bullet",
        "50 iterations",
        partial(BulletRunner, iterations=50),
        "PyBullet, 50 sequential-impulse iterations, damping off; steering by Bullet's position motor",
        "impulses are not solved to a tolerance; the steering is a servo and no PD; penetration is fed back",
    ),
)
