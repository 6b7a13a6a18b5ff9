"""Features: the part of the observation that does not depend on the place.

Position, heading and wheel angles contain no information about the ground ahead and are left out. The goal becomes a
direction and a distance. The height scan becomes heights above the ground plane, so rocks look the same on any slope. A
fine scan is max-pooled: the highest point of each cell gives the height of a rock, which a coarse scan that hits its
flank would miss.
"""

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, exp, sin_cos
from rover_gym.core.validation import refuse, whole
from rover_gym.envs.observation import ObservationLayout
from rover_gym.envs.rover_env import RoverEnv

# Features are clipped to this magnitude; larger values come from impacts and free wheels.
LARGEST_FEATURE = 5.0

# Cells of the height scan farther behind the trunk than this, m, are left out.
BEHIND = 1.05


class Features:
    """Maps observations `(n, observation size)` to features `(n, size)`.

    Args:
        rover: The environment, read once for the layout.
        pool: Scan points per pooling cell, lengthwise and crosswise; must divide the scan's rows and columns.
    """

    def __init__(self, rover: RoverEnv, pool: int = 1) -> None:
        pool = whole("pool", pool, at_least=1)
        layout = rover.observation_layout
        q, velocity = layout["q"].start, layout["velocity"].start
        wheels = set(rover.model.wheel_joint_indices)
        joints = [i for i in range(6, rover.model.nq) if i not in wheels]
        self._layout = layout
        self._goal = layout["goal"]
        self._distance = layout["goal_distance"].start
        self._goal_scale = float(layout.scale[self._distance])
        taken = [q + i for i in (3, 5, *joints)]
        taken += list(range(velocity, layout["velocity"].stop))
        for name in ("wheel_gap", "wheel_contact", "normal_force", "tangential_force", "previous_action", "stuck"):
            taken += list(range(layout[name].start, layout[name].stop))
        self._taken = np.array(taken)
        self._scan = layout.get("height_scan")
        offsets = rover.task.scan
        self._offsets = np.zeros((0, 2)) if offsets is None else offsets
        self._cells = _cells(self._offsets, pool)
        self.size = len(self._taken) + 7 + (0 if self._scan is None else 1 + len(self._cells))

    @property
    def space(self) -> "gym.spaces.Box[np.float32]":
        """The space of one rover's features."""
        return gym.spaces.Box(-LARGEST_FEATURE, LARGEST_FEATURE, (self.size,), np.float32)

    @property
    def goal_entries(self) -> npt.NDArray[np.intp]:
        """Indices of the features of the goal."""
        n = len(self._taken)
        return np.array([n, n + 1, n + 2, n + 3, n + 6])  # those at n + 4 and n + 5 are the ground's slope

    def __call__(self, observations: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """Computes the features of observations, scaled as the environment returns them."""
        seen = observations
        distance = seen[:, self._distance] * self._goal_scale
        goal = seen[:, self._goal] * self._goal_scale / np.maximum(distance, 0.1)[:, None]
        slope = ground_slope(self._layout, seen)
        parts = [
            seen[:, self._taken],
            goal,
            np.stack((np.minimum(distance, 10.0) / 5.0, exp(-distance)), axis=1),
            slope * 5.0,
            np.abs(goal[:, 1:]),
        ]
        if self._scan is not None:
            # Heights over the ground plane; the scan's lowest point gives the plane's level.
            rise = slope[:, :1] * self._offsets[:, 0] + slope[:, 1:] * self._offsets[:, 1]  # no BLAS: same bits
            rocks = seen[:, self._scan] - rise
            level = rocks.min(axis=1, keepdims=True)
            parts += [-level, 10.0 * ((rocks - level)[:, self._cells].max(axis=2))]
        features: npt.NDArray[np.float32] = np.concatenate(parts, axis=1).astype(np.float32)
        return features.clip(-LARGEST_FEATURE, LARGEST_FEATURE)


def ground_slope(layout: ObservationLayout, seen: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """`(n, 2)` rise of the ground plane per metre ahead and to the right, in the heading frame, from observations."""
    q = layout["q"].start
    n = seen[:, layout["ground_normal"]]
    roll, pitch = seen[:, q + 3], seen[:, q + 5]
    # The normal in the heading frame is Rz(pitch) Rx(roll) n.
    sine, cosine = sin_cos(roll)
    y = cosine * n[:, 1] - sine * n[:, 2]
    right = sine * n[:, 1] + cosine * n[:, 2]
    sine, cosine = sin_cos(pitch)
    ahead = cosine * n[:, 0] - sine * y
    up = sine * n[:, 0] + cosine * y
    rise: npt.NDArray[np.floating] = -np.stack((ahead, right), axis=1) / np.maximum(up, 0.1)[:, None]
    return rise


def _cells(offsets: npt.NDArray[np.float64], pool: int) -> npt.NDArray[np.intp]:
    """`(cells, pool * pool)` indices of the points of each cell within `BEHIND`."""
    if len(offsets) == 0:
        return np.zeros((0, 1), np.intp)
    columns = int(np.count_nonzero(offsets[:, 0] == offsets[0, 0]))
    rows = len(offsets) // columns
    if rows % pool or columns % pool:
        refuse(OptionError, "pool", pool, f"must divide the scan's {rows} rows and {columns} columns")
    points = np.arange(rows * columns).reshape(rows // pool, pool, columns // pool, pool)
    cells = points.transpose(0, 2, 1, 3).reshape(-1, pool * pool)
    seen: npt.NDArray[np.intp] = cells[offsets[cells, 0].mean(axis=1) >= -BEHIND]
    return seen
