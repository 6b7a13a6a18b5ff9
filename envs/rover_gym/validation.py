"""Argument checks, whose errors name the field and carry the value.

Every function returns the argument in its plain form (floats, tuples of floats) or raises one of the package's errors
with `field` and `value` set.
"""

import math
import numbers
from collections.abc import Iterable, Mapping, Set, Sized
from decimal import Decimal
from typing import Any, NoReturn, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, RoverGymError

Range: TypeAlias = tuple[float, float]

#: A message shows at most this many characters of a value.
SHOWN = 200


def refuse(error: type[RoverGymError], field: str, value: object, reason: str) -> NoReturn:
    """Raises `error` with a message that names the field, and with `field` and `value` set."""
    exception = error(f"{field}: {reason}, got {shown(value)}")
    exception.field = field
    exception.value = value
    raise exception


def shown(value: object) -> str:
    """Formats any value for a message, cut to `SHOWN` characters."""
    try:
        text = repr(value.item() if isinstance(value, np.generic) else value)  # show np.float64(0.5) as 0.5
    except Exception:  # an integer of thousands of digits, or a user class whose repr raises
        text = f"a {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def number(
    field: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    error: type[RoverGymError] = OptionError,
) -> float:
    """Checks a finite number within bounds and returns it as a float."""
    if not _is_number(value):
        refuse(error, field, value, "must be a number")
    try:
        result = float(value)  # type: ignore[arg-type]
    except (OverflowError, ValueError):  # an integer or a fraction too large for a float, a signalling Decimal
        result = math.inf
    if not math.isfinite(result):
        refuse(error, field, value, "must be finite")
    if above is not None and not result > above:
        refuse(error, field, value, f"must be above {above:g}")
    if at_least is not None and not result >= at_least:
        refuse(error, field, value, f"must be at least {at_least:g}")
    if at_most is not None and not result <= at_most:
        refuse(error, field, value, f"must be at most {at_most:g}")
    return result


def whole(
    field: str,
    value: object,
    *,
    at_least: int = 0,
    at_most: int | None = None,
    error: type[RoverGymError] = OptionError,
) -> int:
    """Checks an integer within bounds and returns it as an int; 2.0 is refused."""
    if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (int, np.integer)) or value < at_least:
        refuse(error, field, value, f"must be a whole number from {at_least}")
    if at_most is not None and value > at_most:
        refuse(error, field, value, f"must be at most {at_most}")
    return int(value)


def flag(field: str, value: object) -> bool:
    """Checks a bool and returns it."""
    if not isinstance(value, (bool, np.bool_)):
        refuse(OptionError, field, value, "must be True or False")
    return bool(value)


def vector(field: str, value: object, size: int, *, error: type[RoverGymError] = OptionError) -> tuple[float, ...]:
    """Checks `size` finite numbers and returns them as a tuple of floats."""
    entries = _entries(value, size)
    if entries is None or len(entries) != size:
        refuse(error, field, value, f"must be {size} numbers")
    return tuple(number(f"{field}[{i}]", entry, error=error) for i, entry in enumerate(entries))


def array(field: str, value: object, *, error: type[RoverGymError]) -> npt.NDArray[np.float64]:
    """Copies numbers of any shape, finite or not, into a float64 array."""
    if isinstance(value, range):  # may be arbitrarily long
        refuse(error, field, value, "must be numbers")
    try:
        given = np.asarray(value)
    except Exception:  # a ragged sequence, or a user class that raises
        refuse(error, field, value, "must be numbers")
    if given.dtype.kind not in "fiu":
        refuse(error, field, value, "must be numbers")
    with np.errstate(over="ignore"):  # long doubles out of float64's range become infinite
        return given.astype(np.float64)


def span(
    field: str,
    value: object,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> Range:
    """Checks a number or a sampling range (low, high) and returns it as (low, high)."""
    if _is_number(value):
        single = number(field, value, above=above, at_least=at_least, at_most=at_most)
        return (single, single)
    match _entries(value, 2):
        case [first, last]:
            low = number(f"{field}[0]", first, above=above, at_least=at_least, at_most=at_most)
            high = number(f"{field}[1]", last, above=above, at_least=at_least, at_most=at_most)
        case _:
            refuse(OptionError, field, value, "must be a number or a pair (low, high)")
    if low > high:
        refuse(OptionError, field, value, "must be a pair (low, high) with low <= high")
    return (low, high)


def mapping(field: str, value: object) -> Mapping[str, Any]:
    """Checks a mapping and returns it; None gives an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        refuse(OptionError, field, value, "must be a mapping or None")
    return value


def known_keys(field: str, value: Iterable[object], known: Iterable[str]) -> None:
    """Refuses the first unknown key."""
    names = tuple(known)
    for key in value:
        if not isinstance(key, str) or key not in names:
            name = key if isinstance(key, str) and len(key) <= SHOWN else shown(key)
            refuse(OptionError, f"{field}.{name}", key, f"unknown; known are {', '.join(names)}")


def _is_number(value: object) -> bool:
    """Whether the value is a real number; bools, times, complex numbers, text, arrays and None are not."""
    if isinstance(value, (float, int)):
        return not isinstance(value, bool)
    if isinstance(value, np.generic):
        return value.dtype.kind in "fiu"
    return isinstance(value, (numbers.Real, Decimal))


def _entries(value: object, most: int) -> list[object] | None:
    """The entries of an ordered collection, or None if the value is not one or has more than `most`."""
    if isinstance(value, (str, bytes, bytearray, memoryview, Mapping, Set)):
        return None
    if not isinstance(value, Iterable) or not isinstance(value, Sized):
        return None
    try:
        return list(value) if len(value) <= most else None
    except TypeError:  # a zero-dimensional NumPy array
        return None
