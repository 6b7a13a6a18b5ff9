"""Episodes that end, and starts from which no step can be taken."""

from collections.abc import Callable
from typing import Any

import numpy as np


def last_step(env: Any, act: Callable[[Any], Any], most: int, **start: Any) -> tuple[Any, ...]:
    """What the last step of an episode returns, which `act` drives by observations; it ends after `most` steps."""
    observation, _ = env.reset(**start)
    for _ in range(most):
        result = env.step(act(observation))
        observation = result[0]
        if result[2]:
            break
    return result


def spinning() -> dict[str, Any]:
    """Options of a reset from which no step can be taken: the trunk turns at 1e30 rad/s."""
    return {"q": 0.5 * np.eye(21)[1], "v": 1e30 * np.eye(21)[3]}
