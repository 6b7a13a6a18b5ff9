"""What `gymnasium.make` and `make_vec` call: rovers with the argument `sensors` beside their own."""

from collections.abc import Sequence
from typing import Any

import gymnasium as gym

from rover_gym.env.grains_env import RoverGrainsEnv
from rover_gym.env.rover_env import RoverEnv
from rover_gym.sensors.sensor import Sensor
from rover_gym.sensors.sensor_observation import SensorObservation
from rover_gym.sensors.sensor_vector_observation import SensorVectorObservation
from rover_gym.vector.vector_env import RoverVectorEnv


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
