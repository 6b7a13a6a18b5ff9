"""Random generators: NumPy's `Generator` over `PCG64`, and the rows of numbers that the core draws from.

A row is (4,) uint64: high and low half of the state, high and low half of the increment.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse, whole

Rows: TypeAlias = npt.NDArray[np.uint64]

_HALF = 1 << 64


def check_seed(seed: object, field: str = "seed") -> int | None:
    """Checks the seed of a random generator; None stays None."""
    return None if seed is None else whole(field, seed)


def spread_seeds(seed: object, n: int) -> list[int | None]:
    """One seed per rover: a single number seeds the first rover and increases by one per rover.

    Raises:
        OptionError: The seed is neither None, a whole number from 0, nor a sequence of n of these.
    """
    if isinstance(seed, (list, tuple, range)) or (isinstance(seed, np.ndarray) and seed.ndim == 1):
        if len(seed) != n:
            refuse(OptionError, "seed", seed, f"must be one seed, or {n}")
        return [check_seed(one, f"seed[{i}]") for i, one in enumerate(seed)]
    first = check_seed(seed)
    return [None if first is None else first + i for i in range(n)]


def fresh_seed() -> int:
    """A seed from the operating system, as NumPy's `SeedSequence` takes one."""
    entropy: int = np.random.SeedSequence().entropy  # type: ignore[assignment] # one number where none was given
    return entropy


def row_of(generator: np.random.Generator) -> Rows:
    """(4,) row of a generator.

    Raises:
        OptionError: The generator is not over `PCG64`.
    """
    known: dict[str, Any] = generator.bit_generator.state  # type: ignore[assignment] # a dictionary for PCG64
    if known["bit_generator"] != "PCG64":
        refuse(OptionError, "np_random", generator, "must be a generator over PCG64")
    state, increment = known["state"]["state"], known["state"]["inc"]
    return np.array([*divmod(state, _HALF), *divmod(increment, _HALF)], np.uint64)


def set_row(generator: np.random.Generator, row: Rows) -> None:
    """Sets a generator over `PCG64` to a row."""
    known: dict[str, Any] = generator.bit_generator.state  # type: ignore[assignment] # a dictionary for PCG64
    high, low, increment_high, increment_low = row.tolist()
    known["state"] = {"state": high * _HALF + low, "inc": increment_high * _HALF + increment_low}
    generator.bit_generator.state = known


def fresh_generator() -> np.random.Generator:
    """A new generator over `PCG64`, whose state is yet to be set."""
    return np.random.Generator(np.random.PCG64(0))


def generator_at(row: Rows) -> np.random.Generator:
    """A new generator at a row."""
    generator = fresh_generator()
    set_row(generator, row)
    return generator
