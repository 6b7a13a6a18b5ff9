"""What must hold in every step of every run: momentum, energy, no overlap. Measured while a soil is stepped."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from rover_gym._core import SoilSimulation


@dataclass
class Ledger:
    """The worst of all steps that were watched; several can be merged.

    Attributes:
        steps: How many were watched.
        disk_steps: Disks times steps.
        unconverged: Steps whose contacts were not solved to the tolerance.
        residual: Largest residual of the contact solver, relative.
        overlap: Deepest overlap after a step, in radii of the smallest disk.
        momentum: Largest error of a step's momentum balance, relative to what gravity and the outside gave in it and to
            what the disks have.
        gain: Largest growth of the energy in one step, in units of the weight of a mean disk times its diameter.
        gained: All growth of a run together, relative to the largest energy that it had above its end.
    """

    steps: int = 0
    disk_steps: int = 0
    unconverged: int = 0
    residual: float = 0.0
    overlap: float = 0.0
    momentum: float = 0.0
    gain: float = 0.0
    gained: float = 0.0

    def merge(self, other: Ledger) -> None:
        """Takes another run in."""
        for name in ("steps", "disk_steps", "unconverged"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("residual", "overlap", "momentum", "gain", "gained"):
            setattr(self, name, max(getattr(self, name), getattr(other, name)))

    def as_dict(self) -> dict[str, float]:
        """For a JSON file."""
        return asdict(self)


class Watched:
    """A soil that is stepped under watch.

    Args:
        sim: The soil.
        gravity: m/s^2, downward.
    """

    def __init__(self, sim: SoilSimulation, gravity: float = 9.81) -> None:
        self.sim = sim
        self.ledger = Ledger()
        self._free = ~sim.kinematic
        self._weight = gravity * float(sim.mass[self._free].sum())
        mean = gravity * float(sim.mass[self._free].mean()) * 2.0 * float(sim.radius[self._free].mean())
        self._unit = mean if mean > 0.0 else 1.0
        self._smallest = float(sim.radius[self._free].min())
        #: Impulse of walls, ground and kinematic disks on the free ones in the last step, N s.
        self.outside = np.zeros(2)
        #: Of it what came from kinematic disks alone, N s.
        self.from_kinematic = np.zeros(2)
        self._growth = 0.0
        self._highest = self._energy = self._total()

    def _total(self) -> float:
        energy = self.sim.energy()
        return float(energy.kinetic + energy.potential)

    def _gather_outside(self) -> float:
        """Sums the impulses from outside; returns the sum of their sizes."""
        contacts = self.sim.contacts
        bodies, impulse = contacts.bodies, contacts.world_impulses
        free = np.append(self._free, False)  # noqa: FBT003 - number -1: walls and ground
        first, second = free[bodies[:, 0]], free[bodies[:, 1]]
        on_first = first & ~second
        on_second = second & ~first
        self.from_kinematic = (
            impulse[on_first & (bodies[:, 1] >= 0)].sum(axis=0) - impulse[on_second].sum(axis=0)
        )
        self.outside = impulse[on_first].sum(axis=0) - impulse[on_second].sum(axis=0)
        return float(np.abs(impulse[on_first | on_second]).sum())

    def step(self, n: int = 1) -> None:
        """Takes n steps, one by one."""
        ledger = self.ledger
        for _ in range(n):
            before = self.sim.momentum()[:2]
            report = self.sim.step()
            sizes = self._gather_outside()
            h = self.sim.time_step
            expected = before + self.outside + np.array([0.0, -h * self._weight])
            after = self.sim.momentum()[:2]
            speed = np.abs(self.sim.velocity[self._free, :2]) * self.sim.mass[self._free, None]
            scale = sizes + h * self._weight + float(speed.sum())
            if scale > 0.0:
                ledger.momentum = max(ledger.momentum, float(np.abs(after - expected).max()) / scale)
            energy = self._total()
            growth = max(0.0, energy - self._energy)
            self._growth += growth
            self._energy = energy
            self._highest = max(self._highest, energy)
            ledger.gain = max(ledger.gain, growth / self._unit)
            ledger.overlap = max(ledger.overlap, self.sim.penetration() / self._smallest)
            ledger.residual = max(ledger.residual, report.residual)
            ledger.unconverged += not report.is_converged
            ledger.steps += 1
            ledger.disk_steps += int(self._free.sum())
        spent = self._highest - self._energy
        ledger.gained = self._growth / spent if spent > 0.0 else 0.0
