"""What recorded runs of every kind have in common: samples over time, some of them or all, means, checks of a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core.validation import number, refuse
from rover_gym.record.channels import TIME, Channel, RecordingError
from rover_gym.record.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

Array = npt.NDArray[np.float64]

LARGEST = 1e9  # m, rad or s: largest value that leaves enough digits in single precision

#: Data sets that earlier files of balls lack.
LATER = ("solver_iterations", "wheel_speed_set_points")
LONGEST_TITLE = 200


@dataclass(frozen=True)
class Run:
    """What all recorded runs have in common.

    Attributes:
        trajectory: The data sets and attributes of the file.
    """

    #: What the message says of a file without such a run, and the data sets that every such run has.
    MISSING: ClassVar[str]
    NEEDED: ClassVar[tuple[str, ...]] = ()

    trajectory: Trajectory

    @classmethod
    def is_scene(cls, scene: Mapping[str, Any]) -> bool:
        """Whether a file with this scene is a run of this kind."""
        raise NotImplementedError  # each kind knows its own scenes

    @classmethod
    def of(cls, trajectory: Trajectory, path: str | Path) -> Self:
        """The run of a trajectory that was read from `path`.

        Raises:
            RecordingError: It is a run of another kind or holds no samples, or its parts are inconsistent.
        """
        if not cls.is_scene(trajectory.scene) or not trajectory.data.keys() >= set(cls.NEEDED):
            refuse(RecordingError, "path", str(path), cls.MISSING)
        check_time(trajectory, path)
        return cls._checked(trajectory, path)

    @classmethod
    def _checked(cls, trajectory: Trajectory, path: str | Path) -> Self:
        """The run, once what only this kind holds has been checked."""
        raise NotImplementedError  # each kind holds other things

    @property
    def title(self) -> str:
        """Title of the run, as one printable line."""
        title = str(self.trajectory.attributes.get("title", "a run"))[:LONGEST_TITLE]
        return " ".join("".join(letter if letter.isprintable() else " " for letter in title).split())

    @property
    def n_frames(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """(n,) times of the samples, s."""
        return self.trajectory["time"]

    @property
    def rows(self) -> npt.NDArray[np.int64]:
        """(n,) indices of the samples in the file."""
        original = self.trajectory.original
        return np.arange(self.n_frames) if original is None else original[1]

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
        return replace(self, trajectory=self.trajectory.at(rows))

    @property
    def whole(self) -> Self:
        """The run with all samples of its file, of which `resample` and `at` have kept some."""
        original = self.trajectory.original
        return self if original is None else replace(self, trajectory=original[0])

    def mean(self, values: Callable[[Self], Array], window: float | None = None) -> Array:
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
        return columns[self.rows].reshape(-1, *measured.shape[1:])


def moving_mean(time: Array, values: Array, window: float) -> Array:
    """Values `(n, m)` averaged over the samples within half of a window, s, without those that are not finite."""
    half = 0.5 * window + 1e-6  # samples at the edge count, whatever their rounding
    first = np.searchsorted(time, time - half, side="left")
    last = np.searchsorted(time, time + half, side="right")
    known = np.isfinite(values)
    sums = np.vstack((np.zeros(values.shape[1]), np.cumsum(np.where(known, values, 0.0), axis=0)))
    counts = np.vstack((np.zeros(values.shape[1]), np.cumsum(known, axis=0)))
    with np.errstate(invalid="ignore"):
        return (sums[last] - sums[first]) / (counts[last] - counts[first])  # type: ignore[no-any-return]


def film_rows(time: Array, fps: float) -> npt.NDArray[np.int64]:
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


def width_of(trajectory: Trajectory, name: str, n_dimensions: int) -> int:
    """Columns of a data set's rows; 0 where it has another number of dimensions."""
    values = trajectory[name]
    return values.shape[1] if values.ndim == n_dimensions else 0


def is_moderate(values: npt.NDArray[Any]) -> bool:
    """Whether all values are finite and within `LARGEST`."""
    return bool((np.abs(values) <= LARGEST).all())


def are_sizes(values: Array) -> bool:
    """Whether there are values, all positive and at most `LARGEST`."""
    return len(values) > 0 and bool((values > 0.0).all()) and is_moderate(values)


def rim_slip(rates: Array, turns: slice | tuple[int, ...], radius: Array) -> Array:
    """(n, n_wheels) rim speed minus travel speed of the wheels of a planar machine, m/s.

    Args:
        rates: (n, n_coordinates), first the speed along x, m/s.
        turns: Columns of the wheels' rates, rad/s, counter-clockwise positive.
        radius: (n_wheels,) or (n, n_wheels) m.
    """
    return -rates[:, turns] * radius - rates[:, :1]


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
        needed: Whether all must be there, but those that earlier files of balls lack; otherwise those that are missing
            are skipped.

    Raises:
        RecordingError: A data set is missing, has rows of another shape, or a value out of range.
    """
    for channel in channels:
        name, shape = channel.name, channel.shape
        values = trajectory.data.get(name)
        if values is None:
            if needed and not channel.packed and channel.name not in LATER:
                refuse(RecordingError, f"{path}: {name}", None, "is missing")
            continue
        if values.shape[1:] != shape:
            refuse(RecordingError, f"{path}: {name}", values.shape[1:], f"must have rows of shape {shape}")
        if name in bounded and not is_moderate(values):
            worst = float(values[~(np.abs(values) <= LARGEST)][0])
            refuse(RecordingError, f"{path}: {name}", worst, f"must be finite and within {LARGEST:g}")
