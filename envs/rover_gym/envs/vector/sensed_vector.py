"""Vectors of rovers with sensors."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.envs.grains_env import RoverGrainsEnv
from rover_gym.envs.observation import Mask
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.sensors.sensor import Array
from rover_gym.envs.sensors.sensor_suite import SensedRovers, SensorLike, SuiteState, with_readings
from rover_gym.envs.time_limits import MAX_COURSE_STEPS
from rover_gym.envs.vector.vector_env import RoverVectorEnv


class SensorVectorObservation(SensedRovers, VectorWrapper):
    """Adds each rover's sensors to its observation, bit for bit as `SensorObservation` does for one rover.

    Args:
        env: A `RoverVectorEnv`, or wrappers around one that keep its resets, such as `CommandVectorEnv`.
        sensors: The sensors that each rover has, with different names.

    Raises:
        OptionError: `env` is another environment, or a sensor does not fit the rover.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], sensors: Sequence[SensorLike]) -> None:
        rovers = getattr(env, "unwrapped", None)
        if not isinstance(rovers, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        VectorWrapper.__init__(self, env)
        self._batch, self._same_step = rovers.batch, rovers.autoreset_mode == AutoresetMode.SAME_STEP
        self.set_sensors(env, rovers.envs, sensors)
        self.single_observation_space = self.suite.space(env.single_observation_space)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def sensor_state(self, i: int) -> SuiteState:
        """The sensors of rover i's episode with their drawn properties.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        return self._state(i)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        observation, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type] # seeds of rovers, too
        mask = (options or {}).get("reset_mask")
        infos = self._begin(range(self.num_envs) if mask is None else np.flatnonzero(mask).tolist(), infos)
        return with_readings(observation, self.all_readings()), infos

    def step(self, actions: npt.NDArray[Any]) -> tuple[dict[str, Any], Array, Mask, Mask, dict[str, Any]]:
        """Applies actions, as the vector does; the samples that are due are taken in each control period."""
        begun = set(self._batch.over)
        with self.sampling():
            observation, reward, terminated, truncated, infos = self.env.step(actions)
        for i in np.flatnonzero(infos.get("_final_obs", ())).tolist():
            infos["final_obs"][i] = with_readings(infos["final_obs"][i], self.readings_of(i))
            begun.add(i)
        infos = self._begin(sorted(begun - set(self._batch.over) if self._same_step else begun), infos)
        return with_readings(observation, self.all_readings()), reward, terminated, truncated, infos

    def _begin(self, chosen: Sequence[int], infos: dict[str, Any]) -> dict[str, Any]:
        """Draws the sensors' properties for episodes that have begun, and adds them to the infos."""
        self.begin_sensors(chosen)
        for i in chosen:
            if drawn := self.suite.domain(self._state(i)):
                infos = self.unwrapped._add_info(infos, {"domain": drawn}, i)
        return infos


def make_rover_vector(
    num_envs: int = 1,
    *,
    sensors: Sequence[SensorLike] | None = None,
    make: Callable[..., VectorEnv[Any, Any, Any]] = RoverVectorEnv,
    **arguments: Any,
) -> VectorEnv[Any, Any, Any]:
    """Makes a `RoverVectorEnv`, wrapped in `SensorVectorObservation` if there are sensors.

    Args:
        num_envs: Number of rovers.
        sensors: The sensors that each rover has; None for the environment as it is.
        make: `RoverVectorEnv`, a subclass, or a wrapper that makes its own.
        **arguments: Its arguments.
    """
    env = make(num_envs, **arguments)
    return env if sensors is None else SensorVectorObservation(env, sensors)


class RoverCourseVectorEnv(RoverVectorEnv):
    """A vector of rovers that drive courses of waypoints, with the time limit of `RoverWaypoints-v0`."""

    #: Steps until truncation unless others are given.
    own_limit: ClassVar[int] = MAX_COURSE_STEPS


def make_course_vector(num_envs: int = 1, **arguments: Any) -> VectorEnv[Any, Any, Any]:
    """Makes a `RoverCourseVectorEnv`, with `sensors` a `SensorVectorObservation` of it."""
    return make_rover_vector(num_envs, make=RoverCourseVectorEnv, **arguments)


class RoverGrainsVectorEnv(RoverVectorEnv):
    """A vector of `RoverGrainsEnv` environments; see `RoverVectorEnv`. Their grains are stepped one after the other."""

    #: The class of one rover.
    env_class: ClassVar[type[RoverEnv]] = RoverGrainsEnv


def make_grains_vector(num_envs: int = 1, **arguments: Any) -> VectorEnv[Any, Any, Any]:
    """Makes a `RoverGrainsVectorEnv`, with `sensors` a `SensorVectorObservation` of it."""
    return make_rover_vector(num_envs, make=RoverGrainsVectorEnv, **arguments)
