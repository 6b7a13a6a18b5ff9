"""Computes the reference values of the elementary functions with mpmath, to 200 bits.

    python tests/golden/pack_elementary.py

A value is stored as the nearest number and what that leaves, so that a test can tell errors below one unit in the
last place. Angles near the multiples of pi/2 are the hard ones: few bits of the argument are left.
"""

import json
import random
from collections.abc import Callable
from pathlib import Path

import mpmath

PACKED = Path(__file__).parent / "elementary.json"


def pack() -> str:
    """The references as JSON text."""
    mpmath.mp.prec = 200
    draws = random.Random(15)  # noqa: S311

    def spread(low: float, high: float, count: int) -> list[float]:
        return [draws.choice((-1, 1)) * 10 ** draws.uniform(low, high) for _ in range(count)]

    quarters = [1, 2, 3, 4, 29, 31, 2_247, 58_285, 63_661, 9_000_001]
    angles = [float(n * mpmath.pi / 4) for n in [*range(1, 9), 31, 127_323]]
    angles += [float(n * mpmath.pi / 2) for n in quarters] + spread(-9, 0, 20) + spread(0, 5, 40) + [1e9, -1e22]
    exponents = spread(-12, 0, 30) + [draws.uniform(-40, 40) for _ in range(30)] + [700.1, 709.7, -37.0, 0.35, -0.35]
    points = [(draws.uniform(-1, 1), draws.uniform(-1, 1)) for _ in range(30)] + [(1e-9, -1.0), (3.0, 1e-12)]
    ratios = [x for point in points for x in point if abs(x) <= 1]
    packed = {
        "meta": {
            "what": "Arguments, then the nearest number to each value and what it leaves.",
            "generator": "tests/golden/pack_elementary.py, mpmath, 200 bits",
        },
        "sin_cos": [[x, *_halves(mpmath.sin, x), *_halves(mpmath.cos, x)] for x in angles],
        "exp_m1": [[x, *_halves(mpmath.expm1, x)] for x in exponents],
        "exp": [[x, *_halves(mpmath.exp, x)] for x in exponents],
        "ln": [[abs(x), *_halves(mpmath.log, abs(x))] for x in exponents],
        "ln_1p": [[abs(x), *_halves(mpmath.log1p, abs(x))] for x in exponents],
        "acos": [[x, *_halves(mpmath.acos, x)] for x in ratios],
        "asin": [[x, *_halves(mpmath.asin, x)] for x in ratios],
        "atan2": [[y, x, *_halves(mpmath.atan2, y, x)] for y, x in points],
        "hypot": [[y, x, *_halves(mpmath.hypot, y, x)] for y, x in [*points, (1e200, -1e200), (3e-170, 4e-170)]],
    }
    return "{" + ",\n".join(f'"{name}": {json.dumps(rows)}' for name, rows in packed.items()) + "}\n"


def _halves(function: Callable[..., mpmath.mpf], *arguments: float) -> list[float]:
    value = function(*(mpmath.mpf(x) for x in arguments))
    nearest = float(value)
    return [nearest, float(value - nearest)]


if __name__ == "__main__":
    PACKED.write_text(pack(), encoding="utf-8")
