"""Arguments are refused here, with the field's name and the value that was given.

Every function returns the argument in its plain form (floats, tuples of floats) or raises one of
the errors of the package, with `field` and `value` set.
"""

import math
from collections.abc import Iterable
from typing import NoReturn, TypeAlias

from rover_gym._core import OptionError, RoverGymError

Range: TypeAlias = tuple[float, float]


def refuse(error: type[RoverGymError], field: str, value: object, reason: str) -> NoReturn:
    """Raises `error`, which names the field and carries the value."""
    exception = error(f"{field}: {reason}, got {value!r}")
    exception.field = field
    exception.value = value
    raise exception


def number(
    field: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    error: type[RoverGymError] = OptionError,
) -> float:
    """A finite number within bounds, as a float."""
    if isinstance(value, bool) or not _is_number(value):
        refuse(error, field, value, "must be a number")
    result = float(value)  # type: ignore[arg-type]
    if not math.isfinite(result):
        refuse(error, field, value, "must be finite")
    if above is not None and not result > above:
        refuse(error, field, value, f"must be above {above:g}")
    if at_least is not None and not result >= at_least:
        refuse(error, field, value, f"must be at least {at_least:g}")
    if at_most is not None and not result <= at_most:
        refuse(error, field, value, f"must be at most {at_most:g}")
    return result


def vector(field: str, value: object, size: int, *, error: type[RoverGymError] = OptionError) -> tuple[float, ...]:
    """`size` finite numbers, as a tuple of floats."""
    entries = _entries(value)
    if entries is None or len(entries) != size:
        refuse(error, field, value, f"must be {size} numbers")
    return tuple(number(f"{field}[{i}]", entry, error=error) for i, entry in enumerate(entries))


def span(
    field: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> Range:
    """A number, or a pair (low, high) to sample from: always returned as (low, high)."""
    if _is_number(value):
        single = number(field, value, above=above, at_least=at_least, at_most=at_most)
        return (single, single)
    match _entries(value):
        case [first, last]:
            low = number(f"{field}[0]", first, above=above, at_least=at_least, at_most=at_most)
            high = number(f"{field}[1]", last, above=above, at_least=at_least, at_most=at_most)
        case _:
            refuse(OptionError, field, value, "must be a number or a pair (low, high)")
    if low > high:
        refuse(OptionError, field, value, "must be a pair (low, high) with low <= high")
    return (low, high)


def known_keys(field: str, value: Iterable[str], known: Iterable[str]) -> None:
    """Refuses the first key that is not known."""
    names = tuple(known)
    for key in value:
        if key not in names:
            refuse(OptionError, f"{field}.{key}", key, f"unknown; known are {', '.join(names)}")


def _is_number(value: object) -> bool:
    # Covers int, float and numpy scalars, not strings, arrays or None.
    return not isinstance(value, (str, bytes)) and hasattr(value, "__float__") and not hasattr(value, "__len__")


def _entries(value: object) -> list[object] | None:
    if isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable):
        return None
    try:
        return list(value)
    except TypeError:  # a numpy array without dimensions
        return None
