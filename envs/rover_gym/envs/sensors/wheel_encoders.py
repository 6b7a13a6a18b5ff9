"""Proprioceptive sensors: wheel encoders, motor sensors and heading."""

import math
from dataclasses import dataclass

import numpy as np

from rover_gym.core import RoverModel
from rover_gym.core.validation import whole
from rover_gym.envs.distributions import Quantity, sampled
from rover_gym.envs.sensors.sensor import Array, Moment, Sensor, Values, gaussian


@dataclass(frozen=True, kw_only=True)
class WheelEncoders(Sensor):
    """Rotation angles of the wheels, exact or counted in ticks, and their rates.

    A reading is (2, n_wheels): the angles since the episode's start, rad, positive forward, and the rates, rad/s, which
    are the difference of two samples over their interval. At the first sample the rates are exact.

    Args:
        ticks: Ticks per turn of the wheel, such as 4096. None measures exactly.
        gain: Angle measured over angle turned, or a range, drawn for each wheel: an error of the transmission.
    """

    name: str = "encoders"
    ticks: int | None = None
    gain: Quantity = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ticks is not None:
            whole("ticks", self.ticks, at_least=1)
        self._keep_ranges("gain")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """Unbounded, (2, n_wheels)."""
        most = np.full((2, len(model.wheel_names)), np.inf)
        return -most, most

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:
        """Draws the gains."""
        return {"gain": sampled(generator, self.gain, len(model.wheel_names))}

    def begin(self, moment: Moment) -> Values:
        """The angles at the start, which count as 0, and the signs that turn them positive forward."""
        joints = moment.model.wheel_joint_indices
        start, forward = moment.q[joints], np.sign(np.diagonal(moment.model.actuation_matrix()[joints]))
        return {"start": start, "forward": forward, "angle": np.zeros_like(start)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,
        drawn: Values,
        generator: np.random.Generator,  # noqa: ARG002 - angles have no noise
    ) -> tuple[Array, Values]:
        """Counts the ticks."""
        joints, gain = moment.model.wheel_joint_indices, memory["forward"] * drawn["gain"]
        angle = self._counted((moment.q[joints] - memory["start"]) * gain)
        rate = (angle - memory["angle"]) / interval if interval > 0.0 else moment.v[joints] * gain
        return np.stack([angle, rate]), {**memory, "angle": angle}

    def _counted(self, angle: Array) -> Array:
        if self.ticks is None:
            return angle
        tick = 2.0 * math.pi / self.ticks
        return np.floor(angle / tick) * tick


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
    current_bias: Quantity = 0.0
    gain: Quantity = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers("torque_constant", above=0.0)
        self._check_numbers("current_noise", at_least=0.0)
        self._keep_ranges("current_bias", "gain")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """Unbounded, (2, n_wheels)."""
        most = np.full((2, len(model.wheel_names)), np.inf)
        return -most, most

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:
        """Draws biases and gains."""
        n = len(model.wheel_names)
        return {"bias": sampled(generator, self.current_bias, n), "gain": sampled(generator, self.gain, n)}

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


@dataclass(frozen=True, kw_only=True)
class HeadingSensor(Sensor):
    """The rover's heading, as a Sun or star sensor with a clock and a level gives it.

    A reading is (2,): cosine and sine of the measured heading, the angle about +y from the world's x axis to where the
    trunk points, positive to the left. The error is a bias of the episode, from the ephemeris and the mounting, and
    white noise of each sample (Volpe 1999 measured a few degrees with a Sun sensor on a rover).

    Args:
        noise_deg: Standard deviation of a sample, deg.
        bias_deg: Constant error of an episode, deg, or a range.
    """

    name: str = "heading"
    noise_deg: float = 0.0
    bias_deg: Quantity = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers("noise_deg", at_least=0.0)
        self._keep_ranges("bias_deg")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """-1 to 1, (2,)."""
        return -np.ones(2), np.ones(2)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws the bias."""
        return {"bias_deg": sampled(generator, self.bias_deg)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - the sky is looked at now
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Measures the heading."""
        ahead = moment.simulation.rotation[:, 0]
        error = float(drawn["bias_deg"]) + float(gaussian(generator, self.noise_deg, 1)[0])
        heading = math.atan2(-ahead[2], ahead[0]) + math.radians(error)
        return np.array([math.cos(heading), math.sin(heading)]), memory
