"""Recordings of disks and the saved runs read back: disk poses, wheel forces and the strongest contacts.

run = open_run("disks.h5").resample(25.0)
run.wheels[-1, 0, :2]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core import DiskSimulation
from rover_gym.core.validation import checked, refuse
from rover_gym.ground.grains.disk_bed import surface_height
from rover_gym.record.bed_run import bed_channels, strongest_contacts
from rover_gym.record.channels import TIME, Channel, RecordingError, Sampler, sound
from rover_gym.record.run import Array, Run, are_sizes, check_rows, is_moderate, rim_slip, width_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rover_gym.record.trajectory import Trajectory

MOST_CHAINS = 2000  # strongest contacts kept per row

#: What files say of disks; those of earlier versions say the second.
KINDS = ("DiskSimulation", "SoilSimulation")


def disk_channels(disks: int, machine: int, wheels: int, chains: int) -> tuple[Channel, ...]:
    """The channels of so many disks, coordinates of the machine, wheels and strongest contacts."""
    strongest = ": from x, y to x, y (m), mean force since the last row"
    forces = "x and y of the force of disks and ground on each wheel, mean since the last row"
    return (
        TIME,
        Channel("position", "m, rad", "x forward, y up, angle of each disk", (disks, 3), read="sim.position"),
        Channel("velocity", "m/s, rad/s", "their rates", (disks, 3), read="sim.velocity"),
        Channel("asleep", "1", "1 where the disk sleeps", (disks,), read="sim.asleep"),
        Channel("machine", "m, rad", "coordinates of the machine", (machine,), read="sim.machine"),
        Channel("machine_rate", "m/s, rad/s", "their rates", (machine,), read="sim.machine_rate"),
        Channel("wheels", "m", "centre x, y and radius of each wheel", (wheels, 3), read="sim.wheels"),
        Channel("wheel_forces", "N", forces, (wheels, 2), read="wheel_forces"),
        *bed_channels((chains, 5), strongest, "contacts of the last step"),
    )


class DiskSampler(Sampler):
    """Steps disks from row to row and makes the rows for a `Recorder`.

    Forces are means over the steps of a row, since single steps carry impacts.

    Args:
        sim: The disks.
    """

    title = "disks in the plane"
    without_seed = "the start's positions are the first row"

    @checked(sim="DiskSimulation")
    def __init__(self, sim: DiskSimulation) -> None:
        super().__init__(sim)
        n, wheels = len(sim.radius), len(sim.wheels)
        self._n_chains = min(n + wheels, MOST_CHAINS)
        self.channels = disk_channels(n, len(sim.machine), wheels, self._n_chains)

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        super().clear()
        self._pairs: list[npt.NDArray[np.int64]] = []
        self._points: list[Array] = []
        self._impulses: list[Array] = []

    def gather(self, report: object) -> None:  # noqa: ARG002 - the forces are the simulation's
        """Adds the contacts of the last step."""
        contacts = self.sim.contacts
        pairs, normals = contacts.bodies, contacts.normals
        steep = np.abs(normals[:, 0]) > np.abs(normals[:, 1])
        pairs[:, 1] -= (pairs[:, 1] < 0) & steep  # floor and walls are two things
        self._pairs.append(pairs)
        self._points.append(contacts.points)
        self._impulses.append(contacts.world_impulses)

    def measure(self) -> None:
        """Measures what several channels read: strongest contacts, and forces (n_wheels, 2) on the wheels."""
        super().measure()
        n, wheels = len(self.sim.radius), len(self.sim.wheels)
        self.force_chains, self.wheel_forces = np.zeros((self._n_chains, 5)), np.zeros((wheels, 2))
        if sum(map(len, self._pairs)) == 0:
            return
        every, points = np.concatenate(self._pairs), np.concatenate(self._points)
        impulses = np.concatenate(self._impulses)
        # Later entries overwrite earlier ones: a pair keeps its latest position.
        _, last, which = np.unique(every[::-1], axis=0, return_index=True, return_inverse=True)
        which, last = which.ravel()[::-1], len(which) - 1 - last
        duration = self.steps * self.sim.time_step
        forces = np.stack([np.bincount(which, impulses[:, k]) for k in range(2)], axis=1) / duration
        pairs = every[last]
        for wheel in range(wheels):
            self.wheel_forces[wheel] = forces[pairs[:, 0] == n + wheel].sum(axis=0)
        strengths = np.linalg.norm(forces, axis=1)
        self.force_chains = strongest_contacts(self._n_chains, pairs, points[last], strengths, self.sim.position)

    def n_contacts(self) -> int:
        """Contacts of the last step."""
        return len(self.sim.contacts)

    def scene(self) -> dict[str, Any]:
        """The disks, the walls and the torques at the start."""
        sim = self.sim
        return {"kind": KINDS[0], "radius": sim.radius, "mass": sim.mass, "walls": sim.walls, "torques": sim.torques}


@dataclass(frozen=True)
class DiskRun(Run):
    """A recorded run of disks, alone or under a machine.

    Attributes:
        trajectory: The data sets and attributes of the file.
        radius: (n_disks,) m.
        walls: (n_walls, 4) a point on each wall and the normal towards its free side.
        surface: Mean height of the surface of the disks at the start, m.
    """

    MISSING = "contains no disks; `rover planar disks` records such runs"
    NEEDED = ("force_chains",)

    radius: Array
    walls: Array
    surface: float

    @classmethod
    def is_scene(cls, scene: Mapping[str, Any]) -> bool:
        """Whether a file with this scene is a run of disks."""
        return scene.get("kind") in KINDS

    @classmethod
    def _checked(cls, trajectory: Trajectory, path: str | Path) -> Self:
        with sound(path, "scene"):
            radius = np.array(trajectory.scene["radius"], dtype=np.float64).reshape(-1)
            walls = np.array(trajectory.scene["walls"], dtype=np.float64).reshape(-1, 4)
        if not are_sizes(radius):
            reason = "must be a positive radius for each of the disks"
            refuse(RecordingError, f"{path}: scene.radius", len(radius), reason)
        if not is_moderate(walls) or not np.hypot(*walls[:, 2:].T).all():
            refuse(RecordingError, f"{path}: scene.walls", len(walls), "must be a point and a normal for each wall")
        wheels, machine = width_of(trajectory, "wheels", 3), width_of(trajectory, "machine", 2)
        if wheels > 2 or machine < 3 * bool(wheels) + wheels:
            reason = "must be at most two, with the coordinates of their machine"
            refuse(RecordingError, f"{path}: wheels", wheels, reason)
        channels = disk_channels(len(radius), machine, wheels, width_of(trajectory, "force_chains", 3))
        check_rows(trajectory, path, channels, bounded=("position", "wheels", "machine"), needed=True)
        return cls(trajectory, radius, walls, surface_height(radius, trajectory["position"][0]))

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
        """(n, n_wheels, 2) force of disks and ground on each wheel, mean since the previous row, N."""
        return self.trajectory["wheel_forces"]

    @property
    def force_chains(self) -> Array:
        """(n, n_chains, 5) contacts as lines x, y to x, y (m) with their mean force since the previous row (N)."""
        return self.trajectory["force_chains"]

    @property
    def sinkage(self) -> Array:
        """(n, n_wheels) depth of the wheels' lowest points below the surface, m."""
        return self.surface - (self.wheels[..., 1] - self.wheels[..., 2])

    @property
    def slip_speeds(self) -> Array:
        """(n, n_wheels) rim speed minus travel speed, m/s."""
        wheels = self.wheels
        return rim_slip(self.trajectory["machine_rate"], slice(3, 3 + wheels.shape[1]), wheels[..., 2])
