"""A saved run, read back: where every solid of the rover was, over the ground that it drove on.

run = read_run("episode-0.h5").resample(25.0)
run.positions[-1, run.model.solid_names.index("trunk")]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym._core import Plane, RoverModel, SphereField
from rover_gym.recording import RecordingError, Trajectory, read_trajectory
from rover_gym.validation import number, refuse

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Run:
    """A recorded run with its rover and its ground.

    Attributes:
        trajectory: The data sets and attributes of the file.
        model: The rover that drove.
        terrain: The ground.
        goal: Goal on the map, (x, z), m, or None where the run had none.
        title: What was run, in words.
    """

    trajectory: Trajectory
    model: RoverModel
    terrain: Plane | SphereField
    goal: tuple[float, float] | None
    title: str

    @property
    def n_frames(self) -> int:
        """How many samples the run has."""
        return len(self.time)

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """(n,) time of the samples, s."""
        return self.trajectory["time"]

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """(n, n_solids, 3) origins of the solids, world, m, in the order of `model.solid_names`."""
        return self._poses[0]

    @property
    def rotations(self) -> npt.NDArray[np.float64]:
        """(n, n_solids, 3, 3) rotation matrices that turn the solids' coordinates into the world's."""
        return self._poses[1]

    @cached_property
    def _poses(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        names = self.model.solid_names
        positions = np.empty((self.n_frames, len(names), 3))
        rotations = np.empty((self.n_frames, len(names), 3, 3))
        for row, q in enumerate(self.trajectory["q"]):
            poses = self.model.poses(q, "state")
            for i, name in enumerate(names):
                positions[row, i], rotations[row, i] = poses[name]
        return positions, rotations

    def resample(self, fps: float) -> Run:
        """The run with the samples that lie nearest to the times of a film's frames, none of them twice.

        Args:
            fps: Frames a second; where the run has fewer, it keeps all that it has.

        Raises:
            OptionError: `fps` is not a positive number.
        """
        rows = film_rows(self.time, fps)
        data = {name: values[rows] for name, values in self.trajectory.data.items()}
        return replace(self, trajectory=replace(self.trajectory, data=data))


def film_rows(time: npt.NDArray[np.float64], fps: float) -> npt.NDArray[np.int64]:
    """Numbers of the samples that lie nearest to the times of a film's frames, none of them twice.

    Args:
        time: (n,) of the samples, s.
        fps: Frames a second.

    Raises:
        OptionError: `fps` is not a positive number.
    """
    fps = number("fps", fps, above=0.0)
    frames = np.floor((time[-1] - time[0]) * fps + 1e-6)  # a run of 2 s that ends at 1.999999999 s has its last
    wanted = time[0] + np.arange(int(frames) + 1) / fps
    between = 0.5 * (time[1:] + time[:-1])
    return np.unique(np.searchsorted(between, wanted))


def read_run(path: str | Path) -> Run:
    """Reads a run that `rover drive --output` or `rover report` saved, complete or not.

    Raises:
        RecordingError: The file is no trajectory, or holds no samples, rover or ground.
        ModelError: The rover in the file is not one.
        OSError: The file is not there or cannot be read.
        MissingExtraError: h5py is not installed.
    """
    return run_of(read_trajectory(path), path)


def run_of(trajectory: Trajectory, path: str | Path) -> Run:
    """The run in a trajectory that was read from `path`.

    Raises:
        RecordingError: It holds no samples, rover or ground.
        ModelError: The rover in it is not one.
    """
    scene = trajectory.attributes.get("scene", {})
    if "q" not in trajectory.data or "model" not in scene:
        refuse(RecordingError, "path", str(path), "holds no rover: neither `q` nor `scene.model` may be missing")
    if trajectory.terrain is None:
        refuse(RecordingError, "path", str(path), "holds no ground: the group `terrain` is missing")
    if len(trajectory["time"]) == 0:
        refuse(RecordingError, "path", str(path), "holds no samples: the run was killed before the first were written")
    goal = scene.get("goal")
    return Run(
        trajectory=trajectory,
        model=RoverModel.from_dict(scene["model"]),
        terrain=trajectory.terrain,
        goal=None if goal is None else (float(goal[0]), float(goal[1])),
        title=str(trajectory.attributes.get("title", "a run")),
    )
