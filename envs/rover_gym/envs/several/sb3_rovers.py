"""`RoversVecEnv`: scenes of several rovers as one vector for stable-baselines3, whose policy all rovers share.

from rover_gym.envs.several.sb3_rovers import RoversVecEnv

venv = RoversVecEnv(8, rovers=3, terrain="rocks", height_scan=True)
model = stable_baselines3.PPO("MlpPolicy", VecMonitor(venv))
"""

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.validation import refuse
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.generators import check_seed
from rover_gym.envs.observation import Array
from rover_gym.envs.sensors.sensor_suite import SensorLike
from rover_gym.envs.several.joined_batch import JoinedBatch, RoverPeriod, check_limit
from rover_gym.envs.several.joined_scene import ModelLike, Team
from rover_gym.envs.start import Point
from rover_gym.envs.task import check_actions
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS

try:
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ImportError as error:
    raise MissingExtraError("stable-baselines3", "train") from error


class RoversVecEnv(VecEnv):
    """Scenes of several rovers, which the compiled core steps on several threads; every rover is a row of the vector.

    Rows 0 to n - 1 are the rovers of the first scene, and so on. The episodes of a scene's rovers end together: a rover
    whose own episode has ended brakes, observes zeros, earns nothing and ignores its actions until all others of its
    scene have ended, too. The next scene then starts at once. `terminal_observation` is the last observation; infos are
    those of the end of each rover's own episode. `TimeLimit.truncated` is true for the rovers that were still driving
    at the time limit. Until then infos hold only `TimeLimit.truncated`.

    Args:
        n_scenes: Number of scenes.
        rovers: Number of rovers in each, or a list with the model of each, which must give equal spaces.
        starts: As of `RoverParallelEnv`.
        loops: As of `RoverParallelEnv`.
        sensors: Sensors of each rover; observations are then dictionaries for `MultiInputPolicy`.
        max_episode_steps: Steps until truncation; -1 for no limit.
        threads: Threads that step the scenes; None for one per core.
        **arguments: Arguments of `RoverEnv`.

    Raises:
        OptionError: An argument is out of range, or the rovers have different spaces.
    """

    @takes_arguments
    def __init__(
        self,
        n_scenes: int,
        rovers: int | Sequence[ModelLike] = 2,
        *,
        starts: Sequence[Point] | None = None,
        loops: Sequence[Mapping[str, Any]] | None = None,
        sensors: Sequence[SensorLike] | None = None,
        max_episode_steps: int = MAX_EPISODE_STEPS,
        threads: int | None = None,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        team = Team(rovers, starts=starts, loops=loops, **arguments)
        limit = check_limit(max_episode_steps)
        self.batch = JoinedBatch(n_scenes, team, threads=threads, max_episode_steps=limit, sensors=sensors)
        self.team, self.render_mode = team, None
        #: A rover alone with the same arguments, which gives layout, model and limits.
        self.prototype = team.prototype(0)
        spaces, actions = self.batch.observation_spaces, self.batch.action_spaces
        if any(space != spaces[0] for space in spaces) or any(space != actions[0] for space in actions):
            refuse(OptionError, "rovers", rovers, "must all have equal spaces, as they share a policy")
        self._actions: Array = np.zeros((0, 0))
        self._last: dict[int, RoverPeriod] = {}
        super().__init__(self.batch.n * team.n_rovers, spaces[0], actions[0])

    def reset(self) -> VecEnvObs:
        """Starts all scenes with the seeds and options set for this reset.

        Raises:
            TerrainError: The rovers of a scene have no room; scenes before it have been reset.
        """
        checked = [self.team.check_options(given) for given in self._options[:: self.team.n_rovers]]
        for s, options in enumerate(checked):
            self.batch.reset(s, self._seeds[s * self.team.n_rovers], options)
        self._reset_seeds()
        self._reset_options()
        self._last.clear()
        self._tell_resets(range(self.batch.n))
        return self._stacked([self._seen(i) for i in range(self.num_envs)])

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Sets the seeds of the next reset: row i gets `seed + i`, and a scene is drawn from its first row's seed.

        Raises:
            OptionError: The seed is neither None nor a whole number from 0; nothing has changed.
        """
        return super().seed(check_seed(seed))

    def step_async(self, actions: npt.NDArray[np.float32]) -> None:
        """Stores the actions, (rows, n_actions), for `step_wait`."""
        self._actions = check_actions(actions, (self.num_envs, self.action_space.shape[0]))  # type: ignore[index]

    def step_wait(self) -> VecEnvStepReturn:
        """Applies the stored actions for one control period; scenes whose rovers have all ended start anew.

        Raises:
            OptionError: A function of `reward_terms` fails; the period has been taken.
            TerrainError: The rovers of a next scene have no room.
        """
        n = self.team.n_rovers
        rows = self._actions.reshape(self.batch.n, n, -1)
        live = [self.batch.scene(s).live for s in range(self.batch.n)]
        periods = self.batch.step([[rows[s, k] if live[s][k] else None for k in range(n)] for s in range(self.batch.n)])
        each = [one for scene in periods for one in scene]
        rewards = np.array([0.0 if one is None else one.reward for one in each])
        self._last |= {i: one for i, one in enumerate(each) if one is not None and (one.terminated or one.truncated)}
        dones = np.repeat([not self.batch.scene(s).live.any() for s in range(self.batch.n)], n)
        infos: list[dict[str, Any]] = [{"TimeLimit.truncated": False} for _ in each]
        for i in np.flatnonzero(dones).tolist():
            last = self._last.pop(i)
            seen = self._nothing() if each[i] is None else last.observation
            timed_out = last.truncated and not last.terminated
            infos[i] = {
                **self.batch.info(*divmod(i, n)),
                "TimeLimit.truncated": timed_out,
                "terminal_observation": seen,
            }
        over = np.flatnonzero(dones[::n]).tolist()
        for s in over:
            self.batch.reset(s)
        self._tell_resets(over)
        return self._stacked([self._seen(i) for i in range(self.num_envs)]), rewards.astype(np.float32), dones, infos

    def _seen(self, i: int) -> Any:
        """What row i observes: zeros where its episode has ended."""
        s, k = divmod(i, self.team.n_rovers)
        return self.batch.observation(s, k) if self.batch.scene(s).live[k] else self._nothing()

    def _nothing(self) -> Any:
        """An observation of zeros."""
        space: Any = self.observation_space
        if isinstance(space, gym.spaces.Dict):
            return {name: np.zeros(one.shape, one.dtype) for name, one in space.items()}
        return np.zeros(space.shape, space.dtype)

    def _stacked(self, seen: Sequence[Any]) -> VecEnvObs:
        """Observations of all rows."""
        if isinstance(self.observation_space, gym.spaces.Dict):
            return {name: np.stack([one[name] for one in seen]) for name in self.observation_space}
        return np.stack(seen)

    def _tell_resets(self, scenes: Sequence[int]) -> None:
        for s in scenes:
            for k in range(self.team.n_rovers):
                self.reset_infos[s * self.team.n_rovers + k] = self.batch.first_info(s, k)

    def close(self) -> None:
        """Does nothing: there is nothing to free."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Reads an attribute of the vector, which all rows share."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:  # noqa: ARG002 - as VecEnv's
        """Refused: rows have no attributes of their own.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"{attr_name} of a row cannot be set")

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:  # noqa: ARG002
        """Refused: rows have no methods of their own.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"rows have no method {method_name}")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002
        """False for every row."""
        return [False for _ in self._get_indices(indices)]
