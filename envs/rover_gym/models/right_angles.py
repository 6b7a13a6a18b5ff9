"""Multiples of pi/2 that a file writes with few digits, such as 1.5708 and 3.14159.

Two wheels of four that are turned by 3.14159 instead of pi stand micrometres apart, which decides how a rigid chassis
on rigid ground shares its weight.
"""

from __future__ import annotations

import math
from decimal import ROUND_DOWN, ROUND_HALF_EVEN, Decimal

#: Largest multiple, of both signs: two turns.
LARGEST = 8
#: Fewest and most decimals: 1.57 means pi/2, and 1.6 means 1.6.
DECIMALS = range(2, 13)
#: An angle this close has all its digits, rad.
EXACT = 1e-12


def right_angle(word: str) -> tuple[float, str] | None:
    """The multiple of pi/2 that a number means by its digits, rad, and its name.

    Args:
        word: A finite number as it was written.

    Returns:
        None if the number is none, rounded or cut to its own decimals, and if it has all digits already.
    """
    written = Decimal(word)
    exponent = written.as_tuple().exponent
    if not isinstance(exponent, int) or -exponent not in DECIMALS:
        return None
    count = round(float(written) / (math.pi / 2.0)) if abs(written) < 100 else 0
    if count == 0 or abs(count) > LARGEST:
        return None
    angle = count * (math.pi / 2.0)
    if abs(float(written) - angle) <= EXACT:
        return None
    roundings = (Decimal(angle).quantize(written, rounding) for rounding in (ROUND_DOWN, ROUND_HALF_EVEN))
    return (angle, _name(count)) if written in roundings else None


def _name(count: int) -> str:
    """A multiple of pi/2 in words, such as -3 pi/2."""
    whole = count // 2 if count % 2 == 0 else count
    factor = {1: "", -1: "-"}.get(whole, f"{whole} ")
    return f"{factor}pi{'' if count % 2 == 0 else '/2'}"
