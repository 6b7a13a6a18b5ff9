"""Argument checks, whose errors name the field and carry the value.

Every function returns the argument in its plain form (floats, tuples of floats) or raises one of the package's errors
with `field` and `value` set.
"""

import functools
import inspect
import math
import numbers
import os
import stat
from collections.abc import Callable, Iterable, Mapping, Sequence, Set, Sized
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn, ParamSpec, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverGymError

P = ParamSpec("P")
R = TypeVar("R")

Range: TypeAlias = tuple[float, float]
#: Names of the classes of grounds, for `checked`.
TERRAINS = ("Plane", "SphereField", "HeightField", "TriangleMesh", "SoftGround", "Union")
#: What an argument may be: see `checked`.
Kind: TypeAlias = Any

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


def regular_file(path: object, *, error: type[RoverGymError]) -> Path:
    """Checks the path of a file to be read and returns it.

    Raises:
        RoverGymError: `path` is no path, or that of a directory, a pipe or the like.
        OSError: There is no such file.
    """
    if not isinstance(path, (str, os.PathLike)):
        refuse(error, "path", path, "must be a path")
    place = Path(os.fsdecode(path))
    try:
        is_regular = stat.S_ISREG(place.stat().st_mode)
    except ValueError:  # a name that no file can have
        refuse(error, "path", str(place), "must be the path of a file")
    if not is_regular:  # opening a pipe would wait for its writer
        refuse(error, "path", str(place), "must be the path of a regular file")
    return place


def text_of_file(path: object, most_bytes: int, *, error: type[RoverGymError]) -> str:
    """Reads a file of UTF-8 text, of which no more than `most_bytes` are read.

    Raises:
        RoverGymError: `path` is not that of a regular file, or the file is longer or no such text.
        OSError: The file cannot be read.
    """
    place = regular_file(path, error=error)
    with place.open("rb") as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        refuse(error, "path", str(place), f"the file is longer than {most_bytes} bytes")
    try:
        return content.decode()
    except UnicodeDecodeError:
        refuse(error, "path", str(place), "the file is not UTF-8 text")


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


def checked(**kinds: Kind) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Makes a function refuse arguments of the wrong kind by their names, before it begins.

    Args:
        **kinds: What each argument must be. `float`: a finite number. `int`: a whole number. `bool`: True or False.
            `str`: text. `Path`: text or a path. `np.ndarray`: numbers of any shape. `Mapping`: one with text for keys.
            `Sequence`: one that is no text. `Iterable`. `callable`: what can be called. `[Kind]`: a sequence with
            entries of that kind. A name: an instance of the class of that name, which need not be imported for it. A
            tuple: one of several, where None stands for itself.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs).arguments
            for name, kind in kinds.items():
                if name in given:
                    _check_kind(name, given[name], kind)
            return function(*args, **kwargs)

        return guarded

    return decorate


def _check_kind(field: str, value: object, kind: Kind) -> None:
    kinds = kind if isinstance(kind, tuple) else (kind,)
    if value is None and None in kinds:
        return
    kinds = tuple(one for one in kinds if one is not None)
    if fitting := [one for one in kinds if _is_of_kind(value, one)]:
        if float in fitting:
            number(field, value)
        elif int in fitting:
            whole(field, value)
        return
    words = [_in_words(one) for one in kinds]
    if kinds != (kind if isinstance(kind, tuple) else (kind,)):
        words.append("None")
    refuse(OptionError, field, value, f"must be {' or '.join(words)}")


#: Kinds of arguments in words.
_KINDS: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "text",
    Path: "a path",
    Sequence: "a sequence",
    Mapping: "a mapping with names",
    Iterable: "a collection",
    callable: "callable",
    np.ndarray: "numbers",
}


def _is_of_kind(value: object, kind: Kind) -> bool:
    if kind is float:
        return _is_number(value)
    if kind is int:
        return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if kind is Path:
        return isinstance(value, (str, os.PathLike)) and _is_encodable(os.fspath(value))
    if kind is Mapping:
        return isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    if kind is Sequence:
        return isinstance(value, Iterable) and isinstance(value, Sized) and not isinstance(value, (str, bytes, Mapping))
    if kind is callable:
        return bool(callable(value))
    if kind is np.ndarray:
        return _is_array(value)
    if isinstance(kind, list):
        return _is_of_kind(value, Sequence) and all(_is_of_kind(one, kind[0]) for one in _listed(value))
    if isinstance(kind, str):
        return any(one.__name__ == kind for one in type(value).__mro__)
    return isinstance(value, kind)


def _is_encodable(path: str | bytes) -> bool:
    try:
        return b"\0" not in os.fsencode(path)
    except UnicodeEncodeError:  # a lone surrogate
        return False


def _in_words(kind: Kind) -> str:
    if isinstance(kind, list):
        return f"a sequence, each entry {_in_words(kind[0])}"
    return f"a {kind}" if isinstance(kind, str) else _KINDS[kind]


def _is_array(value: object) -> bool:
    try:
        array("value", value, error=OptionError)
    except OptionError:
        return False
    return True


def _listed(value: Any) -> list[object]:
    """The entries of what may be any collection; one that cannot be listed gives an entry of no kind."""
    if isinstance(value, range):
        return [None]
    try:
        return list(value)
    except Exception:  # a zero-dimensional array, or a user class that raises
        return [None]


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
