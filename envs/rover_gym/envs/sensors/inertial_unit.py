"""Inertial measurement unit: accelerometers and gyroscopes."""

import math
from dataclasses import dataclass, field

import numpy as np

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.rotations import rotation_matrix, rotation_vector
from rover_gym.core.validation import refuse
from rover_gym.envs.distributions import Quantity, sampled
from rover_gym.envs.sensors.sensor import Array, Moment, Mount, Sensor, Values, gaussian


@dataclass(frozen=True, kw_only=True)
class InertialUnit(Sensor):
    """Specific force and angular velocity at a point of the trunk.

    A reading is (6,), in the sensor's frame: the specific force, m/s², 9.81 upward at rest on the level, then the
    angular velocity, rad/s. Both are means over the sampling interval, as from an integrating unit, because the
    acceleration is not defined at an impact, where velocities jump. With velocity v and attitude R of the unit at the
    previous sample and now,

        f = R_midᵀ ((v_now - v_before) / dt - g),    w = log(R_beforeᵀ R_now) / dt,

    where R_mid is halfway between the attitudes. At an episode's first sample the velocity counts as constant.

    Each axis adds a constant bias, which is drawn for each episode and then walks at random, and white noise. With the
    noise density n and the walk k a sample's noise has the standard deviation n/√dt, and the bias changes by k √dt
    (Woodman 2007).

    Args:
        mount: Its pose on the trunk.
        accelerometer_noise: Noise density, m/s²/√Hz.
        accelerometer_bias: At the episode's start, m/s², or a range, drawn for each axis.
        accelerometer_walk: Of the bias, m/s³/√Hz.
        accelerometer_gain: Measured over true, or a range, drawn for each axis.
        gyroscope_noise: Noise density, rad/s/√Hz.
        gyroscope_bias: At the episode's start, rad/s, or a range, drawn for each axis.
        gyroscope_walk: Of the bias, rad/s²/√Hz.
        gyroscope_gain: Measured over true, or a range, drawn for each axis.
    """

    name: str = "imu"
    mount: Mount = field(default_factory=Mount)
    accelerometer_noise: float = 0.0
    accelerometer_bias: Quantity = 0.0
    accelerometer_walk: float = 0.0
    accelerometer_gain: Quantity = 1.0
    gyroscope_noise: float = 0.0
    gyroscope_bias: Quantity = 0.0
    gyroscope_walk: float = 0.0
    gyroscope_gain: Quantity = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers("accelerometer_noise", "accelerometer_walk", at_least=0.0)
        self._check_numbers("gyroscope_noise", "gyroscope_walk", at_least=0.0)
        self._keep_ranges("accelerometer_bias", "accelerometer_gain", "gyroscope_bias", "gyroscope_gain")

    def check(self, model: RoverModel) -> None:
        """Rejects a solid other than the trunk, whose velocity is part of the state.

        Raises:
            OptionError: The mount is not on the model's first solid.
        """
        if self.mount.solid_of(model) != model.solid_names[0]:
            refuse(
                OptionError, "mount.solid", self.mount.solid, f"must be {model.solid_names[0]}, which carries the unit"
            )

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """Unbounded, (6,)."""
        most = np.full(6, np.inf)
        return -most, most

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws biases and gains."""
        ranges = (self.accelerometer_bias, self.gyroscope_bias), (self.accelerometer_gain, self.gyroscope_gain)
        bias, gain = (np.concatenate([sampled(generator, one, 3) for one in pair]) for pair in ranges)
        return {"bias": bias, "gain": gain}

    def begin(self, moment: Moment) -> Values:
        """Velocity and attitude at the start, and the random walk of the bias."""
        velocity, rotation, _ = self._motion(moment)
        return {"velocity": velocity, "rotation": rotation, "walk": np.zeros(6)}

    def measure(
        self, moment: Moment, memory: Values, interval: float, drawn: Values, generator: np.random.Generator
    ) -> tuple[Array, Values]:
        """Takes the means since the previous sample."""
        velocity, rotation, angular_velocity = self._motion(moment)
        gravity = moment.simulation.gravity
        walk = memory["walk"]
        if interval > 0.0:
            turn = rotation_vector(memory["rotation"].T @ rotation)
            halfway = memory["rotation"] @ rotation_matrix(0.5 * turn)
            force = halfway.T @ ((velocity - memory["velocity"]) / interval - gravity)
            exact = np.concatenate([force, turn / interval])
            root = math.sqrt(interval)
            walk = walk + self._noise(generator, self.accelerometer_walk * root, self.gyroscope_walk * root)
            noise = self._noise(generator, self.accelerometer_noise / root, self.gyroscope_noise / root)
        else:
            exact = np.concatenate([rotation.T @ -gravity, rotation.T @ angular_velocity])
            noise = np.zeros(6)
        reading = drawn["gain"] * exact + drawn["bias"] + walk + noise
        return reading, {"velocity": velocity, "rotation": rotation, "walk": walk}

    def _motion(self, moment: Moment) -> tuple[Array, Array, Array]:
        """Velocity, attitude and angular velocity of the unit, world frame."""
        place, rotation = moment.frame(self.mount)
        angular_velocity = moment.v[3:6]
        velocity = moment.v[:3] + np.cross(angular_velocity, place - moment.q[:3])
        return velocity, rotation, angular_velocity

    @staticmethod
    def _noise(generator: np.random.Generator, accelerometer: float, gyroscope: float) -> Array:
        return np.concatenate([gaussian(generator, one, 3) for one in (accelerometer, gyroscope)])
