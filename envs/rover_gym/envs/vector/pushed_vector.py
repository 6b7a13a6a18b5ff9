"""`RandomPushesVector`: random pushes of the rovers of a vector environment."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorWrapper

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.envs.distributions import Quantity
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.pushes import PushedRovers, push_options
from rover_gym.envs.vector.vector_env import RoverVectorEnv


class RandomPushesVector(PushedRovers, VectorWrapper):
    """Pushes each rover of a vector, bit for bit as `RandomPushes` does for one rover.

    The infos have the forces of the last control period as `push`, (num_envs, 3), N, world frame. With autoreset in the
    same step, they are those of the episodes that ended.

    Args:
        env: A `RoverVectorEnv`; wrappers go around this one.
        force: Size of the force, N, a range (low, high) or a distribution.
        **options: Other fields of `rover_gym.envs.PushOptions`.

    Raises:
        OptionError: `env` is another environment, or an option is out of its range.
    """

    def __init__(self, env: RoverVectorEnv, force: Quantity, **options: Any) -> None:
        if not isinstance(env, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        VectorWrapper.__init__(self, env)
        self.rovers = env
        self.set_pushes(push_options(force, options), env.prototype, env.num_envs)
        self._over: Mask = np.zeros(self.num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        observation, infos = self.rovers.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        chosen = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        self._begin(chosen)
        self._over &= ~chosen
        return observation, infos | {"push": np.zeros((self.num_envs, 3))}

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[Observations, Array, Mask, Mask, dict[str, Any]]:
        """Applies actions `(num_envs, n_actions)` and the forces of the period."""
        begins = self._over & (self.rovers.autoreset_mode == AutoresetMode.NEXT_STEP)
        going = ~self._over
        forces = self.push_all(going)
        observation, rewards, terminated, truncated, infos = self.rovers.step(actions)
        self.count_periods(going)
        self._over = terminated | truncated
        if self.rovers.autoreset_mode == AutoresetMode.SAME_STEP:
            begins, self._over = self._over, np.zeros(self.num_envs, np.bool_)
        self._begin(begins)
        return observation, rewards, terminated, truncated, infos | {"push": forces}

    def push_all(self, going: Mask) -> Array:
        """Applies the forces of the coming control period to some rovers and returns them, (num_envs, 3), N."""
        forces = np.zeros((self.num_envs, 3))
        for i in np.flatnonzero(going).tolist():
            forces[i] = self.push(i, self.rovers.envs[i])
        return forces

    def count_periods(self, gone: Mask) -> None:
        """Counts a control period that some rovers have taken."""
        for i in np.flatnonzero(gone).tolist():
            self.count_period(i)

    def _begin(self, chosen: Mask) -> None:
        for i in np.flatnonzero(chosen).tolist():
            self.begin_pushes(i, self.rovers.envs[i])
