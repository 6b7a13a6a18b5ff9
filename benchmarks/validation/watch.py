"""Invariants measured in every step of every run: momentum balance, energy balance and no overlap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rover_gym.core import DiskSimulation, GrainSimulation

GRAVITY = 9.81


@dataclass
class Ledger:
    """The worst of all steps that were watched; several can be merged.

    Attributes:
        steps: How many were watched.
        disk_steps: Disks times steps.
        unconverged: Steps whose contacts were not solved to the tolerance.
        residual: Largest residual of the contact solver, relative.
        overlap: Deepest overlap after a step, in radii of the smallest disk.
        momentum: Largest error of a step's momentum balance, relative to the momenta and impulses in it.
        gain: Largest growth of the energy in one step, in units of the weight of a mean disk times its diameter.
        growth: All growth of the energy together, J.
        spent: How much energy the runs lost from their beginnings to their ends, J.
    """

    steps: int = 0
    disk_steps: int = 0
    unconverged: int = 0
    residual: float = 0.0
    overlap: float = 0.0
    momentum: float = 0.0
    gain: float = 0.0
    growth: float = 0.0
    spent: float = 0.0

    def merge(self, other: Ledger) -> None:
        """Takes another run in."""
        for name in ("steps", "disk_steps", "unconverged", "growth", "spent"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("residual", "overlap", "momentum", "gain"):
            setattr(self, name, max(getattr(self, name), getattr(other, name)))

    @property
    def regained(self) -> float:
        """Growth of the energy, as a share of what was lost."""
        return self.growth / self.spent if self.spent > 0.0 else 0.0

    def as_dict(self) -> dict[str, float]:
        """For a JSON file."""
        return asdict(self) | {"regained": self.regained}


class Watched:
    """Disks or balls that are stepped under watch.

    Args:
        sim: The simulation.
        diameter: Mean diameter, m.
        has_energy: False where kinematic disks move and do work: the energy is not looked at then.
    """

    def __init__(
        self, sim: DiskSimulation | GrainSimulation, diameter: float = 1.0, *, has_energy: bool = True
    ) -> None:
        self.sim, self.diameter = sim, diameter
        self.ledger = Ledger()
        #: Impulse of kinematic disks on the free ones in the last step, N s.
        self.from_kinematic = np.zeros(len(sim.settings["gravity"]))
        self._has_energy = has_energy
        self._look()

    def _look(self) -> None:
        sim = self.sim
        self._free = ~sim.kinematic
        self._mass = sim.mass[self._free]
        self._gravity = np.array(sim.settings["gravity"])
        weight = float(np.linalg.norm(self._gravity)) or GRAVITY
        self._unit = weight * float(self._mass.mean()) * 2.0 * float(sim.radius[self._free].mean())
        self._smallest = float(sim.radius[self._free].min())
        self._energy = self._total()

    def _total(self) -> float:
        energy = self.sim.energy()
        return float(energy.kinetic + energy.potential)

    def restart(self) -> None:
        """After the state was set from outside: what that did to the energy is not counted."""
        self._look()

    def remove(self, which: np.ndarray) -> None:
        """Removes disks (n,); their energy no longer counts."""
        if which.any():
            self.sim.remove(which)
            self._look()

    def step(self, n: int = 1) -> None:
        """Takes n steps, one by one."""
        for _ in range(n):
            before = self.sim.momentum()[: len(self._gravity)]
            report = self.sim.step()
            self._enter(report.residual, is_converged=report.is_converged)
            self._weigh(before)

    def _enter(self, residual: float, *, is_converged: bool) -> None:
        ledger = self.ledger
        if self._has_energy:
            energy = self._total()
            growth = max(0.0, energy - self._energy)
            ledger.growth += growth
            ledger.spent += self._energy - energy
            ledger.gain = max(ledger.gain, growth / self._unit)
            self._energy = energy
        ledger.overlap = max(ledger.overlap, self.sim.penetration() / self._smallest)
        ledger.residual = max(ledger.residual, residual)
        ledger.unconverged += not is_converged
        ledger.steps += 1
        ledger.disk_steps += len(self._mass)

    def _weigh(self, before: np.ndarray) -> None:
        """The momentum balance of the last step: gravity, walls, ground, kinematic disks, and nothing else."""
        contacts = self.sim.contacts
        bodies, impulse = contacts.bodies, contacts.world_impulses
        free = np.append(self._free, [False])  # number -1: walls and ground
        first, second = free[bodies[:, 0]], free[bodies[:, 1]]
        on_first, on_second = first & ~second, second & ~first
        by_kinematic = on_first & (bodies[:, 1] >= 0)
        self.from_kinematic = impulse[by_kinematic].sum(axis=0) - impulse[on_second].sum(axis=0)
        outside = impulse[on_first].sum(axis=0) - impulse[on_second].sum(axis=0)
        pull = self.sim.time_step * float(self._mass.sum()) * self._gravity
        error = np.abs(self.sim.momentum()[: len(pull)] - before - outside - pull).max()
        speeds = np.abs(self.sim.velocity[self._free, : len(pull)]).max(axis=1)
        scale = float(np.abs(impulse).sum() + np.abs(pull).sum() + self._mass @ speeds)
        if scale > 0.0:
            self.ledger.momentum = max(self.ledger.momentum, float(error) / scale)


def slow(watched: Watched, speed: float = 0.01) -> bool:
    """Whether the free grains' root mean square speed is below `speed` times the root of 9.81 times their diameter."""
    sim = watched.sim
    mass = float(sim.mass[~sim.kinematic].sum())
    return bool(np.sqrt(2.0 * sim.energy().kinetic / mass) < speed * np.sqrt(GRAVITY * watched.diameter))


def settle(watched: Watched, *, least: float, most: float, speed: float = 0.01) -> None:
    """Steps until the grains are `slow`, for `least` seconds at least and `most` at most."""
    every = 0.05
    elapsed = 0.0
    while elapsed < least or (elapsed < most and not slow(watched, speed)):
        watched.step(round(every / watched.sim.time_step))
        elapsed += every


def run_off(watched: Watched, *, looks: int, most: float) -> None:
    """Removes grains that fall below the floor, until the others are slow at so many looks in turn or for `most` s."""
    sim, quiet = watched.sim, 0
    while sim.time < most and quiet < looks:
        watched.step(round(0.05 / sim.time_step))
        fallen = sim.position[:, 1] < -2.0 * watched.diameter
        watched.remove(fallen)
        quiet = quiet + 1 if slow(watched) and not fallen.any() else 0


def fly(watched: Watched, steps: int) -> dict[str, float]:
    """Takes steps: how much of the kinetic energy is lost, and how much all growth of the energy adds up to."""
    start = watched.sim.energy().kinetic
    watched.step(steps)
    return {"lost": 1.0 - watched.sim.energy().kinetic / start, "grown": watched.ledger.growth / start}


def meet(watched: Watched, duration: float) -> dict[str, float]:
    """Lets clouds meet: relative changes of their momentum and its moment, and the share of energy that is left."""
    sim, d = watched.sim, len(watched.sim.settings["gravity"])
    x, v = np.zeros((2, len(sim.radius), 3))
    x[:, :d], v[:, :d] = sim.position[:, :d], sim.velocity[:, :d]
    sizes = (float(sim.mass @ np.linalg.norm(of, axis=1)) for of in (v, np.cross(x, v)))
    before, kinetic = sim.momentum(), sim.energy().kinetic
    watched.step(round(duration / sim.time_step))
    change = np.abs(sim.momentum() - before)
    parts = (change[:d], change[d:])
    momentum, moment = (float(part.max()) / size for part, size in zip(parts, sizes, strict=True))
    left = float(sim.energy().kinetic / kinetic)
    return {"momentum_error": momentum, "moment_error": moment, "energy_left": left}


def line(x: np.ndarray, y: np.ndarray) -> dict[str, float]:
    """The straight line through points: its value at 0 with the standard error, and its slope with its own."""
    (slope, value), covariance = np.polyfit(x, y, 1, cov=True)
    slope_error, error = np.sqrt(np.diag(covariance))
    return {"value": float(value), "error": float(error), "slope": float(slope), "slope_error": float(slope_error)}


def means_by(
    runs: list[dict[str, Any]], key: str, values: Iterable[float], errors: Mapping[str, str], others: Iterable[str] = ()
) -> list[dict[str, float]]:
    """A row for each value of a key: means over the runs that have it, some with their standard errors.

    Args:
        runs: The runs.
        key: What is told apart.
        values: Of the key.
        errors: Names of the quantities, and of their standard errors.
        others: Quantities of which the mean is enough.
    """
    rows = []
    for value in values:
        chosen = [run for run in runs if run[key] == value]
        row = {key: value} | {name: float(np.mean([run[name] for run in chosen])) for name in (*errors, *others)}
        for name, error in errors.items():
            row[error] = float(np.std([run[name] for run in chosen], ddof=1) / np.sqrt(len(chosen)))
        rows.append(row)
    return rows
