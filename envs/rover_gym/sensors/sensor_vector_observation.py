"""A wrapper that adds sensors to the observations of a vector of rovers."""

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.env.observation import Array, Mask
from rover_gym.mechanics import OptionError, StateError
from rover_gym.sensors.sensor import Moment, Sensor
from rover_gym.sensors.sensor_suite import STATE, SensorSuite, SuiteState
from rover_gym.validation import refuse
from rover_gym.vector.batch import BatchSnapshot
from rover_gym.vector.vector_env import RoverVectorEnv


@dataclass(frozen=True)
class SensedBatchSnapshot:
    """The state from which a vector of rovers with sensors continues bit for bit; picklable."""

    rovers: BatchSnapshot
    sensors: tuple[SuiteState, ...]


class SensorVectorObservation(VectorWrapper):
    """Adds each rover's sensors to its observation, as `SensorObservation` does for one rover, and bit for bit alike.

    Args:
        env: A `RoverVectorEnv`; wrappers go around this one.
        sensors: The sensors that each rover has, with different names.

    Raises:
        OptionError: `env` is another environment or resets in the step that ends an episode, after which its last
            readings could not be taken, or a sensor does not fit the rover.
    """

    def __init__(self, env: RoverVectorEnv, sensors: Sequence[Sensor]) -> None:
        if not isinstance(env, RoverVectorEnv):
            refuse(OptionError, "env", env, "must be a RoverVectorEnv, as gymnasium.make_vec makes it")
        if env.autoreset_mode == AutoresetMode.SAME_STEP:
            refuse(OptionError, "autoreset_mode", env.autoreset_mode.value, "must be NextStep or Disabled with sensors")
        super().__init__(env)
        self._rovers = env
        self.suite = SensorSuite(sensors, env.prototype.model, env.prototype.dt)
        self.single_observation_space = gym.spaces.Dict({STATE: env.single_observation_space, **self.suite.spaces})
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._states: list[SuiteState | None] = [None] * self.num_envs

    def sensor_state(self, i: int) -> SuiteState:
        """The sensors of rover i's episode, with the properties that were drawn.

        Raises:
            ResetNeeded: The rover has not been reset.
        """
        state = self._states[i]
        if state is None:
            raise ResetNeeded("SensorVectorObservation: call reset() first")
        return state

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts episodes, as `RoverVectorEnv.reset`."""
        observation, infos = self._rovers.reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        self._begin(range(self.num_envs) if mask is None else np.flatnonzero(mask).tolist())
        return self._with_readings(observation), infos

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[dict[str, Any], Array, Mask, Mask, dict[str, Any]]:
        """Applies actions, as `RoverVectorEnv.step`, then takes the samples that are due."""
        states = [self.sensor_state(i) for i in range(self.num_envs)]
        begun = set(self._rovers.batch.over)
        observation, reward, terminated, truncated, infos = self._rovers.step(actions)
        for i, state in enumerate(states):
            if i not in begun:
                self.suite.advance(state, self._moment(i))
        self._begin(sorted(begun))
        return self._with_readings(observation), reward, terminated, truncated, infos

    def snapshot(self) -> SensedBatchSnapshot:
        """Returns the state of all rovers and of their sensors, for `restore`; picklable.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        states = tuple(copy.deepcopy(self.sensor_state(i)) for i in range(self.num_envs))
        return SensedBatchSnapshot(self._rovers.snapshot(), states)

    def restore(self, snapshot: SensedBatchSnapshot) -> None:
        """Restores a snapshot of as many rovers with the same arguments and sensors, which continue bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments or sensors; nothing has
                changed.
        """
        if not isinstance(snapshot, SensedBatchSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from SensorVectorObservation.snapshot()")
        kept: object = snapshot.sensors
        if not isinstance(kept, tuple) or len(kept) != self.num_envs:
            refuse(StateError, "snapshot.sensors", kept, f"must be of {self.num_envs} rovers")
        states = [self.suite.check_state(state) for state in kept]
        self._rovers.restore(snapshot.rovers)
        self._states[:] = states

    def _begin(self, chosen: Iterable[int]) -> None:
        chosen = list(chosen)
        rows = self._rovers.batch.generator_rows(chosen)
        for i, row in zip(chosen, rows, strict=True):
            self._states[i] = self.suite.begin(self._moment(i), row)

    def _moment(self, i: int) -> Moment:
        simulation = self._rovers.batch.rovers[i].simulation
        return Moment(simulation, simulation.time)

    def _with_readings(self, observation: npt.NDArray[np.float32]) -> dict[str, Any]:
        each = [self.suite.readings(self.sensor_state(i)) for i in range(self.num_envs)]
        return {STATE: observation, **{name: np.stack([one[name] for one in each]) for name in self.suite.spaces}}
