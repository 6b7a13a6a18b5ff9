"""A policy that begins with a rover that has dug itself in, for trials of getting free."""

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.validation import number
from rover_gym.drive.commands.driven import Policy, driven_rover


class DugIn:
    """A policy that first digs the rover into sand by spinning all wheels, and then hands over to another policy.

    Args:
        env: A `Rover-v0`, wrapped or not, or a vector of them.
        policy: The policy that is to get free.
        seconds: How long the wheels spin, s.
    """

    def __init__(self, env: Any, policy: Policy, seconds: float) -> None:
        rover = driven_rover(env, type(self).__name__)
        self._periods = round(number("seconds", seconds, at_least=0.0, at_most=1e3) / rover.dt)
        self._n_wheels, self._policy = len(rover.model.wheel_names), policy

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """Actions as `SandPolicy.predict` gives them; the state counts the periods of each rover."""
        n = len(np.atleast_2d(observation))
        spun, inner = (np.zeros(n, np.int64), None) if state is None else state
        starts = np.zeros(n, np.bool_) if episode_start is None else np.broadcast_to(episode_start, n)
        spun = np.where(starts, 0, spun) + 1
        actions, inner = self._policy.predict(observation, inner, spun <= self._periods + 1)
        rows = np.atleast_2d(actions)
        rows[spun <= self._periods, : self._n_wheels] = 1.0
        rows[spun <= self._periods, self._n_wheels :] = 0.0
        return rows.reshape(np.shape(actions)), (spun, inner)
