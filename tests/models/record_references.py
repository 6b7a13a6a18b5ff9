"""Records M(q), bias and frames of other engines in `references.json`: `python tests/models/record_references.py`.

It needs Pinocchio (`pin`), MuJoCo, PyBullet's data and yourdfpy. The gallery goes through our own writers to Pinocchio
and MuJoCo; public files, which are not part of this repository, are read by the engines themselves.
"""

import importlib.util
import json
import re
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from models.public_files import MJCF, URDF, place

from rover_gym import RoverModel

OUT = Path(__file__).with_name("references.json")
TO_OURS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
GRAVITY = 9.81
STATES = 2


def attitude(q):
    """Ry(heading) Rz(pitch) Rx(roll) of public coordinates."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(q[3:6]), np.sin(q[3:6])
    Rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return Ry @ Rz @ Rx


class InPinocchio:
    """A URDF in Pinocchio, whose free base moves in its own axes."""

    name = f"Pinocchio {pin.__version__}"

    def __init__(self, path, *, is_free):
        root = pin.JointModelFreeFlyer() if is_free else None
        self.model = pin.buildModelFromUrdf(str(path), root) if is_free else pin.buildModelFromUrdf(str(path))
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        self.data = self.model.createData()
        self.joints = [name for name in self.model.names if name not in ("universe", "root_joint")]
        self.start = 6 if is_free else 0
        # A free base without mass of its own joints: its link is the root frame.

    def at(self, base, rates):
        """Mass matrix, bias, and the map T (with T' v) from our velocity to Pinocchio's, at a state."""
        model, data = self.model, self.data
        q, v = pin.neutral(model), np.zeros(model.nv)
        T, drift = np.eye(model.nv), np.zeros(model.nv)
        if base is not None:
            x, R, linear, angular = base
            R = TO_OURS.T @ R @ TO_OURS
            q[:3], q[3:7] = TO_OURS.T @ x, pin.Quaternion(R).coeffs()
            for k in (0, 3):
                T[k : k + 3, k : k + 3] = R.T @ TO_OURS.T
            v[:3], v[3:6] = R.T @ TO_OURS.T @ linear, R.T @ TO_OURS.T @ angular
            drift[:3] = -np.cross(v[3:6], v[:3])
        for name, (angle, rate) in rates.items():
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            v[joint.idx_v] = rate
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        bias = np.array(pin.nonLinearEffects(model, data, q, v))
        pin.framesForwardKinematics(model, data, q)
        return M, bias + M @ drift, T

    def index(self, joint):
        return self.model.joints[self.model.getJointId(joint)].idx_v

    def frames(self):
        return {
            frame.name: (self.data.oMf[i].translation, self.data.oMf[i].rotation)
            for i, frame in enumerate(self.model.frames)
            if frame.type == pin.FrameType.BODY
        }


class InMuJoCo:
    """An MJCF in MuJoCo, whose free base moves in the world's axes and turns in its own."""

    name = f"MuJoCo {mujoco.__version__}"

    def __init__(self, path, *, is_free):
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.gravity[:] = 0.0, 0.0, -GRAVITY
        self.model.dof_damping[:] = 0.0
        self.model.jnt_stiffness[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.is_free = is_free
        kinds = self.model.jnt_type
        self.joints = [
            self.model.joint(j).name for j in range(self.model.njnt) if kinds[j] != mujoco.mjtJoint.mjJNT_FREE
        ]

    def at(self, base, rates):
        m, d = self.model, self.data
        d.qpos[:], d.qvel[:] = m.qpos0, 0.0
        T, drift = np.eye(m.nv), np.zeros(m.nv)
        if base is not None:
            x, R, linear, angular = base
            R = TO_OURS.T @ R @ TO_OURS
            d.qpos[:3] = TO_OURS.T @ x
            mujoco.mju_mat2Quat(d.qpos[3:7], R.ravel())
            T[:3, :3], T[3:6, 3:6] = TO_OURS.T, R.T @ TO_OURS.T
            d.qvel[:3], d.qvel[3:6] = TO_OURS.T @ linear, R.T @ TO_OURS.T @ angular
        for name, (angle, rate) in rates.items():
            joint = m.joint(name)
            d.qpos[joint.qposadr[0]] = m.qpos0[joint.qposadr[0]] + angle
            d.qvel[joint.dofadr[0]] = rate
        mujoco.mj_forward(m, d)
        M = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, d, M) if _takes_data() else mujoco.mj_fullM(m, M, d.qM)
        return M, np.array(d.qfrc_bias) + M @ drift, T

    def index(self, joint):
        return int(self.model.joint(joint).dofadr[0])

    def frames(self):
        return {
            self.model.body(b).name or f"body{b}": (self.data.xpos[b].copy(), self.data.xmat[b].reshape(3, 3).copy())
            for b in range(1, self.model.nbody)
        }


def _takes_data():
    return "mj_fullM(m: mujoco" in (mujoco.mj_fullM.__doc__ or "") and "d: mujoco" in mujoco.mj_fullM.__doc__


def record(model, engine, joint_of):
    """States with the engine's numbers in our coordinates. `joint_of`: the engine's joint by the name of our solid."""
    solids = model.to_dict()["solids"]
    is_free = solids[0].get("joint", "free") == "free"
    names = model.dof_names
    rng = np.random.default_rng(7)
    states = []
    for _ in range(STATES):
        q, v = rng.uniform(-1.0, 1.0, (2, model.nv))
        base = (q[:3], attitude(q), v[:3], v[3:6]) if is_free else None
        rates, weights = {}, {}
        for solid in solids:
            joint = joint_of(solid["name"])
            if joint is None:
                continue
            coupled = solid.get("coupled")
            if solid["name"] not in names and coupled is None:
                continue
            leader = names.index(coupled["joint"] if coupled else solid["name"])
            ratio, offset = (coupled["ratio"], coupled["offset"]) if coupled else (1.0, 0.0)
            rates[joint] = (ratio * q[leader] + offset, ratio * v[leader])
            weights[joint] = (leader, ratio)
        M, bias, T = engine.at(base, rates)
        G = np.zeros((len(M), model.nv))  # from our velocities to the engine's
        start = 6 if is_free else 0
        G[:start, :start] = T[:start, :start]
        for joint, (leader, ratio) in weights.items():
            G[engine.index(joint), leader] = ratio
        M, bias = G.T @ M @ G, G.T @ bias
        frames = {
            name: [(TO_OURS @ origin).tolist(), (TO_OURS @ R @ TO_OURS.T).tolist()]
            for name, (origin, R) in engine.frames().items()
            if name in model.solid_names
        }
        lower = [M[i, : i + 1].tolist() for i in range(model.nv)]
        states.append({"q": q.tolist(), "v": v.tolist(), "M": lower, "bias": bias.tolist(), "frames": frames})
    return {"engine": engine.name, "dof_names": names, "states": states}


def main():
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in RoverModel.names():
            model = RoverModel.named(name)
            model.to_urdf(Path(folder) / "robot.urdf")
            model.to_mjcf(Path(folder) / "robot.xml")
            for key, engine in (
                ("Pinocchio", InPinocchio(Path(folder) / "robot.urdf", is_free=True)),
                ("MuJoCo", InMuJoCo(Path(folder) / "robot.xml", is_free=True)),
            ):
                known = set(engine.joints)
                found[f"{name} in {key}"] = record(
                    model, engine, lambda solid, known=known: solid if solid in known else None
                )
    for files, engine_of, read in ((URDF, InPinocchio, RoverModel.from_urdf), (MJCF, InMuJoCo, RoverModel.from_mjcf)):
        for name, options in files.items():
            with tempfile.TemporaryDirectory() as folder:
                path = place(name)
                model = read(path, **options)
                is_free = model.dof_names[0] == "x"
                engine = engine_of(with_defaults(path, Path(folder)), is_free=is_free)
                joints = joints_of(path, engine)
                found[name] = record(model, engine, joints.get)
    OUT.write_text(json.dumps(found, separators=(",", ":")).replace('},"', '},\n"') + "\n", encoding="utf-8")
    print(f"{OUT}: {OUT.stat().st_size} bytes")  # noqa: T201 - it tells what it wrote


def with_defaults(path, folder):
    """The file, or a copy in which the defaults of ROS's substitutions stand: Pinocchio does not make them."""
    text = path.read_text(encoding="utf-8")
    if "$(optenv" not in text:
        return path
    copy = folder / path.name
    copy.write_text(re.sub(r"\$\(optenv \w+ ([^)]*)\)", r"\1", text), encoding="utf-8")
    return copy


def joints_of(path, engine):
    """The engine's joint that carries each link."""
    if isinstance(engine, InMuJoCo):
        m = engine.model
        bodies = [m.body(b).name or f"body{b}" for b in range(m.nbody)]
        return {bodies[m.jnt_bodyid[j]]: m.joint(j).name for j in range(m.njnt) if m.joint(j).name in engine.joints}
    text = path.read_text(encoding="utf-8")
    pairs = re.findall(r'<joint\s[^>]*name="([^"]+)"[^>]*>(?:(?!</joint>).)*?<child\s+link="([^"]+)"', text, re.DOTALL)
    return {child: joint for joint, child in pairs if joint in engine.joints}


if __name__ == "__main__":
    if importlib.util.find_spec("pybullet_data") is None:
        sys.exit("needs pybullet")
    main()
