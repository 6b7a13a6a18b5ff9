"""Saved runs of balls in space, read back: places of the balls, the rover among them, and its ruts.

run = open_run("grains.h5").resample(25.0)
run.positions[-1, :, 1].max()
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.grains.grain_recording import KIND, grain_channels
from rover_gym.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.grains.stored_vessel import checked_vessel
from rover_gym.mechanics import Plane, RoverModel
from rover_gym.record.rover_run import LARGEST, RoverRun, Run, check_rows, check_time, title_of
from rover_gym.record.trajectory import Trajectory, read_frames
from rover_gym.record.trajectory_format import RecordingError, sound
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from rover_gym.mechanics import Terrain

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GrainRun(Run):
    """A recorded run of balls, alone or under a rover.

    Attributes:
        path: The file; the balls' places are read from it when they are first asked for.
        trajectory: The other data sets, and the attributes of the file.
        rows: (n,) indices of the samples in the file.
        radius: (n_balls,) m.
        mass: (n_balls,) kg.
        kinematic: (n_balls,) whether no force moves the ball.
        terrain: The fixed ground; None if there is none but the walls.
        model: The rover; None without one.
        vessel: The drum or silo around the balls, by the names of its properties, with its `kind`; None without one.
        title: Title of the run.
    """

    path: Path
    trajectory: Trajectory
    rows: npt.NDArray[np.int64]
    radius: Array
    mass: Array
    kinematic: npt.NDArray[np.bool_]
    terrain: Terrain | None
    model: RoverModel | None
    vessel: Mapping[str, Any] | None
    title: str

    @cached_property
    def positions(self) -> npt.NDArray[np.float32]:
        """(n, n_balls, 3) centres, m.

        Raises:
            RecordingError: They take more than 4 GiB, or the file is damaged or has changed.
        """
        return self.positions_of(self.rows)

    def positions_of(self, rows: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """(n_rows, n_balls, 3) centres in some samples of the file, m.

        Args:
            rows: Increasing indices of samples in the file.

        Raises:
            RecordingError: They take more than 4 GiB, or the file is damaged or has changed.
        """
        places = read_frames(self.path, "position", rows)
        if places.shape[1:] != (len(self.radius), 3):
            reason = f"must have rows of shape {(len(self.radius), 3)}"
            refuse(RecordingError, f"{self.path}: frames/position", places.shape[1:], reason)
        if not (np.abs(places) <= LARGEST).all():
            refuse(RecordingError, f"{self.path}: frames/position", "a place", f"must be finite and within {LARGEST:g}")
        return places

    @property
    def walls(self) -> Array:
        """(n, n_walls, 6) a point of each wall and the normal to its free side."""
        return self.trajectory["walls"]

    @cached_property
    def rover(self) -> RoverRun | None:
        """The rover's part of the run, with the poses of its solids; None without one."""
        if self.model is None or self.terrain is None:
            return None
        return RoverRun(self.trajectory, self.model, self.terrain, None, self.title)

    @property
    def wheel_centres(self) -> Array:
        """(n, n_wheels, 3) m.

        Raises:
            RecordingError: The run has no rover.
        """
        return self.trajectory["wheel_centres"]

    @property
    def wheel_forces(self) -> Array:
        """(n, n_wheels, 3) force of balls and ground on each wheel, world, mean since the previous sample, N.

        Raises:
            RecordingError: The run has no rover.
        """
        return self.trajectory["wheel_forces"]

    @cached_property
    def first_surface(self) -> SurfaceMap:
        """The surface of the balls at the file's first sample."""
        return surface_map(self.positions_of([0])[0], self.radius)

    @cached_property
    def sinkage(self) -> Array:
        """(n, n_wheels) depth of the wheels' lowest points below the first surface over them, m; nan beside it.

        Raises:
            RecordingError: The run has no rover.
        """
        centres = self.wheel_centres
        radii = np.zeros(0) if self.model is None else np.asarray(self.model.wheel_radii)
        width = max(4.0 * float(self.radius.mean()), float(radii.max(initial=0.0)))
        surface = self.first_surface.at(centres[..., [0, 2]], width=width)
        result: Array = surface - (centres[..., 1] - radii)
        return result

    def at(self, rows: npt.NDArray[np.int64]) -> GrainRun:
        """Some samples of the run, by their indices `(n,)`."""
        return replace(self, trajectory=self.trajectory.at(rows), rows=self.rows[rows])


def is_grains(trajectory: Trajectory) -> bool:
    """Whether a trajectory is a run of balls in space."""
    scene = trajectory.attributes.get("scene")
    return isinstance(scene, dict) and scene.get("kind") == KIND


def grain_run_of(trajectory: Trajectory, path: str | Path) -> GrainRun:
    """The run of balls of a trajectory read from `path`.

    Raises:
        RecordingError: It is not a run of balls, or holds no samples.
    """
    if not is_grains(trajectory):
        refuse(RecordingError, "path", str(path), "holds no balls in space: `rover grains` writes such runs")
    check_time(trajectory, path)
    scene = trajectory.attributes["scene"]
    radius, mass, kinematic = (_of_balls(trajectory, path, name) for name in ("radius", "mass", "kinematic"))
    if not len(radius) or not ((radius > 0.0) & (radius <= LARGEST)).all() or len(radius) != len(mass):
        refuse(RecordingError, f"{path}: grain_radius", len(radius), "must be a positive radius for each of the balls")
    if len(kinematic) != len(radius):
        refuse(RecordingError, f"{path}: grain_kinematic", len(kinematic), "must have an entry for each of the balls")
    model = None
    if "model" in scene:
        with sound(path, "scene.model"):
            model = RoverModel.from_dict(scene["model"])
    with sound(path, "scene.vessel"):
        vessel = checked_vessel(scene.get("vessel"))
    walls = trajectory["walls"].shape[1] if trajectory["walls"].ndim == 3 else 0
    channels = grain_channels(len(radius), walls, model)
    check_rows(trajectory, path, channels, bounded=("walls", "q", "v", "wheel_centres"), needed=True)
    return GrainRun(
        path=Path(path),
        trajectory=trajectory,
        rows=np.arange(len(trajectory["time"])),
        radius=radius,
        mass=mass,
        kinematic=kinematic > 0.0,
        terrain=Plane() if model is not None and trajectory.terrain is None else trajectory.terrain,
        model=model,
        vessel=vessel,
        title=title_of(trajectory),
    )


def _of_balls(trajectory: Trajectory, path: str | Path, name: str) -> Array:
    value = trajectory.attributes.get(f"grain_{name}")
    if not isinstance(value, np.ndarray) or value.ndim != 1:
        refuse(RecordingError, f"{path}: grain_{name}", value, "must be an array with an entry for each of the balls")
    result: Array = value.astype(np.float64)
    return result
