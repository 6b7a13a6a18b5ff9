"""Domain randomisation: properties of rover and world that may change from episode to episode.

A number fixes a property; a pair (low, high) is a range to draw from uniformly at each reset. A fixed property takes no
random number, so it does not shift the other draws.
"""

from dataclasses import asdict, dataclass

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
    """Ranges that episodes draw from uniformly, and the standard deviation of the observation noise."""

    mass_scale: Range
    friction: Range
    actuator_gain: Range
    gravity_scale: Range
    observation_noise: float
