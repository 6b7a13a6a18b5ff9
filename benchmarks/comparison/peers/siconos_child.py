"""The process of `siconos_nsgs`: reads messages of one line of JSON, steps, answers.

Runs in the system's Python with its NumPy 1. Arguments: this project's compiled module; `--probe` only imports.
"""

import importlib.util
import json
import sys
import time

import numpy as np
import siconos.numerics as sn


def load_core(path):
    """The compiled module, without the package around it."""
    spec = importlib.util.spec_from_file_location("_core", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Stepper:
    """M̂ v⁺ = M v + h f + Jᵀ p, p by fc3d_nsgs."""

    def __init__(self, core, start):
        self.model = core.RoverModel.from_dict(start["machine"])
        self.plane = core.Plane(start["normal"])
        self.gravity, self.h = np.array(start["gravity"]), start["time_step"]
        self.mu = start["friction"]
        q = np.array(start["q"])
        cx, cy, cz = np.cos(q[3:6])
        sx, sy, sz = np.sin(q[3:6])
        self.R = (
            np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
            @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
            @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        )
        self.q, self.v = q, np.zeros(len(q))
        self.kp, self.kd = np.zeros(len(q)), np.zeros(len(q))
        self.target, self.torque = np.zeros(len(q)), np.zeros(len(q))
        self.wheels, self.steering = self.model.wheel_joint_indices, self.model.steering_joint_indices
        self.sign = [wheel["drive_sign"] for wheel in start["machine"]["wheels"]]
        for i, solid in enumerate(start["machine"]["solids"]):
            if i and (5 + i in self.steering or (start["brake"] and 5 + i in self.wheels)):
                self.kp[5 + i], self.kd[5 + i] = solid["hold"]["stiffness"], solid["hold"]["damping"]
                self.target[5 + i] = q[5 + i]
        self.options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
        self.options.dparam[sn.SICONOS_DPARAM_TOL] = start["tolerance"]
        self.options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 10000
        self.last = np.zeros((6, 3))
        self.cpu = 0.0

    def step(self):
        q, v, h = self.q, self.v, self.h
        M = self.model.mass_matrix(q, "state")
        bias = self.model.bias(q, v, self.gravity, "state")
        free = M @ v + h * (self.torque - bias - self.kp * (q - self.target))
        M_hat = M + np.diag(h * self.kd + h * h * self.kp)
        gaps = self.model.wheel_gaps(q, self.plane, "state")
        active = np.flatnonzero(gaps < h * (1.0 + np.abs(v[:3]).max()))
        if len(active) == 0:
            v = np.linalg.solve(M_hat, free)
        else:
            J = self.model.wheel_jacobians(q, self.plane, "state")[active].reshape(-1, len(q))
            solved = np.linalg.solve(M_hat, np.column_stack([free, J.T]))
            W, local = J @ solved[:, 1:], J @ solved[:, 0]
            local[::3] += np.where(gaps[active] > 0.0, 1.0, 0.1) * gaps[active] / h
            n = len(active)
            problem = sn.FrictionContactProblem(3, n, 0.5 * (W + W.T), local, np.full(n, self.mu))
            p, u = self.last[active].ravel().copy(), np.zeros(3 * n)
            sn.fc3d_nsgs(problem, p, u, self.options)
            self.last[:] = 0.0
            self.last[active] = p.reshape(n, 3)
            v = solved[:, 0] + solved[:, 1:] @ p
        self.v = v
        w = h * v[3:6]
        angle = np.linalg.norm(w)
        K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        a, b = (np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2) if angle > 1e-9 else (1.0, 0.5)
        self.R = (np.eye(3) + a * K + b * K @ K) @ self.R
        q = q + h * v
        q[3] = np.arctan2(-self.R[1, 2], self.R[1, 1])
        q[4] = np.arctan2(-self.R[2, 0], self.R[0, 0])
        q[5] = np.arcsin(np.clip(self.R[1, 0], -1.0, 1.0))
        self.q = q

    def answer(self, message):
        if "steering" in message:
            for i in range(6):
                self.target[self.steering[i]] = message["steering"][i]
                self.torque[self.wheels[i]] = self.sign[i] * message["torques"][i]
        begin = time.process_time()
        for _ in range(message.get("steps", 0)):
            self.step()
        self.cpu += time.process_time() - begin
        return {
            "position": list(self.q[:3]),
            "rotation": self.R.tolist(),
            "speed": float(np.linalg.norm(self.v[:3])),
            "cpu": self.cpu,
        }


def main():
    """Answers the messages of the standard input until it ends."""
    core = load_core(sys.argv[1])
    if "--probe" in sys.argv:
        return
    sn.numerics_set_verbose(0)
    stepper = None
    for line in sys.stdin:
        message = json.loads(line)
        if stepper is None:
            stepper = Stepper(core, message)
            message = {}
        sys.stdout.write(json.dumps(stepper.answer(message)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
