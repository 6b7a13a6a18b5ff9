"""Commands that drive rovers to their goals on open ground."""

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym import RoverEnv
from rover_gym.drive import CommandController


def pursuit(rover: RoverEnv, controller: CommandController, seen: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """`(n, 3)` full speed along the circle that touches the heading and passes through the goal."""
    goal = rover.observation_layout["goal"]
    ahead, right = (seen[:, goal] * rover.observation_layout.scale[goal]).T
    curvature = -2.0 * right / np.maximum(ahead * ahead + right * right, 1e-6) / controller.limits.curvature
    curvature = np.where(ahead > 0.0, curvature.clip(-1.0, 1.0), np.where(right > 0.0, -1.0, 1.0))
    return np.stack((np.ones_like(curvature), curvature, np.zeros_like(curvature)), axis=1)
