"""Torques and currents of the wheel motors."""

from dataclasses import dataclass

import numpy as np

from rover_gym.mechanics import RoverModel
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.sensor import LARGEST, Array, Sensor, Values, gaussian, uniform
from rover_gym.validation import Range


@dataclass(frozen=True, kw_only=True)
class MotorSensors(Sensor):
    """Torque and current of each wheel motor.

    A reading is (2, n_wheels): the torques at the wheels, N m, positive forward, and the currents, A. A torque is the
    mean of the last physics step, within the motor's line. A motor's torque is proportional to its current,
    `tau = k i`; friction in motor and gear is not modelled. Both entries come from the current that is measured.

    Args:
        torque_constant: Torque at the wheel over current, k, N m/A: the motor's constant times the gear's ratio and
            efficiency.
        current_noise: Standard deviation of a sample, A.
        current_bias: Constant error of an episode, A, or a range, drawn for each motor.
        gain: Current measured over current, or a range, drawn for each motor.
    """

    name: str = "motors"
    torque_constant: float = 10.0
    current_noise: float = 0.0
    current_bias: float | Range = 0.0
    gain: float | Range = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers("torque_constant", above=0.0)
        self._check_numbers("current_noise", at_least=0.0)
        self._keep_ranges("current_bias", "gain")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """Unbounded, (2, n_wheels)."""
        most = np.full((2, len(model.wheel_names)), LARGEST)
        return -most, most

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:
        """Draws biases and gains."""
        n = len(model.wheel_names)
        return {"bias": uniform(generator, self.current_bias, n), "gain": uniform(generator, self.gain, n)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - a motor is asked now
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Reads the currents."""
        current = moment.simulation.motor_torques / self.torque_constant
        measured = drawn["gain"] * current + drawn["bias"] + gaussian(generator, self.current_noise, current.shape)
        return np.stack([measured * self.torque_constant, measured]), memory
