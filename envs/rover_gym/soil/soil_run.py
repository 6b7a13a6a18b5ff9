"""Saved runs on a soil, read back: disk and wheel poses, and the forces of the soil on the wheels.

run = open_run("soil.h5").resample(25.0)
run.wheels[-1, 0, :2]
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_gym.record.rover_run import LARGEST, Run, check_rows, check_time, title_of
from rover_gym.record.trajectory import Trajectory
from rover_gym.record.trajectory_format import RecordingError, sound
from rover_gym.soil.bed import surface_height
from rover_gym.soil.soil_recording import soil_channels
from rover_gym.validation import refuse

__all__ = ["SoilRun", "is_soil", "soil_run_of"]

Array = npt.NDArray[np.float64]


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
        refuse(RecordingError, "path", str(path), "holds no soil: `rover planar soil` writes one")
    check_time(trajectory, path)
    scene = trajectory.attributes["scene"]
    with sound(path, "scene"):
        radius = np.array(scene["radius"], dtype=np.float64).reshape(-1)
        walls = np.array(scene["walls"], dtype=np.float64).reshape(-1, 4)
    if not len(radius) or not ((radius > 0.0) & (radius <= LARGEST)).all():
        refuse(RecordingError, f"{path}: scene.radius", len(radius), "must be a positive radius for each of the disks")
    if not (np.abs(walls) <= LARGEST).all() or not np.hypot(*walls[:, 2:].T).all():
        refuse(RecordingError, f"{path}: scene.walls", len(walls), "must be points with normals, for each of the walls")
    wheels, machine = (trajectory[name].shape[1] if trajectory[name].ndim > 1 else 0 for name in ("wheels", "machine"))
    if wheels > 2 or machine < 3 * bool(wheels) + wheels:
        refuse(RecordingError, f"{path}: wheels", wheels, "must be none, one or two, with their machine's coordinates")
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
