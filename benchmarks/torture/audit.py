r"""Energy audit of a rover's steps, from what the public interface shows: it believes no report.

    gained = T + V + S (after) - T + V + S (before) - sum_j tau_j dphi_j

T and V are kinetic and potential energy, S = sum k (phi - set-point)^2 / 2 is stored by the held steering joints,
before the step at its own set-points. The energy of a simulation contains all three. tau_j is the commanded torque
about joint j and dphi_j the angle turned. A motor whose torque falls with its speed does less work than the commanded
torque would, so the difference bounds what the step gained from nowhere. Dampers only take energy away.

The projection of positions lifts what overlaps, and so adds energy of its own. Where more was gained than rounding, the
step is taken again from its start without projection, and what differs is entered as `lifted`.

Wheels that yield store energy that the public interface does not show. What they give off is taken from the reports of
the steps, taken again, and what they gave since the start of a case must not exceed what they took and what they
stored at its start: there each contact may have borne the weight.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym import RoverModel, Simulation, StepError
from torture.ledger import Ledger

Array = npt.NDArray[np.float64]

#: A step may gain so much of the energy at hand: the project's claim.
GAIN = 1e-9
#: Yielding wheels may give so much of the most there was more than they took: rounding.
DRIFT = 1e-9
#: A case ends with a step that gained more: what follows says nothing.
BLOWN_UP = 1.0


class Audit:
    """Steps a simulation and enters into a ledger what its steps come to.

    Args:
        sim: Its commands may be changed between steps; joints are held by `set_steering` only.
        ledger: Of the case.
        deep: Whether it starts overlapping the ground, so that `deepest` is entered only once it is out.
    """

    def __init__(self, sim: Simulation, ledger: Ledger, *, deep: bool = False) -> None:
        self.sim, self.ledger, self._deep = sim, ledger, deep
        self.joint_torques: Array = np.zeros(sim.model.nv - 6)
        model, description = sim.model, sim.model.to_dict()
        indices = np.array(model.steering_joint_indices)
        # The wheels that stand for the joints that steer: several may share one, and some do not steer.
        joints, wheels = np.unique(indices, return_index=True)
        self._steering, self._steered = joints[joints >= 0], wheels[joints >= 0]
        self._stiffness = _gains(model, description, self._steering)
        self._signs = model.actuation_matrix()[:, : len(indices)]
        self._given = self._most = 0.0
        self._weight = model.mass * float(np.linalg.norm(sim.gravity))
        springs = model.wheel_stiffnesses > 0.0
        self._yields, self._at_first = bool(springs.any()), True
        friction = float(sim.settings["friction"])
        ratios = np.array([float(wheel.get("tangential_ratio", 1.0)) for wheel in description["wheels"]])
        held = _held_by(model.wheel_stiffnesses[springs], model.wheel_radii[springs], self._weight)
        held += 0.5 * (friction * self._weight) ** 2 / (model.wheel_stiffnesses * ratios)[springs]
        #: What a contact may store at the start, J.
        self._settled = float(held.max(initial=0.0))
        self._twin: Simulation | None = None

    def push(self, torques: Array) -> None:
        """Sets torques about the joint axes (nv - 6,) N m, which have no limit."""
        self.sim.set_joint_torques(torques)
        self.joint_torques = torques

    def run(self, steps: int) -> bool:
        """Takes steps one by one; False where one was refused or went wrong."""
        return all(self.step() for _ in range(steps))

    def step(self) -> bool:
        """Takes one step; False where it was refused or went wrong."""
        self.begin()
        try:
            with self.ledger.timed():
                report = self.sim.step()
        except StepError as error:
            # A snapshot also holds the contacts of the last call, and a refused call has none.
            kept = (self.sim.q == self._q).all() and (self.sim.v == self._v).all() and self.sim.time == self._time
            if not kept:
                self.ledger.find("a refused step changed the state")
            return self.end(1, "failed", str(error))
        return self.end(1, report.status, f"residual {report.residual:.1e}, {report.n_contacts} contacts")

    def begin(self) -> None:
        """Before steps that somebody else takes, after the commands are given."""
        sim = self.sim
        self._start, self._q, self._v, self._before = sim.snapshot(), sim.q, sim.v, sim.energy()
        self._time, self._held = sim.time, self._stored(self._q)

    def end(self, steps: int, status: str, what: str = "") -> bool:
        """After them: enters what they came to.

        Args:
            steps: How many.
            status: "converged", "not_converged" or "failed".
            what: More of it, for the notes.
        """
        sim, ledger, q = self.sim, self.ledger, self._q
        ledger.steps += steps
        if status == "failed":
            ledger.refused += 1
            self._note("refused", what)
        if status == "not_converged":
            ledger.not_converged += 1
            self._note("not converged", what)
        after = sim.q
        if not ledger.is_finite(after, sim.v):
            return False
        stored, work = self._stored(q), self._work(after - q)
        at_hand = self._before.kinetic + self._weight + abs(work) + stored
        gained = sim.energy().total - (self._before.total - self._held) - stored - work
        gained -= self._swing()
        if gained > GAIN * at_hand or self._yields:
            extra = self._lifted_and_released(steps)
            if extra is not None:
                lifted, released = extra
                ledger.raise_to("lifted", lifted / at_hand)
                gained -= lifted + released
                if self._at_first:
                    self._given -= self._settled * len(sim.contacts.gaps)
                self._given += released
        self._at_first = False
        share = gained / at_hand if at_hand > 0.0 else 0.0
        ledger.raise_to("gained", share)
        if share > GAIN:
            self._note("gained", f"{share:.1e} of {at_hand:.3g} J; {what}")
        self._most = max(self._most, at_hand)
        if self._given > DRIFT * self._most:
            ledger.find(f"yielding wheels gave {self._given:.1e} J more than they took, of {self._most:.1e} J")
            self._given = -np.inf
        overlap = -sim.deepest_overlap
        self._deep = self._deep and overlap > 1e-3
        if not self._deep:
            ledger.raise_to("deepest", overlap)
        return share < BLOWN_UP and status != "failed"

    def _swing(self) -> float:
        """Energy by which free flight may err with the Newton variant, J.

        It keeps the momenta to rounding and lets the energy swing with the third power of the turn in a step, up to
        0.1 rad; it does not drift.
        """
        sim = self.sim
        joints = np.ones(sim.model.nv - 6, dtype=bool)
        joints[np.array(sim.model.wheel_joint_indices) - 6] = False
        turning = float(np.linalg.norm(self._v[3:6]) + np.abs(self._v[6:][joints]).max(initial=0.0))
        turn = sim.time_step * turning
        flies = sim.settings["variant"] == "newton" and turn <= 0.1 and len(sim.contacts.gaps) == 0
        return turn**3 * max(self._before.kinetic, sim.energy().kinetic) if flies else 0.0

    def _note(self, kind: str, what: str) -> None:
        v = self.sim.v
        rates = (
            f"{np.abs(v[:3]).max():.3g} m/s, trunk {np.abs(v[3:6]).max():.3g}, joints {np.abs(v[6:]).max():.3g} rad/s"
        )
        self.ledger.note(kind, f"step {self.ledger.steps}: {what}; {rates}")

    def _stored(self, q: Array) -> float:
        off = q[self._steering] - self.sim.steering[self._steered]
        return 0.5 * float(self._stiffness @ (off * off))

    def _work(self, turned: Array) -> float:
        torques = self._signs @ self.sim.wheel_torques
        torques[6:] += self.joint_torques
        return float(torques[6:] @ turned[6:])

    def _lifted_and_released(self, steps: int) -> tuple[float, float] | None:
        """What projection and yielding wheels added over the steps, J; None where one without projection is refused."""
        sim = self.sim
        if self._twin is None:
            self._twin = Simulation(sim.model, sim.terrain, **(sim.settings | {"stabilisation": "none"}))
            self._again = Simulation(sim.model, sim.terrain, **sim.settings)
        twin, again, lifted, released = self._twin, self._again, 0.0, 0.0
        again.restore(self._start)
        # An environment gives its commands after `begin`.
        again.set_wheel_torques(sim.wheel_torques)
        again.set_steering(sim.steering)
        for _ in range(steps):
            start, q = again.snapshot(), again.q
            twin.restore(start)
            try:
                without = twin.step()
                report = again.step()
            except StepError:
                return None
            # Each by its own motors' work: the projection turns joints too.
            own = again.energy().total - self._work(again.q - q)
            without_projection = twin.energy().total - self._work(twin.q - q) - without.energy_released
            lifted += max(own - report.energy_released - without_projection, 0.0)
            released += report.energy_released
        return lifted, released


def _gains(model: RoverModel, description: dict[str, Any], joints: npt.NDArray[np.intp]) -> Array:
    """Stiffness with which joints are held, N m/rad."""
    solids = {solid["name"]: solid for solid in description["solids"]}
    return np.array([solids[model.dof_names[i]]["hold"]["stiffness"] for i in joints])


def _held_by(stiffness: Array, radius: Array, load: float) -> Array:
    """Energy in wheels that yield under a load, with the slack of the law, J."""
    return 0.5 * stiffness * (load / stiffness + 1e-5 * radius) ** 2
