"""What all sensors have in common: a name, a rate, a latency, and properties that are drawn for each episode."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, RoverModel
from rover_gym.sensors.moment import Moment
from rover_gym.sensors.mount import Mount
from rover_gym.validation import Range, number, refuse, span

Array = npt.NDArray[np.float64]

#: What is drawn for an episode, or kept from one sample to the next, by name.
Values: TypeAlias = Mapping[str, Array]

#: Longest latency, s.
MAX_LATENCY = 1e3

#: Bounds of what has no bounds: the space holds every finite reading.
LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, kw_only=True)
class Sensor(ABC):
    """A sensor's configuration.

    A property that may be a range is drawn uniformly from it at each reset, as the environment's own are; a number
    fixes it and takes no random number.

    Args:
        name: Key of its readings in the observation.
        rate: Samples a second, Hz: the control frequency over a whole number; None for one each control period.
        latency: Age of the newest sample that is read, s, or a range. A reading changes at the end of a control period
            only, so latencies act as if rounded up to whole periods.

    Raises:
        OptionError: A value is out of its range; `field` names it.
    """

    name: str
    rate: float | None = None
    latency: float | Range = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            refuse(OptionError, "name", self.name, "must be a name of letters, digits and underscores")
        if self.rate is not None:
            number("rate", self.rate, above=0.0)
        self._keep("latency", span("latency", self.latency, at_least=0.0, at_most=MAX_LATENCY))
        for field in fields(self):
            if field.name == "mount" and not isinstance(getattr(self, field.name), Mount):
                refuse(OptionError, "mount", getattr(self, field.name), "must be a Mount")

    def _keep(self, field: str, value: object) -> None:
        """Sets a field to its checked value."""
        object.__setattr__(self, field, value)

    def _keep_ranges(self, *names: str, at_least: float | None = None, at_most: float | None = None) -> None:
        """Checks fields that are numbers or ranges, and keeps them as ranges."""
        for name in names:
            self._keep(name, span(name, getattr(self, name), at_least=at_least, at_most=at_most))

    def _check_numbers(self, *names: str, above: float | None = None, at_least: float | None = None) -> None:
        for name in names:
            number(name, getattr(self, name), above=above, at_least=at_least)

    def check(self, model: RoverModel) -> None:  # noqa: B027 - most sensors fit every model
        """Refuses a model that the sensor does not fit.

        Raises:
            OptionError: The sensor names a solid that the model lacks, or that cannot carry it.
        """

    @abstractmethod
    def bounds(self, model: RoverModel) -> tuple[Array, Array]:
        """The least and the greatest reading, in the shape of a reading."""

    def draw(self, model: RoverModel, generator: np.random.Generator) -> Values:  # noqa: ARG002 - some draw nothing
        """Draws the sensor's properties of an episode, by name."""
        return {}

    def begin(self, moment: Moment) -> Values:  # noqa: ARG002 - most need nothing
        """What the sensor keeps from one sample to the next, at the episode's start."""
        return {}

    @abstractmethod
    def measure(
        self, moment: Moment, memory: Values, interval: float, drawn: Values, generator: np.random.Generator
    ) -> tuple[Array, Values]:
        """Takes a sample.

        Args:
            moment: The rover now.
            memory: What `begin`, or this method at the sample before, has returned.
            interval: Time since the sample before, s; 0 at the first.
            drawn: What `draw` has drawn for the episode.
            generator: Of the noise.

        Returns:
            The reading, and what to keep.
        """


def uniform(generator: np.random.Generator, field: float | Range, size: int | tuple[int, ...] = ()) -> Array:
    """Draws from a range, (low, high), uniformly; a range of one number takes no random number."""
    low, high = field if isinstance(field, tuple) else (field, field)
    if low == high:
        return np.full(size, low)
    return np.asarray(generator.uniform(low, high, size))


def gaussian(generator: np.random.Generator, deviation: float, size: int | tuple[int, ...]) -> Array:
    """Draws from a normal distribution about 0; a deviation of 0 takes no random number."""
    return generator.normal(0.0, deviation, size) if deviation > 0.0 else np.zeros(size)
