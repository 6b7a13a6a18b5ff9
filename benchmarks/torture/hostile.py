"""Values that no argument, or hardly any, should accept: one table for the suite and the campaign.

The campaign draws from `NUMBERS` and `TEXTS`; the suite gives every argument all of `hostile_values()`.
"""

import datetime
import decimal
import fractions
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from rover_gym import RoverGymError, StepError

#: Text that means something to whoever prints, interprets or opens it without escaping.
TEXTS = (
    "",
    "\x00",
    "\ud800",
    "../../etc/passwd",
    "</script><script>alert(1)</script>",
    '" } ] DEF Evil Script { url "javascript:x" }',
    "${x} {0} %s",
    "nan",
    "é\u202e\n\r\t",
    "x" * 70_000,
)
NAN, INFINITE = float("nan"), float("inf")
#: Numbers at the ends of their types, and beyond.
NUMBERS = (
    *(0, -1, 1, 2**31, 2**63, -(2**64), 10**400),
    *(0.0, -0.0, 5e-324, 1e-300, 1e308, -1e308, NAN, INFINITE, -INFINITE),
)
#: What hardly any argument takes.
THINGS: tuple[Any, ...] = (
    *(None, True, 1j, datetime.timedelta(seconds=1)),
    *([], [[]], {}, [1e308] * 3, [NAN] * 6, [[0.0] * 6] * 6),
    *(np.zeros((2, 0)), np.zeros(3, dtype=complex), np.array(["a", "b"])),
    *(b"bytes", object(), lambda: None, range(10**12), (0.0, 10**400)),
)

#: What is close to a number, or converts to one, and is none.
NO_NUMBERS: tuple[Any, ...] = (
    *(datetime.timedelta(seconds=1), np.timedelta64(1, "s"), np.datetime64("2010-01-01")),
    *(1.0 + 0.0j, np.complex128(1.0), np.array(1.0 + 0.0j), True, np.bool_(True)),
    *("1.0", b"1", 10**400, [1.0], {}, object(), np.ones(1), int),
)


class Odd:
    """Pretends to be a number and a pair, and is neither; it cannot even be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("I will not be shown")

    def __len__(self) -> int:
        return 2

    def __iter__(self) -> Iterator[float]:
        return iter(())

    def __float__(self) -> float:
        raise TypeError("I am no number")


def hostile_values() -> list[Any]:
    """All values, made anew: some can be read only once."""
    return [
        *(*NUMBERS, *TEXTS, *THINGS, *NO_NUMBERS),
        *(1.5, 1e16, 2**64, -(10**400), 10**5000, False, np.complex128(1 + 1j)),
        *("plane\0", bytearray(b"ab"), memoryview(b"ab")),
        *([1, 2], [1, 2, 3, 4], [[1, 2], [3, 4]], [[0.0], [0.0, 0.0]], {"a": 1}, {1: 2}, {1, 2}),
        *((NAN, 1.0), (1.0, NAN, 1.0), ("a", "b"), (None, None), (True, False), (1j, 2j)),
        *((2.0, 1.0), (1e308, 1e308), (-1e308, 1e308), (5e-324, 5e-324)),
        *(np.array([True, False]), np.array([1 + 1j, 2]), np.array(["1", "2"]), np.array([1, 2], dtype="m8[s]")),
        *(np.array(0.5), np.zeros((2, 2)), np.array([]), np.array([object(), object()]), np.zeros(12, complex)),
        *(Odd(), [Odd()] * 12, len, iter([1, 2]), (x for x in (1, 2)), slice(1)),
        *(fractions.Fraction(10**400), decimal.Decimal("sNaN"), decimal.Decimal("1e400")),
        *(np.longdouble("1e4000"), np.float16("nan"), NotImplemented, Ellipsis),
    ]


def throw(
    use: Callable[[Any], object],
    *fields: str,
    error: type[RoverGymError] = RoverGymError,
    never: Iterable[Any] = (),
) -> int:
    """Uses each hostile value, and those that are never accepted.

    Returns how many were refused, each by one of these fields or an entry of it.
    """
    refused = 0
    for value, may_pass in [*((value, True) for value in hostile_values()), *((value, False) for value in never)]:
        caught = None
        try:
            use(value)
        except RoverGymError as refusal:
            caught = refusal
        if caught is None:
            assert may_pass, value
            continue
        assert isinstance(caught, error)
        assert isinstance(caught, ValueError | StepError)
        assert caught.field
        assert not fields or any(f"{caught.field}[".startswith((f"{name}[", f"{name}.")) for name in fields), caught
        assert caught.field.split("[", maxsplit=1)[0] in str(caught)
        assert len(str(caught)) < 2000
        refused += 1
    return refused
