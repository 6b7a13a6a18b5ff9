"""`RoverVecEnv`: many rovers as one vector environment of stable-baselines3.

from rover_gym.sb3 import RoverVecEnv

venv = RoverVecEnv(64, terrain="sphere_field", height_scan=True)
model = stable_baselines3.PPO("MlpPolicy", VecMonitor(venv))
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.batch import Rover, RoverBatch
from rover_gym.env import RoverEnv
from rover_gym.extras import MissingExtraError
from rover_gym.observation import LARGEST, N_ACTIONS
from rover_gym.registration import MAX_EPISODE_STEPS
from rover_gym.task import check_actions

try:
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ImportError as error:
    raise MissingExtraError("stable-baselines3", "train") from error


class RoverVecEnv(VecEnv):
    """Rovers that are stepped by the compiled core, many at a time, on several threads.

    Each goes bit for bit as a `RoverEnv` of the same arguments and seed would, inside a `TimeLimit` and a
    `DummyVecEnv`: an episode that ends is followed by the next at once, the last observation is in
    `info["terminal_observation"]`, and `info["TimeLimit.truncated"]` says whether only the time was up. For speed the
    infos are whole only where an episode ends; before that they hold `TimeLimit.truncated` and nothing else.

    Example:
        >>> venv = RoverVecEnv(64, terrain="sphere_field", height_scan=True)
        >>> model = stable_baselines3.PPO("MlpPolicy", VecMonitor(venv))

    Args:
        n_envs: How many rovers.
        threads: That step them; None for one a core.
        max_episode_steps: Steps until truncation; None for never.
        **arguments: Those of `RoverEnv`.
    """

    def __init__(
        self,
        n_envs: int,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = MAX_EPISODE_STEPS,
        **arguments: Any,
    ) -> None:
        self.batch = RoverBatch(n_envs, threads=threads, max_episode_steps=max_episode_steps, **arguments)
        self._actions: npt.NDArray[np.float64] | None = None
        prototype = self.prototype
        super().__init__(self.batch.n, prototype.observation_space, prototype.action_space)

    @property
    def prototype(self) -> RoverEnv:
        """An environment with the same arguments, never stepped: for its layout, model and limits."""
        return self.batch.prototype

    def reset(self) -> VecEnvObs:
        """Starts an episode of every rover, with the seeds and options that were set for this once."""
        options = [self.batch.check_options(given) for given in self._options]
        for i, (seed, fixed) in enumerate(zip(self._seeds, options, strict=True)):
            self.reset_infos[i] = self.batch.reset(i, seed, fixed)
        self._reset_seeds()
        self._reset_options()
        return self.batch.observation

    def step_async(self, actions: npt.NDArray[np.float32]) -> None:
        """Takes the actions `(n_envs, 12)`.

        Raises:
            CommandError: They have a wrong shape or an entry outside [-1, 1]; nothing has changed.
        """
        self._actions = check_actions(actions, (self.num_envs, N_ACTIONS))

    def step_wait(self) -> VecEnvStepReturn:
        """Applies them for one control period; rovers whose episode ends start the next."""
        outcome, terminated, timed_out = self.batch.step(self._actions)
        observation = outcome.observation
        dones = terminated | timed_out
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        if dones.any():
            ended = np.flatnonzero(dones).tolist()
            for i in ended:
                last = outcome.info(i)
                last["TimeLimit.truncated"] = bool(timed_out[i] and not terminated[i])
                last["terminal_observation"] = observation[i].copy()
                infos[i] = last
            for i in ended:
                self.reset_infos[i] = self.batch.reset(i)
            observation[ended] = self.batch.observation[ended]
        # Only a rover that flies off with 1e37 m/s earns what float32 cannot hold.
        reward = np.clip(outcome.reward, -LARGEST, LARGEST).astype(np.float32)
        return observation, reward, dones, infos

    def close(self) -> None:
        """Frees the renderers, if there are any."""
        for rover in self.batch.rovers:
            rover.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the rovers, or of the environment that they are made like."""
        return [self._find(rover, attr_name) for rover in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Sets an attribute of the rovers' views; those that `RoverEnv` has are not to be set.

        Raises:
            AttributeError: The attribute is one that `RoverEnv` has.
        """
        for rover in self._chosen(indices):
            if attr_name in vars(self.prototype) or hasattr(RoverEnv, attr_name) or hasattr(Rover, attr_name):
                raise AttributeError(f"{attr_name} of a rover cannot be set; env_method('set_difficulty', ...) can")
            setattr(rover, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Calls a method of the rovers, such as `set_difficulty`."""
        return [getattr(rover, method_name)(*method_args, **method_kwargs) for rover in self._chosen(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002
        """No rover is."""
        return [False for _ in self._chosen(indices)]

    def get_images(self) -> Sequence[npt.NDArray[np.uint8] | None]:
        """A frame of every rover, with `render_mode="rgb_array"`; `render()` puts them side by side."""
        return [rover.render() for rover in self.batch.rovers]

    def _chosen(self, indices: VecEnvIndices) -> list[Rover]:
        return [self.batch.rovers[i] for i in self._get_indices(indices)]

    def _find(self, rover: Rover, name: str) -> Any:
        # Not by hasattr, which would call a property.
        owner = rover if name in vars(rover) or name in vars(Rover) else self.prototype
        return getattr(owner, name)
