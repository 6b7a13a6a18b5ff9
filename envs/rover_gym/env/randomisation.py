"""Domain randomisation: properties of rover and world that may change from episode to episode.

A number fixes a property; a pair (low, high) is a range to draw from uniformly at each reset. A fixed property takes no
random number, so it does not shift the other draws.
"""

from dataclasses import asdict, dataclass

import numpy as np

from rover_gym.validation import Range


@dataclass(frozen=True)
class Domain:
    """The randomised properties of one episode.

    Attributes:
        mass_scale: Factor on the model's masses and inertias.
        friction: Coulomb friction coefficient.
        actuator_gain: Ratio of delivered to commanded wheel torque, up to the motor's limit.
        gravity_scale: Factor on the argument `gravity`.
    """

    mass_scale: float
    friction: float
    actuator_gain: float
    gravity_scale: float

    def as_info(self) -> dict[str, float]:
        """The values by name."""
        return asdict(self)


@dataclass(frozen=True)
class DomainDistribution:
    """Ranges that `sample` draws from uniformly, and the standard deviation of the observation noise."""

    mass_scale: Range
    friction: Range
    actuator_gain: Range
    gravity_scale: Range
    observation_noise: float

    def sample(self, rng: np.random.Generator) -> Domain:
        """Draws the properties of one episode."""

        def draw(span: Range) -> float:
            low, high = span
            return low if low == high else float(rng.uniform(low, high))

        return Domain(
            mass_scale=draw(self.mass_scale),
            friction=draw(self.friction),
            actuator_gain=draw(self.actuator_gain),
            gravity_scale=draw(self.gravity_scale),
        )
