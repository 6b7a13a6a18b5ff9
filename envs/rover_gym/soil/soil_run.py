"""Recordings of a soil and the saved runs read back: disk poses, wheel forces and the strongest contacts.

run = open_run("soil.h5").resample(25.0)
run.wheels[-1, 0, :2]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import SoilSimulation
from rover_gym.record.channels import (
    RESIDUAL,
    TIME,
    Channel,
    RecordingError,
    Sampler,
    energy_channels,
    sound,
)
from rover_gym.record.rover_run import LARGEST, Run, check_rows, check_time, title_of
from rover_gym.record.trajectory import Trajectory
from rover_gym.soil.bed import Array, surface_height
from rover_gym.validation import refuse

MOST_CHAINS = 2000  # strongest contacts kept per row


class _MeanForces:
    """Contact forces of a soil averaged over several steps, since single steps carry impacts."""

    def __init__(self, sim: SoilSimulation) -> None:
        self._n, self._wheels = len(sim.radius), len(sim.wheels)
        self.clear()

    def clear(self) -> None:
        """Resets the sums."""
        self._steps = 0
        self._pairs: list[npt.NDArray[np.int64]] = []
        self._points: list[Array] = []
        self._impulses: list[Array] = []

    def add(self, sim: SoilSimulation) -> None:
        """Adds the contacts of the last step."""
        contacts = sim.contacts
        pairs, normals = contacts.bodies, contacts.normals
        steep = np.abs(normals[:, 0]) > np.abs(normals[:, 1])
        pairs[:, 1] -= (pairs[:, 1] < 0) & steep  # floor and walls are two things
        self._steps += 1
        self._pairs.append(pairs)
        self._points.append(contacts.points)
        self._impulses.append(contacts.world_impulses)

    def read(self, sim: SoilSimulation, n_chains: int) -> tuple[Array, Array]:
        """Strongest contacts (n_chains, 5): x, y to x, y and a force, zero-padded; and wheel forces (n_wheels, 2)."""
        chains, on_wheels = np.zeros((n_chains, 5)), np.zeros((self._wheels, 2))
        if not self._pairs or sum(map(len, self._pairs)) == 0:
            return chains, on_wheels
        duration = self._steps * sim.time_step
        points, impulses = np.concatenate(self._points), np.concatenate(self._impulses)
        # Later entries overwrite earlier ones: a pair keeps its latest position.
        _, last, which = np.unique(np.concatenate(self._pairs)[::-1], axis=0, return_index=True, return_inverse=True)
        which, last = which.ravel()[::-1], len(which) - 1 - last
        pairs = np.concatenate(self._pairs)[last]
        forces = np.stack([np.bincount(which, impulses[:, k]) for k in range(2)], axis=1) / duration
        for wheel in range(self._wheels):
            on_wheels[wheel] = forces[pairs[:, 0] == self._n + wheel].sum(axis=0)
        strengths = np.linalg.norm(forces, axis=1)
        kept = np.argsort(-strengths, kind="stable")[:n_chains]
        kept = kept[strengths[kept] > 0.0]
        centres = np.concatenate((sim.position[:, :2], sim.wheels[:, :2]))
        (a, b), places = pairs[kept].T, points[last[kept]]
        chains[: len(kept), :2] = np.where(a[:, None] >= self._n, places, centres[a])
        chains[: len(kept), 2:4] = np.where(b[:, None] < 0, places, centres[b])
        chains[: len(kept), 4] = strengths[kept]
        return chains, on_wheels


def soil_channels(disks: int, machine: int, wheels: int, chains: int) -> tuple[Channel, ...]:
    """The channels of so many disks, coordinates of the machine, wheels and strongest contacts."""
    strongest = "strongest contacts: from x, y to x, y (m), mean force since the last row (N); zeros where none are"
    forces = "x and y of the soil on each wheel, mean since the last row"
    return (
        TIME,
        Channel("position", "m, rad", "x forward, y up, angle of each disk", (disks, 3), read="sim.position"),
        Channel("velocity", "m/s, rad/s", "their rates", (disks, 3), read="sim.velocity"),
        Channel("asleep", "1", "1 where the disk sleeps", (disks,), read="sim.asleep"),
        Channel("machine", "m, rad", "coordinates of the machine", (machine,), read="sim.machine"),
        Channel("machine_rate", "m/s, rad/s", "their rates", (machine,), read="sim.machine_rate"),
        Channel("wheels", "m", "centre x, y and radius of each wheel", (wheels, 3), read="sim.wheels"),
        Channel("wheel_forces", "N", forces, (wheels, 2), read="wheel_forces"),
        Channel("force_chains", "m, N", strongest, (chains, 5), read="force_chains"),
        *energy_channels(" of all", "all mass centres at height 0"),
        Channel("n_contacts", "1", "contacts of the last step", read="sim.contacts.__len__"),
        Channel("penetration", "m", "deepest overlap", read="sim.penetration"),
        RESIDUAL,
    )


class SoilSampler(Sampler):
    """Steps a soil from row to row and makes the rows for a `Recorder`.

    Args:
        sim: The soil.
    """

    def __init__(self, sim: SoilSimulation) -> None:
        self._forces = _MeanForces(sim)
        super().__init__(sim)
        n, wheels = len(sim.radius), len(sim.wheels)
        self._n_chains = min(n + wheels, MOST_CHAINS)
        self.channels = soil_channels(n, len(sim.machine), wheels, self._n_chains)

    def gather(self, report: object) -> None:  # noqa: ARG002 - the forces are the simulation's
        """Adds the contacts of the last step."""
        self._forces.add(self.sim)

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        super().clear()
        self._forces.clear()

    def measure(self) -> None:
        """Measures what several channels read."""
        super().measure()
        self.force_chains, self.wheel_forces = self._forces.read(self.sim, self._n_chains)

    def describe(self, title: str | None, scene: Mapping[str, Any], seed: int | str | None) -> dict[str, Any]:
        """The attributes of a recording, taken from the simulation at its start."""
        sim = self.sim
        facts = {"radius": sim.radius, "mass": sim.mass, "walls": sim.walls, "torques": sim.torques}
        return {
            "title": title or "a soil of disks",
            "scene": {**scene, "kind": "SoilSimulation", **facts},
            "seed": "the start's positions are the first row" if seed is None else seed,
            "solver": sim.settings,
        }


@dataclass(frozen=True)
class SoilRun(Run):
    """A recorded run on a soil of disks.

    Attributes:
        trajectory: The data sets and attributes of the file.
        radius: (n_disks,) m.
        walls: (n_walls, 4) a point on each wall and the normal towards its free side.
        surface: Mean height of the soil's surface at the start, m.
        title: Title of the run.
    """

    trajectory: Trajectory
    radius: Array
    walls: Array
    surface: float
    title: str

    @property
    def positions(self) -> Array:
        """(n, n_disks, 3) x, y (m) and angle (rad) of the disks."""
        return self.trajectory["position"]

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """(n, n_disks) whether each disk was asleep."""
        return self.trajectory["asleep"] > 0.0

    @property
    def wheels(self) -> Array:
        """(n, n_wheels, 3) centre and radius of the wheels, back to front, m."""
        return self.trajectory["wheels"]

    @property
    def wheel_angles(self) -> Array:
        """(n, n_wheels) wheel angles, rad, counter-clockwise positive."""
        return self.trajectory["machine"][:, 3 : 3 + self.wheels.shape[1]]

    @property
    def wheel_forces(self) -> Array:
        """(n, n_wheels, 2) x and y of the soil's force on each wheel, mean since the previous row, N."""
        return self.trajectory["wheel_forces"]

    @property
    def force_chains(self) -> Array:
        """(n, n_chains, 5) contacts as lines x, y to x, y (m) with their mean force since the previous row (N)."""
        return self.trajectory["force_chains"]

    @property
    def sinkage(self) -> Array:
        """(n, n_wheels) depth of the wheels' lowest points below the surface, m."""
        result: Array = self.surface - (self.wheels[..., 1] - self.wheels[..., 2])
        return result

    @property
    def slip_speeds(self) -> Array:
        """(n, n_wheels) rim speed minus travel speed, m/s."""
        rates = self.trajectory["machine_rate"]
        rims = -rates[:, 3 : 3 + self.wheels.shape[1]] * self.wheels[..., 2]
        result: Array = rims - rates[:, :1]
        return result


def is_soil(trajectory: Trajectory) -> bool:
    """Whether a trajectory is a soil run."""
    scene = trajectory.attributes.get("scene")
    return isinstance(scene, dict) and scene.get("kind") == "SoilSimulation"


def soil_run_of(trajectory: Trajectory, path: str | Path) -> SoilRun:
    """The soil run of a trajectory read from `path`.

    Raises:
        RecordingError: It is not a soil run, or holds no samples.
    """
    if not is_soil(trajectory) or "force_chains" not in trajectory.data:
        refuse(RecordingError, "path", str(path), "contains no soil; `rover planar soil` records such runs")
    check_time(trajectory, path)
    scene = trajectory.attributes["scene"]
    with sound(path, "scene"):
        radius = np.array(scene["radius"], dtype=np.float64).reshape(-1)
        walls = np.array(scene["walls"], dtype=np.float64).reshape(-1, 4)
    if not len(radius) or not ((radius > 0.0) & (radius <= LARGEST)).all():
        refuse(RecordingError, f"{path}: scene.radius", len(radius), "must be a positive radius for each of the disks")
    if not (np.abs(walls) <= LARGEST).all() or not np.hypot(*walls[:, 2:].T).all():
        refuse(RecordingError, f"{path}: scene.walls", len(walls), "must be a point and a normal for each wall")
    wheels, machine = (trajectory[name].shape[1] if trajectory[name].ndim > 1 else 0 for name in ("wheels", "machine"))
    if wheels > 2 or machine < 3 * bool(wheels) + wheels:
        refuse(RecordingError, f"{path}: wheels", wheels, "must be at most two, with the coordinates of their machine")
    chains = trajectory["force_chains"].shape[1] if trajectory["force_chains"].ndim == 3 else 0
    channels = soil_channels(len(radius), machine, wheels, chains)
    check_rows(trajectory, path, channels, bounded=("position", "wheels", "machine"), needed=True)
    return SoilRun(
        trajectory=trajectory,
        radius=radius,
        walls=walls,
        surface=surface_height(radius, trajectory["position"][0]),
        title=title_of(trajectory),
    )
