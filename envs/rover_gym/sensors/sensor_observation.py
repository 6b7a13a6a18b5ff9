"""Wrappers that add sensors to the observations of one rover or of a vector, and what Gymnasium calls."""

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorWrapper
from gymnasium.vector.utils import batch_space

from rover_gym.env.env_snapshot import EnvSnapshot
from rover_gym.env.generators import row_of
from rover_gym.env.grains_env import RoverGrainsEnv
from rover_gym.env.observation import Array, Mask
from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import OptionError, StateError
from rover_gym.sensors.sensor import Moment, Sensor
from rover_gym.sensors.sensor_suite import STATE, Readings, SensorSuite, SuiteState
from rover_gym.validation import refuse
from rover_gym.vector.batch import BatchSnapshot
from rover_gym.vector.vector_env import RoverVectorEnv


@dataclass(frozen=True)
class SensedSnapshot:
    """The state from which an environment with sensors continues bit for bit; picklable."""

    env: EnvSnapshot
    sensors: SuiteState


class SensorObservation(gym.Wrapper, RecordConstructorArgs):
    """Observations of a `Dict` space: the environment's own as `state`, and each sensor's reading by its name.

    Readings are float32 in SI units, not scaled. They are those at the end of a step; their random numbers follow from
    the environment's generator, so that a seed gives the same episode with sensors as without, and the same readings.

    Example:
        >>> env = SensorObservation(gym.make("Rover-v0"), [InertialUnit(gyroscope_noise=2e-4), DepthCamera()])

    Args:
        env: A `RoverEnv`, or wrappers around one that keep its steps.
        sensors: The sensors, with different names.

    Raises:
        OptionError: `env` is another environment, or a sensor does not fit it.
    """

    def __init__(self, env: gym.Env[Any, Any], sensors: Sequence[Sensor]) -> None:
        given: object = env
        if not isinstance(given, gym.Env) or not isinstance(given.unwrapped, RoverEnv):
            refuse(OptionError, "env", given, "must be a RoverEnv")
        RecordConstructorArgs.__init__(self, sensors=sensors)
        gym.Wrapper.__init__(self, env)
        self._rover: RoverEnv = given.unwrapped
        self.suite = SensorSuite(sensors, self._rover.model, self._rover.dt)
        self.observation_space = gym.spaces.Dict({STATE: env.observation_space, **self.suite.spaces})
        self._state: SuiteState | None = None

    @property
    def sensor_state(self) -> SuiteState:
        """The sensors of the episode, with the properties that were drawn.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        if self._state is None:
            raise ResetNeeded("SensorObservation: call reset() first")
        return self._state

    def readings(self) -> Readings:
        """What is read now, by sensor.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return self.suite.readings(self.sensor_state)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode, as the environment does, with the sensors' properties drawn anew."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._state = self.suite.begin(self._moment(), row_of(self._rover.np_random))
        return self._with_readings(observation), info

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Applies an action, as the environment does, then takes the samples that are due."""
        state = self.sensor_state
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.suite.advance(state, self._moment())
        return self._with_readings(observation), float(reward), terminated, truncated, info

    def snapshot(self) -> SensedSnapshot:
        """Returns the state of the environment and of its sensors, for `restore`.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        return SensedSnapshot(self._rover.snapshot(), copy.deepcopy(self.sensor_state))

    def restore(self, snapshot: SensedSnapshot) -> None:
        """Restores a snapshot of an environment with the same arguments and sensors, which continues bit for bit.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments or sensors; nothing has
                changed.
        """
        if not isinstance(snapshot, SensedSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from SensorObservation.snapshot()")
        state = self.suite.check_state(snapshot.sensors)
        self._rover.restore(snapshot.env)
        self._state = state

    def _moment(self) -> Moment:
        grains = self._rover.grains if isinstance(self._rover, RoverGrainsEnv) else None
        return Moment(self._rover.simulation, self._rover.simulation.time, grains)

    def _with_readings(self, observation: Any) -> dict[str, Any]:
        return {STATE: observation, **self.readings()}


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


def make_rover(*, sensors: Sequence[Sensor] | None = None, **arguments: Any) -> gym.Env[Any, Any]:
    """Makes a `RoverEnv`, with sensors a `SensorObservation` of it.

    Args:
        sensors: The sensors; None for the environment as it is.
        **arguments: Arguments of `RoverEnv`.
    """
    env = RoverEnv(**arguments)
    return env if sensors is None else SensorObservation(env, sensors)


def make_rover_vector(
    num_envs: int = 1, *, sensors: Sequence[Sensor] | None = None, **arguments: Any
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Makes a `RoverVectorEnv`, with sensors a `SensorVectorObservation` of it.

    Args:
        num_envs: Number of rovers.
        sensors: The sensors that each rover has; None for the environment as it is.
        **arguments: Arguments of `RoverVectorEnv`.
    """
    env = RoverVectorEnv(num_envs, **arguments)
    return env if sensors is None else SensorVectorObservation(env, sensors)


def make_grains_rover(*, sensors: Sequence[Sensor] | None = None, **arguments: Any) -> gym.Env[Any, Any]:
    """Makes a `RoverGrainsEnv`, with sensors a `SensorObservation` of it.

    Args:
        sensors: The sensors, which see the grains; None for the environment as it is.
        **arguments: Arguments of `RoverGrainsEnv`.
    """
    env = RoverGrainsEnv(**arguments)
    return env if sensors is None else SensorObservation(env, sensors)


#: What Gymnasium asks of an entry point before it calls it.
make_rover.metadata = RoverEnv.metadata  # type: ignore[attr-defined]

make_grains_rover.metadata = RoverGrainsEnv.metadata  # type: ignore[attr-defined]
