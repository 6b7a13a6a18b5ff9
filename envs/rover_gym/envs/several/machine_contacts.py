"""What the contacts of a joined simulation mean for each machine: slip, load on the hull, pushes of the others."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from rover_gym.core import Contacts, RoverModel, Simulation
from rover_gym.envs.observation import Array
from rover_gym.envs.start import SLIP_SPEED, drive_signs

#: Kinds of contacts of solids that are no wheels.
BODY_KINDS = frozenset({"box", "sphere", "collider"})


class MachineContacts:
    """Sums over contacts for each machine of a joined model.

    Args:
        model: The joined model.

    Attributes:
        wheels: Wheels of each machine.
    """

    def __init__(self, model: RoverModel) -> None:
        machines = list(model.machines.values())
        self.n = len(machines)
        self.wheels = [machine.wheels for machine in machines]
        self._machine_of = {solid: k for k, machine in enumerate(machines) for solid in machine.solids}
        self._machine_of_wheel = np.repeat(range(self.n), [w.stop - w.start for w in self.wheels])
        self._joints = np.asarray(model.wheel_joint_indices)
        self._signs, self._radii = drive_signs(model), model.wheel_radii

    def work(self, simulation: Simulation, before: Array) -> Array:
        """Work of each wheel's drive in the last step, (n_wheels,), J.

        Args:
            simulation: All machines after the step.
            before: Their velocities before it, (nv,).
        """
        rates = 0.5 * (before + simulation.v)[self._joints] * self._signs
        return np.asarray(simulation.motor_torques * rates * simulation.time_step)

    def slip_ratios(self, simulation: Simulation) -> npt.NDArray[np.float64]:
        """Mean over each machine's wheel contacts of rim slip over the faster of rim and ground, (n,)."""
        contacts = simulation.contacts
        wheels = contacts.wheels
        touching = wheels >= 0
        wheels = wheels[touching]
        rim = (self._radii * self._signs * simulation.v[self._joints])[wheels]
        along, across = contacts.velocities[touching, 1:].T
        faster = np.maximum(np.abs(rim), np.hypot(rim + along, across))
        ratios = np.hypot(along, across) / np.maximum(faster, SLIP_SPEED)
        sand = simulation.sand()
        if sand is not None:
            sunk = np.flatnonzero(sand["force"].any(axis=1))
            wheels, ratios = np.append(wheels, sunk), np.append(ratios, sand["slip"][sunk])
        of = self._machine_of_wheel[wheels]
        total, count = np.bincount(of, ratios, self.n), np.bincount(of, minlength=self.n)
        return np.asarray(total / np.maximum(count, 1))

    def ground_forces(self, simulation: Simulation) -> Array:
        """Mean normal force of the ground in the last step on all solids of each machine but its wheels, (n,), N."""
        contacts = simulation.contacts
        sums = np.zeros(self.n)
        for i in np.flatnonzero(contacts.wheels < 0).tolist():
            if contacts.kinds[i] in BODY_KINDS and contacts.others[i] is None:
                sums[self._machine_of[contacts.bodies[i]]] += contacts.impulses[i, 0]
        return sums / simulation.time_step

    def pushes(self, contacts: Contacts) -> Iterator[tuple[int, int, Array]]:
        """Yields a machine, another one, and the impulse of a contact on the first, (3,), world frame, N s."""
        others = contacts.others
        if not any(others):
            return
        for i, (body, other) in enumerate(zip(contacts.bodies, others, strict=True)):
            if other is None or self._machine_of[body] == self._machine_of[other]:
                continue
            yield self._machine_of[body], self._machine_of[other], contacts.impulses[i] @ contacts.frames[i]
