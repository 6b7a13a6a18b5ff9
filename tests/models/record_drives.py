"""Drives the gallery's rovers in Pinocchio and records their paths in `drives.json`: `python tests/models/record_drives.py`.

It takes from this project the URDF that `to_urdf` writes, the commands, and the gains and motors that no URDF holds.
Dynamics and contact solver are Pinocchio's; time stepping and the geometry of discs on the plane are written here. The
scheme is of first order, so paths at two steps are extrapolated to a step of zero. The distance from the same at twice
these steps is recorded beside the path. It takes about ten minutes.

How four wheels of a rigid rover share its weight is undetermined, and so is what they do when they slide. The ground
therefore yields a little, equally under all wheels, which decides it and lets them sink by less than a micrometre.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from models.drives import DRIVES, FRICTION, SAMPLE, commands, start

from rover_gym import RoverModel

OUT = Path(__file__).with_name("drives.json")
STEPS = 1e-3, 5e-4, 2.5e-4  # s
#: Of the ground under a wheel: speed by which a unit of impulse lets it sink, over the mean diagonal entry of W.
COMPLIANCE = 1e-2
GRAVITY = 9.81
TOLERANCE = 1e-8  # of the contact solver, N s and m/s
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
UP = np.array([0.0, 0.0, 1.0])


class InPinocchio:
    """A rover on the plane z = 0, of x forward, y left and z up, in steps M̂ v⁺ = M v + h f + Jᵀ p.

    Joints that follow others have coordinates in Pinocchio; `G` takes the velocities without them to all velocities.
    """

    def __init__(self, model: RoverModel, step: float) -> None:
        self.h = step
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            model.to_urdf(path)
            self.pin = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
        self.pin.gravity.linear = -GRAVITY * UP
        self.data = self.pin.createData()
        description = model.to_dict()
        self.wheels = description["wheels"]
        self.joints = [self.pin.getJointId(wheel["solid"]) for wheel in self.wheels]
        self.speeds = [self.pin.joints[joint].idx_v for joint in self.joints]
        self.steering = [
            self.pin.joints[self.pin.getJointId(wheel["steering"])].idx_v if wheel.get("steering") else -1
            for wheel in self.wheels
        ]
        nv = self.pin.nv
        self.stiffness, self.damping, self.target = np.zeros((3, nv))
        self.G = np.eye(nv)
        for solid in description["solids"]:
            if not self.pin.existJointName(solid["name"]):
                continue
            i = self.pin.joints[self.pin.getJointId(solid["name"])].idx_v
            if i in self.steering:
                self.stiffness[i], self.damping[i] = solid["hold"]["stiffness"], solid["hold"]["damping"]
            if (coupled := solid.get("coupled")) is not None:
                assert coupled.get("offset", 0.0) == 0.0
                self.G[i, self.pin.joints[self.pin.getJointId(coupled["joint"])].idx_v] = coupled["ratio"]
        followers = [i for i in range(nv) if np.count_nonzero(self.G[i]) > 1]
        self.G[followers, followers] = 0.0
        self.G = np.delete(self.G, followers, axis=1)
        q = start(model)
        assert not q[[0, 2, 3, 4, 5]].any(), "the rover starts level at the origin"
        self.q, self.v = pin.neutral(self.pin), np.zeros(nv)
        self.q[2] = q[1]
        angles = dict(zip(model.dof_names[6:], q[6:], strict=True))
        for solid in description["solids"]:
            coupled = solid.get("coupled")
            angle = coupled["ratio"] * angles[coupled["joint"]] if coupled else angles.get(solid["name"])
            if angle is not None and angle != 0.0:
                joint = self.pin.joints[self.pin.getJointId(solid["name"])]
                assert joint.nq == 1, "wheels start at zero"
                self.q[joint.idx_q] = angle
        self.solver, self.result = pin.ADMMConstraintSolver(), pin.ADMMSolverResult()
        self.settings = pin.ADMMSolverSettings()
        self.settings.max_iterations = 2000
        for kind in ("feasibility", "complementarity"):
            setattr(self.settings, f"absolute_{kind}_tol", TOLERANCE)
            setattr(self.settings, f"relative_{kind}_tol", 0.0)
        self.impulses = np.zeros(3 * len(self.wheels))

    def drive(self, torques: np.ndarray, set_points: np.ndarray, duration: float) -> None:
        """Steps with constant commands."""
        for i, set_point in zip(self.steering, set_points, strict=True):
            if i >= 0:
                self.target[i] = set_point
        for _ in range(round(duration / self.h)):
            self._step(torques)

    def _torques(self, commanded: np.ndarray) -> np.ndarray:
        """Generalized forces of the motors; positive commands drive forward."""
        found = np.zeros(self.pin.nv)
        for wheel, i, command in zip(self.wheels, self.speeds, commanded, strict=True):
            torque, sign, motor = command, wheel["drive_sign"], wheel.get("motor")
            if motor is not None:
                stall, share = motor["stall_torque"], sign * self.v[i] / motor["no_load_speed"]
                torque = np.clip(torque, max(-stall, -stall * (1.0 + share)), min(stall, stall * (1.0 - share)))
            found[i] = sign * torque
        return found

    def _step(self, commanded: np.ndarray) -> None:
        model, data, h, G = self.pin, self.data, self.h, self.G
        M = pin.crba(model, data, self.q)
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(model, data, self.q, self.v)
        pin.computeJointJacobians(model, data, self.q)
        angles = pin.difference(model, pin.neutral(model), self.q) - self.target
        force = self._torques(commanded) - bias - np.where(self.stiffness > 0.0, self.stiffness * angles, 0.0)
        M_hat = G.T @ (M + np.diag(h * self.damping + h * h * self.stiffness)) @ G
        J, gaps = np.empty((3 * len(self.joints), model.nv)), np.zeros(3 * len(self.joints))
        for k, (joint, wheel) in enumerate(zip(self.joints, self.wheels, strict=True)):
            place, radius = data.oMi[joint], wheel["radius"]
            axle = place.rotation @ axle_of(wheel)
            down = (axle @ UP) * axle - UP
            down /= np.linalg.norm(down)
            along = np.cross(UP, axle)
            along /= np.linalg.norm(along)
            J6 = pin.getJointJacobian(model, data, joint, WORLD)
            at = J6[:3] - pin.skew(radius * down) @ J6[3:]
            J[3 * k : 3 * k + 3] = np.array([along, np.cross(UP, along), UP]) @ at
            gap = float(UP @ (place.translation + radius * down))
            gaps[3 * k + 2] = gap / h if gap > 0.0 else 0.1 * gap / h
        J = J @ G
        free = G.T @ (M @ self.v + h * force)
        solved = np.linalg.solve(M_hat, np.column_stack([free, J.T]))
        W = J @ solved[:, 1:]
        normals = np.arange(2, len(W), 3)
        W[normals, normals] += COMPLIANCE * np.trace(W) / len(W)
        p = self._solve(0.5 * (W + W.T), J @ solved[:, 0] + gaps)
        self.v = G @ (solved[:, 0] + solved[:, 1:] @ p)
        self.q = pin.integrate(model, self.q, h * self.v)

    def _solve(self, W: np.ndarray, g: np.ndarray) -> np.ndarray:
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for joint in self.joints:
            contact = pin.PointContactConstraintModel(self.pin, joint)
            contact.setFriction(FRICTION)
            models.append(pin.ConstraintModel(contact))
        for contact in models:
            datas.append(contact.createData())
        self.result.setConstraintImpulseGuess(self.impulses)
        self.solver.solve(pin.DelassusOperatorDense(W), g, models, datas, self.settings, self.result)
        self.impulses = np.array(self.result.retrieveConstraintImpulses())
        return self.impulses


def axle_of(wheel: dict) -> np.ndarray:
    """Unit axle in the wheel's frame of the URDF, such that z to the right of ours becomes y to the left."""
    x, y, z = wheel["axle"]
    axle = np.array([x, -z, y])
    return axle / np.linalg.norm(axle)


def path(name: str, step: float) -> np.ndarray:
    """(n, 3) x, y, z of the trunk's origin in our axes, m, every `SAMPLE` from the start on."""
    model = RoverModel.named(name)
    rover = InPinocchio(model, step)
    places = [rover.q[:3].copy()]
    for torques, set_points in commands(model, DRIVES[name]):
        rover.drive(torques, set_points, SAMPLE)
        places.append(rover.q[:3].copy())
    x, y, z = np.array(places).T
    return np.column_stack([x, z, -y])


def main() -> None:
    found = json.loads(OUT.read_text(encoding="utf-8")) if OUT.exists() else {}
    for name in sys.argv[1:] or DRIVES:
        coarse, middle, fine = (path(name, step) for step in STEPS)
        limit = 2.0 * fine - middle
        doubt = float(np.linalg.norm(limit - (2.0 * middle - coarse), axis=1).max())
        found[name] = {
            "made_by": f"Pinocchio {pin.__version__}, ADMM, at {STEPS[1] * 1e3:g} and {STEPS[2] * 1e3:g} ms, extrapolated to 0",
            "distance_of_the_same_at_twice_these_steps_m": doubt,
            "path": np.round(limit, 7).tolist(),
        }
        print(f"{name}: {doubt:.1e} m", flush=True)  # noqa: T201 - it tells how far it is
        OUT.write_text(json.dumps(found, separators=(",", ":")).replace('},"', '},\n"') + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
