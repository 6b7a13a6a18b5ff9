"""Pinocchio's dynamics and its ADMM contact solver, time stepping written here in Python.

Pinocchio is a library, not a simulator: the loop around its solver (contact points, implicit steering, Moreau's rule
that a contact is active if it would close within the step) is our Python code and accounts for most of the cost.
"""

from functools import partial

import numpy as np
import pinocchio as pin

from comparison.peers.base import Variant, bodies, held, quaternion_of
from comparison.peers.contacts import contacts
from comparison.scene import Array, Phase, RoverScene

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioRunner:
    """One velocity step: M̂ v⁺ = M v + h f + Jᵀ p with ADMM for p."""

    def __init__(self, scene: RoverScene, time_step: float, *, tolerance: float) -> None:
        self.scene, self.h = scene, time_step
        self.bodies = bodies(scene.machine)
        self.model = pin.Model()
        self.model.gravity.linear = np.array(scene.gravity)
        self.joints = [0] * len(self.bodies)
        self._add(0)
        self.data = self.model.createData()
        self.q = pin.neutral(self.model)
        w, x, y, z = quaternion_of(scene.q)
        self.q[:7] = [*scene.q[:3], x, y, z, w]
        self.v = np.zeros(self.model.nv)
        self.stiffness, self.damping = np.zeros(self.model.nv), np.zeros(self.model.nv)
        self.target, self.torque = np.zeros(self.model.nv), np.zeros(self.model.nv)
        for i, body in enumerate(self.bodies[1:], 1):
            joint = self.model.joints[self.joints[i]]
            self.q[joint.idx_q] = scene.q[5 + i]
            if held(scene, body):
                self.stiffness[joint.idx_v], self.damping[joint.idx_v] = body.hold
                self.target[joint.idx_v] = scene.q[5 + i]
        wheels = sorted((body.wheel, i) for i, body in enumerate(self.bodies) if body.wheel >= 0)
        self.wheels = [i for _, i in wheels]
        self.radii = [self.bodies[i].radius for i in self.wheels]
        self.solver, self.result = pin.ADMMConstraintSolver(), pin.ADMMSolverResult()
        self.settings = pin.ADMMSolverSettings()
        self.settings.max_iterations = 1000
        for name in ("absolute_feasibility_tol", "absolute_complementarity_tol"):
            setattr(self.settings, name, tolerance)
        for name in ("relative_feasibility_tol", "relative_complementarity_tol"):
            setattr(self.settings, name, 0.0)
        self.last: dict[int, Array] = {}

    def _add(self, index: int) -> None:
        """Adds a body and its subtree, depth first, as crba requires."""
        body = self.bodies[index]
        if body.parent < 0:
            kind, parent = pin.JointModelFreeFlyer(), 0
        else:
            kind, parent = pin.JointModelRevoluteUnaligned(*body.axis), self.joints[body.parent]
        joint = self.model.addJoint(parent, kind, pin.SE3(np.eye(3), body.position), body.name)
        self.model.appendBodyToJoint(
            joint, pin.Inertia(body.mass, body.centre, np.diag(body.inertia)), pin.SE3.Identity()
        )
        self.joints[index] = joint
        for child, other in enumerate(self.bodies):
            if other.parent == index:
                self._add(child)

    def command(self, phase: Phase) -> None:
        for i, body in enumerate(self.bodies):
            v = self.model.joints[self.joints[i]].idx_v
            if body.wheel >= 0:
                self.torque[v] = body.drive_sign * phase.torques[body.wheel]
            if body.steers >= 0:
                self.target[v] = phase.steering[body.steers]

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._step()

    def _step(self) -> None:
        model, data, h = self.model, self.data, self.h
        M = pin.crba(model, data, self.q)
        M = np.triu(M) + np.triu(M, 1).T
        bias = pin.nonLinearEffects(model, data, self.q, self.v)
        pin.computeJointJacobians(model, data, self.q)
        angle = np.zeros(model.nv)
        angle[6:] = self.q[7:] - self.target[6:]
        M_hat = M + np.diag(h * self.damping + h * h * self.stiffness)
        free = M @ self.v + h * (self.torque - bias - self.stiffness * angle)
        places = [data.oMi[self.joints[i]] for i in self.wheels]
        reach = h * (1.0 + float(np.abs(self.v[:3]).max()))
        found = contacts(
            self.scene, [p.translation for p in places], [p.rotation[:, 2] for p in places], self.radii, reach
        )
        if not found:
            self.v = np.linalg.solve(M_hat, free)
        else:
            J = np.empty((3 * len(found), model.nv))
            gaps = np.zeros(3 * len(found))
            for k, (wheel, point, frame, gap) in enumerate(found):
                J6 = pin.getJointJacobian(model, data, self.joints[self.wheels[wheel]], WORLD)
                r = point - places[wheel].translation
                J[3 * k : 3 * k + 3] = frame @ (J6[:3] - pin.skew(r) @ J6[3:])
                gaps[3 * k + 2] = gap / h if gap > 0.0 else 0.1 * gap / h
            solved = np.linalg.solve(M_hat, np.column_stack([free, J.T]))
            W = J @ solved[:, 1:]
            p = self._impulses(0.5 * (W + W.T), J @ solved[:, 0] + gaps, [wheel for wheel, *_ in found])
            self.v = solved[:, 0] + solved[:, 1:] @ p
        self.q = pin.integrate(model, self.q, h * self.v)

    def _impulses(self, W: Array, g: Array, wheels: list[int]) -> Array:
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for wheel in wheels:
            contact = pin.PointContactConstraintModel(self.model, self.joints[self.wheels[wheel]])
            contact.setFriction(self.scene.friction)
            models.append(pin.ConstraintModel(contact))
        for contact in models:
            datas.append(contact.createData())
        guess = np.concatenate([self.last.get(wheel, np.zeros(3)) for wheel in wheels])
        self.result.setConstraintImpulseGuess(guess)
        self.solver.solve(pin.DelassusOperatorDense(W), g, models, datas, self.settings, self.result)
        p = self.result.retrieveConstraintImpulses()
        self.last = {wheel: p[3 * k : 3 * k + 3] for k, wheel in enumerate(wheels)}
        return np.array(p)

    def position(self) -> Array:
        return np.array(self.q[:3])

    def rotation(self) -> Array:
        return np.array(pin.Quaternion(self.q[3:7]).toRotationMatrix())

    def speed(self) -> float:
        return float(np.linalg.norm(self.v[:3]))


VARIANTS = (
    Variant(
        "Pinocchio",
        "ADMM in a Python loop",
        partial(PinocchioRunner, tolerance=1e-8),
        "absolute tolerance 1e-8; dynamics and solver compiled, the step around them Python",
        "nothing: the same law, contacts at the step's start",
    ),
)
