"""A wrapper that adds sensors to the observation of one rover."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
from gymnasium.error import ResetNeeded
from gymnasium.utils import RecordConstructorArgs

from rover_gym.env.env_snapshot import EnvSnapshot
from rover_gym.env.generators import row_of
from rover_gym.env.grains_env import RoverGrainsEnv
from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import OptionError, StateError
from rover_gym.sensors.sensor import Moment, Sensor
from rover_gym.sensors.sensor_suite import STATE, Readings, SensorSuite, SuiteState
from rover_gym.validation import refuse


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
