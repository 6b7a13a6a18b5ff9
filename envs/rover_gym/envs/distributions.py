"""Distributions that properties of an episode are drawn from.

A number fixes a property and takes no random number, so that it does not shift the other draws. A pair (low, high) is
drawn uniformly. `Normal`, `LogUniform` and `Choice` are drawn as their names say. All have a bounded support, which is
checked against the bounds of the property. As JSON they are mappings of the class to its fields, for example
`{"Normal": {"mean": 0.7, "deviation": 0.1}}`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import Range, known_keys, mapping, number, refuse, span
from rover_gym.envs.spec_json import named_object

Array = npt.NDArray[np.float64]
Size: TypeAlias = tuple[int, ...]


class Uniform(NamedTuple):
    """Uniform between two numbers; what a pair (low, high) stands for."""

    low: float
    high: float

    @property
    def support(self) -> Range:
        """Least and greatest value."""
        return (self.low, self.high)

    def draw(self, generator: np.random.Generator, size: Size = ()) -> Array:
        """Draws values of a shape."""
        return np.asarray(generator.uniform(self.low, self.high, size))

    def __str__(self) -> str:
        return f"{self.low:g}" if self.low == self.high else f"{self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class Normal:
    """A normal distribution that is cut off: values too far from the mean are drawn again.

    Args:
        mean: The mean.
        deviation: Standard deviation before the cut.
        cut: Greatest distance from the mean, in deviations, at least 1.

    Raises:
        OptionError: A number is out of its range.
    """

    mean: float
    deviation: float
    cut: float = 3.0

    def __post_init__(self) -> None:
        for name, least in (("mean", None), ("deviation", 0.0), ("cut", 1.0)):
            object.__setattr__(self, name, number(f"Normal.{name}", getattr(self, name), at_least=least))

    @property
    def support(self) -> Range:
        """Least and greatest value."""
        reach = self.cut * self.deviation
        return (self.mean - reach, self.mean + reach)

    def draw(self, generator: np.random.Generator, size: Size = ()) -> Array:
        """Draws values of a shape."""
        drawn = generator.standard_normal(math.prod(size))
        while (beyond := np.abs(drawn) > self.cut).any():
            drawn[beyond] = generator.standard_normal(int(beyond.sum()))
        return np.clip(self.mean + self.deviation * drawn, *self.support).reshape(size)

    def __str__(self) -> str:
        return f"normal, {self.mean:g} ± {self.deviation:g}, cut at {self.cut:g} deviations"


@dataclass(frozen=True)
class LogUniform:
    """Uniform in the logarithm: a factor within (0.5, 2) is as often below 1 as above.

    Args:
        low: Least value, above 0.
        high: Greatest value.

    Raises:
        OptionError: A number is out of its range.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", number("LogUniform.low", self.low, above=0.0))
        object.__setattr__(self, "high", number("LogUniform.high", self.high, at_least=self.low))

    @property
    def support(self) -> Range:
        """Least and greatest value."""
        return (self.low, self.high)

    def draw(self, generator: np.random.Generator, size: Size = ()) -> Array:
        """Draws values of a shape."""
        logarithm = generator.uniform(math.log(self.low), math.log(self.high), size)
        return np.asarray(np.clip(np.exp(logarithm), self.low, self.high))

    def __str__(self) -> str:
        return f"log-uniform, {self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class Choice:
    """A choice among numbers, each as likely; one that is listed twice is twice as likely.

    Args:
        values: The numbers.

    Raises:
        OptionError: There is none, or one is not finite.
    """

    values: tuple[float, ...]

    def __post_init__(self) -> None:
        given: object = self.values
        if not isinstance(given, (tuple, list, range, np.ndarray)) or not len(given):
            refuse(OptionError, "Choice.values", given, "must be at least one number")
        values = tuple(number(f"Choice.values[{i}]", one) for i, one in enumerate(given))
        object.__setattr__(self, "values", values)

    @property
    def support(self) -> Range:
        """Least and greatest value."""
        return (min(self.values), max(self.values))

    def draw(self, generator: np.random.Generator, size: Size = ()) -> Array:
        """Draws values of a shape."""
        return np.asarray(self.values)[generator.integers(len(self.values), size=size)]

    def __str__(self) -> str:
        return "one of " + ", ".join(f"{value:g}" for value in self.values)


Distribution: TypeAlias = Uniform | Normal | LogUniform | Choice

#: What a property may be given as.
Quantity: TypeAlias = float | Range | Normal | LogUniform | Choice

CLASSES: dict[str, type[Normal | LogUniform | Choice]] = {
    "Normal": Normal,
    "LogUniform": LogUniform,
    "Choice": Choice,
}


def distribution(
    field: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> Distribution:
    """Checks a number, a pair (low, high) or a distribution, whose whole support must lie within bounds.

    Raises:
        OptionError: It is none of these, or reaches out of the bounds.
    """
    found = named_object(value)
    if found is not None:
        value = _from_fields(field, *found)
    if not isinstance(value, (Normal, LogUniform, Choice)):
        return Uniform(*span(field, value, above=above, at_least=at_least, at_most=at_most))
    for i, end in enumerate(value.support):
        number(f"{field}.support[{i}]", end, above=above, at_least=at_least, at_most=at_most)
    return value


def _from_fields(field: str, name: str, given: Any) -> Normal | LogUniform | Choice:
    if name not in CLASSES:
        refuse(OptionError, field, name, f"unknown class of a distribution; known are {', '.join(CLASSES)}")
    arguments = mapping(f"{field}.{name}", given)
    known = [one.name for one in fields(CLASSES[name])]
    known_keys(f"{field}.{name}", arguments, known)
    try:
        return CLASSES[name](**arguments)
    except TypeError:  # a field without a default is missing
        refuse(OptionError, f"{field}.{name}", dict(arguments), f"must have the fields {', '.join(known)}")


def is_fixed(quantity: Distribution) -> bool:
    """Whether all draws give the same value."""
    low, high = quantity.support
    return low == high


def sampled(generator: np.random.Generator, quantity: Quantity, size: int | Size = ()) -> Array:
    """Draws from a number, a pair (low, high) or a distribution; one of a single value takes no random number."""
    shape = (size,) if isinstance(size, int) else size
    if isinstance(quantity, (Normal, LogUniform, Choice)):
        return np.full(shape, quantity.support[0]) if is_fixed(quantity) else quantity.draw(generator, shape)
    low, high = quantity if isinstance(quantity, tuple) else (quantity, quantity)
    return np.full(shape, low) if low == high else Uniform(low, high).draw(generator, shape)
