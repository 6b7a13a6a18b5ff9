"""The keys of `gymnasium.utils.play`: w and s push forward and backward, a and d turn left and right.

Gymnasium looks an action up for the keys that are held together, so that each of the sixteen combinations has its own;
the empty one is the action without a key.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from rover_gym.core import atan2
from rover_gym.envs.start import wheel_centres

if TYPE_CHECKING:
    from rover_gym.envs.task import Task

#: Acceleration on level ground with w held, m/s2: enough for a slope of eleven degrees.
PUSH = 2.0
#: Curvature with a or d held, 1/m.
CURVATURE = 0.5

KEYS = "wsad"

Action: TypeAlias = npt.NDArray[np.float32]
Made = TypeVar("Made")


def keys_to_action(action: Callable[[float, float], Made]) -> dict[str, Made]:
    """Actions by the keys that are held together.

    Args:
        action: Makes an action of forward, -1 to 1, and left, -1 to 1.
    """
    combinations = ("".join(keys) for keys in product(*(("", key) for key in KEYS)))
    return {
        keys: action(float("w" in keys) - float("s" in keys), float("a" in keys) - float("d" in keys))
        for keys in combinations
    }


def pushed(task: Task, forward: float, left: float) -> Action:
    """An action that pushes all wheels alike and steers them about one turning centre; without steering it skids.

    Args:
        task: The task, whose actions are torques and set-points.
        forward: Part of `PUSH`, -1 to 1.
        left: Part of `CURVATURE`, -1 to 1, positive to the left.
    """
    model = task.model
    radii = np.array([wheel["radius"] for wheel in model.to_dict()["wheels"]])
    limits = np.asarray(model.wheel_torque_limits)
    x, z = wheel_centres(model).T
    push = PUSH * model.mass * radii / (len(limits) * limits)
    entries = np.zeros(task.n_actions, np.float32)
    if task.steering.joints:
        entries[: len(limits)] = np.clip(forward * push, -1.0, 1.0)
        curvature = left * CURVATURE
        # Wheels in the middle keep their direction: the turning centre lies beside them.
        angles = np.array([atan2(curvature * (a - x.mean()), 1.0 + curvature * b) for a, b in zip(x, z, strict=True)])
        means = [angles[own].mean() for own in task.steering.wheels]
        entries[len(limits) :] = np.clip(np.array(means) / task.max_steering, -1.0, 1.0)
    else:
        entries[:] = np.clip((forward + 2.0 * left * np.sign(z)) * push, -1.0, 1.0)
    return entries
