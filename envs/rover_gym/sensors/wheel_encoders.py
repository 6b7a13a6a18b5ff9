"""Wheel encoders."""

import math
from dataclasses import dataclass

import numpy as np

from rover_gym.mechanics import RoverModel
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.sensor import LARGEST, Array, Sensor, Values, uniform
from rover_gym.validation import Range, whole


@dataclass(frozen=True, kw_only=True)
class WheelEncoders(Sensor):
    """Angles that the wheels have turned, exact or counted in ticks, and their rates.

    A reading is (2, n_wheels): the angles since the episode's start, rad, positive forward, and the rates, rad/s, which
    are the difference of two samples over their interval. At the first sample the rates are the wheels' own.

    Args:
        ticks: Ticks a turn of the wheel, such as 4096. None measures exactly.
        gain: Angle measured over angle turned, or a range, drawn for each wheel: an error of the transmission.
    """

    name: str = "encoders"
    ticks: int | None = None
    gain: float | Range = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ticks is not None:
            whole("ticks", self.ticks, at_least=1)
        self._keep_ranges("gain")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """Unbounded, (2, n_wheels)."""
        most = np.full((2, len(model.wheel_names)), LARGEST)
        return -most, most

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:
        """Draws the gains, which turn the joints' angles into ones that are positive forward."""
        forward = np.sign(np.diagonal(model.actuation_matrix()[model.wheel_joint_indices]))
        return {"gain": forward * uniform(generator, self.gain, len(model.wheel_names))}

    def begin(self, moment: Moment) -> Values:
        """The angles at the start, which count as 0."""
        start = moment.q[moment.model.wheel_joint_indices]
        return {"start": start, "angle": np.zeros_like(start)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,
        drawn: Values,
        generator: np.random.Generator,  # noqa: ARG002 - angles have no noise
    ) -> tuple[Array, Values]:
        """Counts the ticks."""
        joints = moment.model.wheel_joint_indices
        angle = self._counted((moment.q[joints] - memory["start"]) * drawn["gain"])
        rate = (angle - memory["angle"]) / interval if interval > 0.0 else moment.v[joints] * drawn["gain"]
        return np.stack([angle, rate]), {"start": memory["start"], "angle": angle}

    def _counted(self, angle: Array) -> Array:
        if self.ticks is None:
            return angle
        tick = 2.0 * math.pi / self.ticks
        counted: Array = np.floor(angle / tick) * tick
        return counted
