"""Domain randomisation: properties of rover and world that may differ from episode to episode.

A number fixes a property, a pair (low, high) has it drawn uniformly at each reset. Properties that are fixed draw
nothing, so that an environment without randomisation starts as it always did.
"""

from dataclasses import asdict, dataclass

import numpy as np

from rover_gym.validation import Range


@dataclass(frozen=True)
class Domain:
    """What an episode's rover and world are like.

    Attributes:
        mass_scale: Masses and inertias over the model's.
        friction: Coulomb's coefficient.
        actuator_gain: Torque that a wheel motor gives over the torque that was asked of it, up to its limit.
        gravity_scale: Gravity over the argument's.
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
    """Ranges from which `sample` draws uniformly, and the standard deviation of the observation's noise."""

    mass_scale: Range
    friction: Range
    actuator_gain: Range
    gravity_scale: Range
    observation_noise: float

    def sample(self, rng: np.random.Generator) -> Domain:
        """Draws what is not fixed."""

        def draw(span: Range) -> float:
            low, high = span
            return low if low == high else float(rng.uniform(low, high))

        return Domain(
            mass_scale=draw(self.mass_scale),
            friction=draw(self.friction),
            actuator_gain=draw(self.actuator_gain),
            gravity_scale=draw(self.gravity_scale),
        )
