"""A saved run of a rover: the poses of all solids over time, and the ground.

run = read_run("episode-0.h5").resample(25.0)
run.positions[-1, run.model.solid_names.index("trunk")]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rover_gym.core import RoverModel, Terrain
from rover_gym.core.validation import number, refuse, vector
from rover_gym.ground.terrain_parts import sand_of
from rover_gym.record.channels import Channel, RecordingError, RoverSampler, sound
from rover_gym.record.run import LARGEST, Array, Run, check_rows
from rover_gym.record.trajectory import Trajectory, read_trajectory

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

#: Channels that the recordings of episodes have besides the simulation's.
OF_EPISODES = (
    Channel("distance_to_goal", "m", "horizontal distance from the trunk's origin to the goal"),
    Channel("slip_ratio", "1", "mean over the wheels in contact of rim slip over the faster of rim and ground"),
    Channel("motor_energy", "J", "work through the wheel motors since the start, driving or braking"),
)


@dataclass(frozen=True)
class RoverRun(Run):
    """A recorded run with its rover and its ground.

    Attributes:
        trajectory: The data sets and attributes of the file.
        model: The rover that drove.
        terrain: The ground.
        goal: Goal on the map, (x, z), m; None if the run had none.
        goal_tolerance: Distance from the goal at which it counts as reached, m; None if the file does not say it.
    """

    MISSING = "contains no rover: `q` or `scene.model` is missing"
    NEEDED = ("q",)

    model: RoverModel
    terrain: Terrain
    goal: tuple[float, float] | None
    goal_tolerance: float | None = None

    @classmethod
    def is_scene(cls, scene: Mapping[str, Any]) -> bool:
        """Whether a file with this scene is a run of a rover on a ground."""
        return isinstance(scene.get("model"), dict)

    @classmethod
    def _checked(cls, trajectory: Trajectory, path: str | Path) -> Self:
        scene = trajectory.scene
        if trajectory.terrain is None:
            refuse(RecordingError, "path", str(path), "contains no ground: the group `terrain` is missing")
        with sound(path, "scene.model"):
            model = RoverModel.from_dict(scene["model"])
        _check_solver(trajectory.attributes.get("solver", {}), path)
        check_rows(trajectory, path, (*RoverSampler(model).channels, *OF_EPISODES), bounded=("q", "wheel_centres"))
        goal, tolerance = _goal(scene.get("goal"), path), _tolerance(scene.get("goal_tolerance"), path)
        return cls(trajectory, model, trajectory.terrain, goal, tolerance)

    @property
    def on_sand(self) -> bool:
        """Whether the wheels sank into sand; the ground of a recording is its surface alone."""
        scene = self.trajectory.scene
        return sand_of(self.terrain) is not None or scene.get("terrain") == "sand" or "soil" in scene

    @property
    def positions(self) -> Array:
        """(n, n_solids, 3) origins of the solids, world, m, in the order of `model.solid_names`."""
        return self._poses[0]

    @property
    def rotations(self) -> Array:
        """(n, n_solids, 3, 3) rotation matrices from the solids' frames to the world frame."""
        return self._poses[1]

    @cached_property
    def _poses(self) -> tuple[Array, Array]:
        names = self.model.solid_names
        positions = np.empty((self.n_frames, len(names), 3))
        rotations = np.empty((self.n_frames, len(names), 3, 3))
        for row, q in enumerate(self.trajectory["q"]):
            poses = self.model.poses(q, "state")
            for i, name in enumerate(names):
                positions[row, i], rotations[row, i] = poses[name]
        return positions, rotations


def read_run(path: str | Path) -> RoverRun:
    """Reads a run saved by `rover drive --output` or `rover report`, complete or not.

    Raises:
        RecordingError: The file is not a valid trajectory, or contains no samples, rover or ground.
        OSError: The file does not exist or cannot be read.
    """
    return RoverRun.of(read_trajectory(path), path)


def _check_solver(solver: object, path: str | Path) -> None:
    """Checks the solver settings that the figures show."""
    if not isinstance(solver, dict):
        refuse(RecordingError, f"{path}: solver", solver, "must be an object")
    for name in ("time_step", "tolerance"):
        if name in solver:
            number(f"{path}: solver.{name}", solver[name], above=0.0, at_most=LARGEST, error=RecordingError)
    if "gravity" in solver:
        vector(f"{path}: solver.gravity", solver["gravity"], 3, error=RecordingError)


def _tolerance(tolerance: object, path: str | Path) -> float | None:
    if tolerance is None:
        return None
    return number(f"{path}: scene.goal_tolerance", tolerance, above=0.0, at_most=LARGEST, error=RecordingError)


def _goal(goal: object, path: str | Path) -> tuple[float, float] | None:
    if goal is None:
        return None
    x, z = vector(f"{path}: scene.goal", goal, 2, error=RecordingError)
    if max(abs(x), abs(z)) > LARGEST:
        refuse(RecordingError, f"{path}: scene.goal", goal, f"must lie within {LARGEST:g} m")
    return (x, z)
