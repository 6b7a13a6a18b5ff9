"""A saved run of a rover: the poses of all solids over time, and the ground.

run = read_run("episode-0.h5").resample(25.0)
run.positions[-1, run.model.solid_names.index("trunk")]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core import RoverModel, Terrain
from rover_gym.core.validation import number, refuse, vector
from rover_gym.ground.terrain_parts import sand_of
from rover_gym.record.channels import ITERATIONS, TIME, Channel, RecordingError, RoverSampler, sound
from rover_gym.record.trajectory import Trajectory, read_trajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

LARGEST = 1e9  # m, rad or s: largest value that leaves enough digits in single precision
LONGEST_TITLE = 200
#: Channels that the recordings of episodes have besides the simulation's.
OF_EPISODES = (
    Channel("distance_to_goal", "m", "horizontal distance from the trunk's origin to the goal"),
    Channel("slip_ratio", "1", "mean over the wheels in contact of rim slip over the faster of rim and ground"),
    Channel("motor_energy", "J", "work through the wheel motors since the start, driving or braking"),
)


class Run:
    """What all recorded runs have in common: a dataclass that adds what was simulated.

    Attributes:
        trajectory: The data sets and attributes of the file.
        title: Title of the run.
    """

    trajectory: Trajectory
    title: str

    @property
    def n_frames(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """(n,) times of the samples, s."""
        return self.trajectory["time"]

    @property
    def is_complete(self) -> bool:
        """Whether the recording came to its end."""
        return bool(self.trajectory.attributes.get("complete", True))

    def resample(self, fps: float) -> Self:
        """The run reduced to the samples nearest to the frame times of a video, without duplicates.

        Args:
            fps: Frames per second; a run with fewer samples per second keeps them all.

        Raises:
            OptionError: `fps` is not a positive number.
        """
        return self.at(film_rows(self.time, fps))

    def at(self, rows: npt.NDArray[np.int64]) -> Self:
        """Some samples of the run, by their indices `(n,)`."""
        changed: Any = replace(self, trajectory=self.trajectory.at(rows))  # type: ignore[type-var]
        return changed  # type: ignore[no-any-return]

    @property
    def whole(self) -> Self:
        """The run with all samples of its file, of which `resample` and `at` have kept some."""
        if self.trajectory.original is None:
            return self
        changed: Any = replace(self, trajectory=self.trajectory.original[0])  # type: ignore[type-var]
        return changed  # type: ignore[no-any-return]

    def mean(
        self, values: Callable[[Self], npt.NDArray[np.float64]], window: float | None = None
    ) -> npt.NDArray[np.float64]:
        """Means of a force or a rate about each sample, taken from all samples of the file.

        An impact lasts one step. Means of a reduced run's own samples would miss most impacts.

        Args:
            values: Gives the values (n, ...) of a run with n samples.
            window: Width of the window, s. Default: the median time between the samples of this run.
        """
        whole = self.whole
        measured = values(whole)
        if window is None:
            if len(whole.time) == len(self.time):
                return measured
            window = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0
        columns = moving_mean(whole.time, measured.reshape(len(measured), -1), window)
        rows = slice(None) if self.trajectory.original is None else self.trajectory.original[1]
        result: npt.NDArray[np.float64] = columns[rows].reshape(-1, *measured.shape[1:])
        return result


def moving_mean(
    time: npt.NDArray[np.float64], values: npt.NDArray[np.float64], window: float
) -> npt.NDArray[np.float64]:
    """Values `(n, m)` averaged over the samples within half of a window, s, without those that are not finite."""
    half = 0.5 * window + 1e-6  # samples at the edge count, whatever their rounding
    first = np.searchsorted(time, time - half, side="left")
    last = np.searchsorted(time, time + half, side="right")
    known = np.isfinite(values)
    sums = np.vstack((np.zeros(values.shape[1]), np.cumsum(np.where(known, values, 0.0), axis=0)))
    counts = np.vstack((np.zeros(values.shape[1]), np.cumsum(known, axis=0)))
    with np.errstate(invalid="ignore"):
        result: npt.NDArray[np.float64] = (sums[last] - sums[first]) / (counts[last] - counts[first])
    return result


@dataclass(frozen=True)
class RoverRun(Run):
    """A recorded run with its rover and its ground.

    Attributes:
        trajectory: The data sets and attributes of the file.
        model: The rover that drove.
        terrain: The ground.
        goal: Goal on the map, (x, z), m; None if the run had none.
        title: Title of the run.
        goal_tolerance: Distance from the goal at which it counts as reached, m; None if the file does not say it.
    """

    trajectory: Trajectory
    model: RoverModel
    terrain: Terrain
    goal: tuple[float, float] | None
    title: str
    goal_tolerance: float | None = None

    @property
    def on_sand(self) -> bool:
        """Whether the wheels sank into sand; the ground of a recording is its surface alone."""
        scene = self.trajectory.attributes.get("scene", {})
        return sand_of(self.terrain) is not None or scene.get("terrain") == "sand" or "soil" in scene

    @property
    def positions(self) -> npt.NDArray[np.float64]:
        """(n, n_solids, 3) origins of the solids, world, m, in the order of `model.solid_names`."""
        return self._poses[0]

    @property
    def rotations(self) -> npt.NDArray[np.float64]:
        """(n, n_solids, 3, 3) rotation matrices from the solids' frames to the world frame."""
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


def film_rows(time: npt.NDArray[np.float64], fps: float) -> npt.NDArray[np.int64]:
    """Indices of the samples nearest to the frame times of a video, without duplicates.

    Args:
        time: (n,) times of the samples, s.
        fps: Frames per second.

    Raises:
        OptionError: `fps` is not a positive number.
    """
    fps = number("fps", fps, above=0.0)
    frames = np.floor((time[-1] - time[0]) * fps + 1e-6)  # a 2 s run that ends at 1.999999999 s keeps its last frame
    # Number of frame times k / fps before the midpoint between a sample and the next. Frames are not enumerated,
    # because a damaged file may state an enormous duration.
    before = np.floor((0.5 * (time[1:] + time[:-1]) - time[0]) * fps) + 1.0
    before = np.append(np.minimum(before, frames + 1.0), frames + 1.0)
    return np.flatnonzero(np.diff(before, prepend=0.0) > 0.0)


def read_run(path: str | Path) -> RoverRun:
    """Reads a run saved by `rover drive --output` or `rover report`, complete or not.

    Raises:
        RecordingError: The file is not a valid trajectory, or contains no samples, rover or ground.
        OSError: The file does not exist or cannot be read.
    """
    return run_of(read_trajectory(path), path)


def run_of(trajectory: Trajectory, path: str | Path) -> RoverRun:
    """Extracts the run from a trajectory that was read from `path`.

    Raises:
        RecordingError: The trajectory holds no samples, rover or ground, or its parts are inconsistent.
    """
    scene = trajectory.attributes.get("scene")
    if "q" not in trajectory.data or not isinstance(scene, dict) or not isinstance(scene.get("model"), dict):
        refuse(RecordingError, "path", str(path), "contains no rover: `q` or `scene.model` is missing")
    if trajectory.terrain is None:
        refuse(RecordingError, "path", str(path), "contains no ground: the group `terrain` is missing")
    check_time(trajectory, path)
    with sound(path, "scene.model"):
        model = RoverModel.from_dict(scene["model"])
    _check_solver(trajectory.attributes.get("solver", {}), path)
    check_rows(trajectory, path, (*RoverSampler(model).channels, *OF_EPISODES), bounded=("q", "wheel_centres"))
    return RoverRun(
        trajectory=trajectory,
        model=model,
        terrain=trajectory.terrain,
        goal=_goal(scene.get("goal"), path),
        title=title_of(trajectory),
        goal_tolerance=_tolerance(scene.get("goal_tolerance"), path),
    )


def title_of(trajectory: Trajectory) -> str:
    """The title of the run, as one printable line."""
    title = str(trajectory.attributes.get("title", "a run"))[:LONGEST_TITLE]
    return " ".join("".join(letter if letter.isprintable() else " " for letter in title).split())


def check_time(trajectory: Trajectory, path: str | Path) -> None:
    """Checks that a trajectory has samples and that its time does not decrease.

    Raises:
        RecordingError: The trajectory has no samples, or its time is not finite, exceeds `LARGEST` or decreases.
    """
    if "time" not in trajectory.data or len(trajectory["time"]) == 0:
        refuse(
            RecordingError,
            "path",
            str(path),
            "contains no samples: the run was stopped before the first ones were written",
        )
    check_rows(trajectory, path, (TIME,), bounded=("time",))
    backward = np.flatnonzero(np.diff(trajectory["time"]) < 0.0)
    if len(backward):
        row = int(backward[0]) + 1
        refuse(RecordingError, f"{path}: time[{row}]", float(trajectory["time"][row]), "must not decrease")


def check_rows(
    trajectory: Trajectory,
    path: str | Path,
    channels: Iterable[Channel],
    *,
    bounded: tuple[str, ...],
    needed: bool = False,
) -> None:
    """Checks the row shapes and the value range of data sets.

    Args:
        trajectory: The trajectory.
        path: The file, for the message.
        channels: What the data sets hold.
        bounded: Data sets whose values must be finite and within `LARGEST`.
        needed: Whether all must be there, `solver_iterations` aside, which earlier files of balls lack; otherwise
            those that are missing are skipped.

    Raises:
        RecordingError: A data set is missing, has rows of another shape, or a value out of range.
    """
    for channel in channels:
        name, shape = channel.name, channel.shape
        values = trajectory.data.get(name)
        if values is None:
            if needed and not channel.packed and channel is not ITERATIONS:
                refuse(RecordingError, f"{path}: {name}", None, "is missing")
            continue
        if values.shape[1:] != shape:
            refuse(RecordingError, f"{path}: {name}", values.shape[1:], f"must have rows of shape {shape}")
        if name in bounded and not (np.abs(values) <= LARGEST).all():
            worst = float(values[~(np.abs(values) <= LARGEST)][0])
            refuse(RecordingError, f"{path}: {name}", worst, f"must be finite and within {LARGEST:g}")


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
