"""Heading by the Sun or the stars."""

import math
from dataclasses import dataclass

import numpy as np

from rover_gym.mechanics import RoverModel
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.sensor import Array, Sensor, Values, gaussian, uniform
from rover_gym.validation import Range


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
    bias_deg: float | Range = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_numbers("noise_deg", at_least=0.0)
        self._keep_ranges("bias_deg")

    def bounds(self, model: RoverModel) -> tuple[Array, Array]:  # noqa: ARG002 - of every model
        """-1 to 1, (2,)."""
        return -np.ones(2), np.ones(2)

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - of every model
        """Draws the bias."""
        return {"bias_deg": uniform(generator, self.bias_deg)}

    def measure(
        self,
        moment: Moment,
        memory: Values,
        interval: float,  # noqa: ARG002 - the sky is looked at now
        drawn: Values,
        generator: np.random.Generator,
    ) -> tuple[Array, Values]:
        """Looks at the sky."""
        ahead = moment.simulation.rotation[:, 0]
        error = float(drawn["bias_deg"]) + float(gaussian(generator, self.noise_deg, 1)[0])
        heading = math.atan2(-ahead[2], ahead[0]) + math.radians(error)
        return np.array([math.cos(heading), math.sin(heading)]), memory
