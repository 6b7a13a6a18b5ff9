"""A vector of `RoverGoal-v0`."""

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from gymnasium.vector.utils import batch_space

from rover_gym.env.quantities import Mask
from rover_gym.mechanics import sin_cos
from rover_gym.policy.command_env import RoverCommandVectorEnv
from rover_gym.policy.goal_env import RoverGoalEnv
from rover_gym.policy.goal_observation import GoalDict

Array = npt.NDArray[np.float64]


class RoverGoalVectorEnv(RoverCommandVectorEnv):
    """A vector of `RoverGoalEnv` environments that the compiled core steps on several threads.

    Observations, rewards and ends equal, bit for bit, those of a `SyncVectorEnv` of them with a
    `TimeLimit` and the same arguments and seeds.

    Args:
        num_envs: Number of rovers.
        reward_type: "sparse" or "dense".
        **arguments: Arguments of `RoverCommandVectorEnv`.

    Raises:
        OptionError: An argument is out of range.
    """

    def __init__(
        self, num_envs: int = 1, *, reward_type: Literal["sparse", "dense"] = "sparse", **arguments: Any
    ) -> None:
        super().__init__(num_envs, **arguments)
        own = {name: value for name, value in arguments.items() if name not in _OF_VECTORS}
        self._single = RoverGoalEnv(reward_type=reward_type, **own)
        self.compute_reward = self._single.compute_reward
        self.compute_terminated = self._single.compute_terminated
        self.compute_truncated = self._single.compute_truncated
        self.single_observation_space = self._single.observation_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._achieved: Array = np.zeros((self.num_envs, 2))
        self._heading = self._rovers.prototype.observation_layout["q"].start + 4

    def _observed(self) -> GoalDict:
        rovers = self._rovers.batch.rovers
        places = np.array([rover.simulation.q for rover in rovers])
        known = np.isfinite(places).all(axis=1)
        self._achieved[known] = places[known][:, [0, 2]]
        sine, cosine = sin_cos(self._seen[:, self._heading].astype(np.float64))
        features = self._features(self._seen)[:, self._single.kept]
        return {
            "observation": np.column_stack((features, cosine.astype(np.float32), sine.astype(np.float32))),
            "achieved_goal": self._achieved.copy(),
            "desired_goal": np.array([rover.goal for rover in rovers]),
        }

    def _of_rover(self, observations: Any, i: int) -> GoalDict:
        return {name: values[i] for name, values in observations.items()}

    def _earned(self, rewards: Array, observations: Any, moved: Mask) -> Array:
        earned = self.compute_reward(observations["achieved_goal"], observations["desired_goal"], {})
        return np.where(moved, earned, rewards)


#: Arguments of the vector that one environment does not take.
_OF_VECTORS = ("threads", "max_episode_steps", "autoreset_mode")
