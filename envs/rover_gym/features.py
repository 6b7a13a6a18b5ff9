"""What a learned policy looks at: the observation without what does not carry over to another place.

Place on the map, heading and the wheels' angles say nothing about the way ahead, so they are left out. The goal
is a direction and a distance, and the height scan becomes heights over the ground plane, so that rocks look alike
on any slope.
"""

import numpy as np
import numpy.typing as npt

from rover_gym.env import RoverEnv

# Entries beyond this are cut: they come from impacts and free wheels.
LARGEST_FEATURE = 5.0

# Rows of the height scan farther behind than this, m, are left out.
BEHIND = 1.05


class Features:
    """Maps observations `(n, observation size)` to features `(n, size)`.

    Args:
        rover: The environment, read once for the layout.
    """

    def __init__(self, rover: RoverEnv) -> None:
        layout = rover.observation_layout
        q, velocity = layout["q"].start, layout["velocity"].start
        wheels = set(rover.model.wheel_joint_indices)
        joints = [i for i in range(6, rover.model.nq) if i not in wheels]
        self._roll, self._pitch = q + 3, q + 5
        self._normal = layout["ground_normal"]
        self._goal = layout["goal"]
        self._distance = layout["goal_distance"].start
        self._goal_scale = float(layout.scale[self._distance])
        taken = [q + i for i in (3, 5, *joints)]
        taken += list(range(velocity, velocity + rover.model.nv))
        for name in ("wheel_gap", "wheel_contact", "normal_force", "tangential_force", "previous_action", "stuck"):
            taken += list(range(layout[name].start, layout[name].stop))
        self._taken = np.array(taken)
        self._scan = layout["height_scan"] if "height_scan" in layout else None
        offsets = rover.scan_offsets
        self._offsets = np.zeros((0, 2)) if offsets is None else offsets
        self._seen = np.flatnonzero(self._offsets[:, 0] >= -BEHIND)
        self.size = len(self._taken) + 7 + (1 + len(self._seen) if self._scan is not None else 0)

    def __call__(self, observations: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """The features of observations, scaled as the environment gives them."""
        seen = observations
        distance = seen[:, self._distance] * self._goal_scale
        goal = seen[:, self._goal] * self._goal_scale / np.maximum(distance, 0.1)[:, None]
        slope = self._slope(seen)
        parts = [
            seen[:, self._taken],
            goal,
            np.stack((np.minimum(distance, 10.0) / 5.0, np.exp(-distance)), axis=1),
            slope * 5.0,
            np.abs(goal[:, 1:]),
        ]
        if self._scan is not None:
            # Over the ground plane, whose level the lowest point of the scan tells.
            rocks = seen[:, self._scan] - slope @ self._offsets.T
            level = rocks.min(axis=1, keepdims=True)
            parts += [-level, 10.0 * (rocks - level)[:, self._seen]]
        return np.clip(np.concatenate(parts, axis=1), -LARGEST_FEATURE, LARGEST_FEATURE).astype(np.float32)

    def _slope(self, seen: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """`(n, 2)` rise of the ground plane per metre ahead and to the right, in the heading frame."""
        n = seen[:, self._normal]
        roll, pitch = seen[:, self._roll], seen[:, self._pitch]
        # The normal in the heading frame is Rz(pitch) Rx(roll) n.
        y = np.cos(roll) * n[:, 1] - np.sin(roll) * n[:, 2]
        right = np.sin(roll) * n[:, 1] + np.cos(roll) * n[:, 2]
        ahead = np.cos(pitch) * n[:, 0] - np.sin(pitch) * y
        up = np.sin(pitch) * n[:, 0] + np.cos(pitch) * y
        return -np.stack((ahead, right), axis=1) / np.maximum(up, 0.1)[:, None]
