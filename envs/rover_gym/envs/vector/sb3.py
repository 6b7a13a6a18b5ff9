"""`RoverVecEnv`: the vector environment for stable-baselines3.

from rover_gym.envs.vector.sb3 import RoverVecEnv

venv = RoverVecEnv(64, terrain="rocks", height_scan=True)
model = stable_baselines3.PPO("MlpPolicy", VecMonitor(venv))
"""

import copy
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, StateError
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.validation import Range, refuse
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import BatchSnapshot, Drawn
from rover_gym.envs.generators import check_seed
from rover_gym.envs.observation import Observations
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.sensors.sensor_suite import SensedRovers, SensedSnapshot, SensorLike, with_readings
from rover_gym.envs.task import check_actions
from rover_gym.envs.vector.vector_env import RoverVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ImportError as error:
    raise MissingExtraError("stable-baselines3", "train") from error


#: Attributes that each `RoverEnv` has of its own.
OWN_NAMES = ("batch", "i", "has_scan", "observation_space", "action_space")


@dataclass(frozen=True)
class VecEnvSnapshot:
    """The state from which a `RoverVecEnv` continues bit for bit; picklable.

    Attributes:
        batch: The rovers, and their sensors if they have any.
        reset_infos: Infos of the resets of the running episodes.
        seeds: Seeds that were set for the next reset.
        options: Options that were set for the next reset.
    """

    batch: BatchSnapshot | SensedSnapshot
    reset_infos: list[dict[str, Any]]
    seeds: list[int | None]
    options: list[dict[str, Any]]


class RoverVecEnv(VecEnv):
    """A vector of rovers that the compiled core steps on several threads.

    Each rover behaves, bit for bit, like a `RoverEnv` with the same arguments and seed in a `TimeLimit` and a
    `DummyVecEnv`: when an episode ends the next one starts at once, `info["terminal_observation"]` holds the last
    observation, and `info["TimeLimit.truncated"]` tells whether the episode ended by the time limit alone. For speed,
    infos are complete only where an episode ends; otherwise they hold only `TimeLimit.truncated`.

    Example:
        >>> venv = RoverVecEnv(64, terrain="rocks", height_scan=True)
        >>> model = stable_baselines3.PPO("MlpPolicy", VecMonitor(venv))

    Args:
        n_envs: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Steps until truncation; None for 1200, -1 for no limit.
        sensors: The sensors that each rover has; observations are then dictionaries for `MultiInputPolicy`, as those of
            `gymnasium.make_vec`. None for the observation alone.
        **arguments: Arguments of `RoverEnv`.
    """

    @takes_arguments
    def __init__(
        self,
        n_envs: int,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        sensors: Sequence[SensorLike] | None = None,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        #: The rovers as a vector of Gymnasium.
        self.rovers = RoverVectorEnv(n_envs, threads=threads, max_episode_steps=max_episode_steps, **arguments)
        self.batch = self.rovers.batch
        #: Whether a step takes the height scan, see `RoverBatch.step`.
        self.has_scan = True
        self._actions: object = None
        self._sensed: SensedRovers | None = None
        space: gym.Space[Any] = self.batch.observation_space
        if sensors is not None:
            self._sensed = SensedRovers()
            self._sensed.set_sensors(self.rovers, self.rovers.envs, sensors)
            space = self._sensed.suite.space(space)
        super().__init__(self.batch.n, space, self.batch.action_space)

    @property
    def prototype(self) -> RoverEnv:
        """The first rover, which gives layout, model and limits."""
        return self.rovers.prototype

    def reset(self) -> VecEnvObs:
        """Starts an episode of every rover with the seeds and options set for this reset.

        Raises:
            StateError: As `RoverEnv.reset`; nothing has changed.
            TerrainError: As `RoverEnv.reset`; nothing has changed.
        """
        options = [self.batch.check_options(given) for given in self._options]
        self._begin(self.batch.draw(range(self.num_envs), self._seeds, options))
        self._reset_seeds()
        self._reset_options()
        return self._observed(self.batch.observation)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Sets the seeds of the next reset: the first rover's seed, which increases by one per rover.

        Raises:
            OptionError: The seed is neither None nor a whole number from 0; nothing has changed.
        """
        return super().seed(check_seed(seed))

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Sets the `RoverEnv.reset` options of the next reset: one mapping for all rovers, or a list of one per rover.

        Raises:
            OptionError: The options are neither, or one is unknown or out of range; nothing has changed.
            StateError: As `RoverEnv.reset`.
        """
        given = options if isinstance(options, list) else [options] * self.num_envs
        if len(given) != self.num_envs:
            refuse(OptionError, "options", options, f"must be one mapping, or a list of {self.num_envs}")
        for one in given:
            self.batch.check_options(one)
        self._options = [copy.deepcopy(dict(one or {})) for one in given]

    def set_difficulties(self, difficulties: Sequence[float | Range | None]) -> None:
        """Sets each rover's difficulty of the rocks, as `RoverVectorEnv.set_difficulties`."""
        self.batch.set_difficulties(difficulties)

    def step_async(self, actions: npt.NDArray[np.float32]) -> None:
        """Stores the actions `(n_envs, n_actions)` for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Applies the stored actions for one control period; rovers whose episode ends start the next.

        If a next episode cannot begin, the following step refuses it before any rover moves.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite; nothing has changed. Finite
                entries outside [-1, 1] are clipped.
            TerrainError: A rover's next episode cannot begin (see `RoverEnv.reset`); nothing has changed. Reset with
                another seed or other options.
        """
        # Rovers whose next episode was refused when the last one ended.
        if waiting := self.batch.over:
            check_actions(self._actions, (self.num_envs, self.batch.task.n_actions))
            self._begin(self.batch.draw(waiting))
        with nullcontext() if self._sensed is None else self._sensed.sampling():
            stepped, finals = self.batch.step_on(self._actions, same_step=True, has_scan=self.has_scan)
        observation, earned, terminated, timed_out, _ = stepped
        dones = terminated | timed_out
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in range(self.num_envs)]
        for i, (seen, last) in finals.items():
            last["TimeLimit.truncated"] = bool(timed_out[i] and not terminated[i])
            last["terminal_observation"] = seen
            if self._sensed is not None:
                last["terminal_observation"] = with_readings(seen, self._sensed.readings_of(i))
            infos[i] = last
        if not self.batch.over:
            self._tell_resets(np.flatnonzero(dones).tolist())
        # Only a rover that flies off at 1e37 m/s earns a reward out of float32's range.
        most = float(np.finfo(np.float32).max)
        reward = np.clip(earned, -most, most).astype(np.float32)
        return self._observed(observation), reward, dones, infos

    def _begin(self, drawn: Drawn) -> None:
        self.batch.begin(drawn)
        self._tell_resets(drawn.chosen)

    def _tell_resets(self, begun: Sequence[int]) -> None:
        for i in begun:
            self.reset_infos[i] = self.batch.info(i)
        if self._sensed is not None:
            self._sensed.begin_sensors(begun)

    def _observed(self, observation: Observations) -> VecEnvObs:
        return observation if self._sensed is None else with_readings(observation, self._sensed.all_readings())

    def snapshot(self) -> VecEnvSnapshot:
        """Returns the state of all rovers, of their episodes and random generators, for `restore`; picklable.

        Raises:
            ResetNeeded: The rovers have not been reset.
        """
        kept = copy.deepcopy((self.reset_infos, self._seeds, self._options))
        return VecEnvSnapshot((self._sensed or self.batch).snapshot(), *kept)

    def restore(self, snapshot: VecEnvSnapshot) -> None:
        """Restores a snapshot of a vector of as many rovers with the same arguments, which continues bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments; nothing has changed.
        """
        if not isinstance(snapshot, VecEnvSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from RoverVecEnv.snapshot()")
        rovers: Any = self._sensed or self.batch
        rovers.restore(snapshot.batch)
        kept = copy.deepcopy((snapshot.reset_infos, snapshot.seeds, snapshot.options))
        self.reset_infos, self._seeds, self._options = kept

    def close(self) -> None:
        """Frees the renderers, if there are any."""
        self.rovers.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Reads an attribute of the rovers, by its name in `RoverEnv`."""
        return [getattr(rover, attr_name) for rover in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Sets an attribute of the rovers that `RoverEnv` does not have.

        Raises:
            AttributeError: `RoverEnv` has an attribute of this name.
        """
        for rover in self._chosen(indices):
            if attr_name in OWN_NAMES or hasattr(RoverEnv, attr_name):
                raise AttributeError(f"{attr_name} of a rover cannot be set; env_method('set_difficulty', ...) can")
            setattr(rover, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Calls a method of the rovers, such as `set_difficulty`."""
        return [getattr(rover, method_name)(*method_args, **method_kwargs) for rover in self._chosen(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002
        """False for every rover."""
        return [False for _ in self._chosen(indices)]

    def get_images(self) -> Sequence[npt.NDArray[np.uint8] | None]:
        """One frame per rover with `render_mode="rgb_array"`; `render()` tiles them."""
        return self.rovers.render() or [None] * self.num_envs

    def _chosen(self, indices: VecEnvIndices) -> list[RoverEnv]:
        return [self.rovers.envs[i] for i in self._get_indices(indices)]
