"""Where the eye stands that looks at a run of balls, and the path that carries it along."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.replay.scenery import first_view
from rover_gym.replay.smoothing import FOLLOW_TIME, moving_mean

if TYPE_CHECKING:
    from rover_gym.grains.grain_run import GrainRun

FIELD_OF_VIEW = 0.6  # rad, vertical, of a run without a rover

Array = npt.NDArray[np.float64]


class StartView(NamedTuple):
    """A viewpoint: eye and target, m, and the vertical field of view, rad."""

    eye: list[float]
    target: list[float]
    angle: float


def start_view(run: GrainRun) -> StartView:
    """The view at the start: beside the rover, or so that all balls are in it."""
    if run.rover is not None:
        view = first_view(run.rover)
        return StartView(view.eye.tolist(), view.target.tolist(), view.field_of_view)
    shown = run.positions_of(np.unique(run.rows[[0, run.n_frames // 2, -1]])).astype(np.float64)
    ends = np.quantile(shown, 0.01, axis=1), np.quantile(shown, 0.99, axis=1)
    low, high = ends[0].min(axis=0), ends[1].max(axis=0)
    if run.vessel is not None and run.vessel["kind"] == "drum":
        reach = np.array([run.vessel["radius"], run.vessel["radius"], 0.5 * run.vessel["length"]])
        low, high = run.vessel["centre"] - reach, run.vessel["centre"] + reach
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low)) + 2.0 * float(run.radius.max())
    eye = middle + 1.1 * size / np.tan(FIELD_OF_VIEW) * np.array([-0.42, 0.45, 0.79])
    return StartView(eye.tolist(), middle.tolist(), FIELD_OF_VIEW)


def eye_path(run: GrainRun, *, follow: bool = True) -> Array:
    """(n, 3) what carries the eye along, relative to its start, m: the trunk's smoothed path."""
    if run.rover is None or not follow:
        return np.zeros((run.n_frames, 3))
    smooth = moving_mean(run.time, run.trajectory["q"][:, :3], FOLLOW_TIME)
    result: Array = smooth - smooth[0]
    return result
