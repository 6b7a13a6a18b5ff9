"""`RandomPushesVector`: random pushes of the rovers of a vector environment."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorWrapper

from rover_gym.env.observation import Array, Mask, Observations
from rover_gym.env.pushes import PushedRovers, push_options
from rover_gym.mechanics import OptionError
from rover_gym.validation import Range, refuse
from rover_gym.vector.vector_env import RoverVectorEnv


class RandomPushesVector(PushedRovers, VectorWrapper):
    """Pushes each rover of a vector, bit for bit as `RandomPushes` does for one rover.

    The infos have the forces of the last control period as `push`, (num_envs, 3), N, world frame. With autoreset in the
    same step, they are those of the episodes that ended.

    Args:
        env: A `RoverVectorEnv`; wrappers go around this one.
        force: Size of the force, N, or a range (low, high).
        **options: Other fields of `rover_gym.env.PushOptions`.

    Raises:
        OptionError: `env` is another environment, or an option is out of its range.
    """

    def __init__(self, env: RoverVectorEnv, force: float | Range, **options: Any) -> None:
        if not isinstance(env, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        VectorWrapper.__init__(self, env)
        self._rovers = env
        self.set_pushes(push_options(force, options), env.prototype, env.num_envs)
        self._over: Mask = np.zeros(self.num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        observation, infos = self._rovers.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        chosen = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        self._begin(chosen)
        self._over &= ~chosen
        return observation, infos | {"push": np.zeros((self.num_envs, 3))}

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Applies actions `(num_envs, n_actions)` and the forces of the period."""
        begins = self._over & (self._rovers.autoreset_mode == AutoresetMode.NEXT_STEP)
        going = np.flatnonzero(~self._over).tolist()
        forces = np.zeros((self.num_envs, 3))
        for i in going:
            forces[i] = self.push(i, self._rovers.envs[i])
        observation, rewards, terminated, truncated, infos = self._rovers.step(actions)
        for i in going:
            self.count_period(i)
        self._over = terminated | truncated
        if self._rovers.autoreset_mode == AutoresetMode.SAME_STEP:
            begins, self._over = self._over, np.zeros(self.num_envs, np.bool_)
        self._begin(begins)
        return observation, rewards, terminated, truncated, infos | {"push": forces}

    def _begin(self, chosen: Mask) -> None:
        for i in np.flatnonzero(chosen).tolist():
            self.begin_pushes(i, self._rovers.envs[i])
