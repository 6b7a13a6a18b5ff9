"""Sizes of balls drawn from a distribution: even, lognormal, or that of a sieve analysis."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError
from rover_gym.validation import array, number, refuse, whole

Array = npt.NDArray[np.float64]

MOST_BALLS = 1_000_000
#: Radii beyond so many deviations of a lognormal distribution are drawn again.
MOST_DEVIATIONS = 3.0


def even_radii(count: int, radius_min: float | None, radius_max: float | None, seed: int = 0) -> Array:
    """Draws radii evenly from a range.

    Args:
        count: Number of balls.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        seed: Of the numbers; equal seeds give equal radii.

    Returns:
        Radii, (count,), m.

    Raises:
        OptionError: A number is out of its range.
    """
    count, random = _count(count), _random(seed)
    low = number("radius_min", radius_min, above=0.0)
    high = number("radius_max", radius_max, at_least=low)
    return random.uniform(low, high, count)


def lognormal_radii(count: int, median: float, deviation: float, seed: int = 0) -> Array:
    """Draws radii whose logarithms are normal, cut at three deviations.

    Args:
        count: Number of balls.
        median: Median radius, m.
        deviation: Standard deviation of the logarithm, at most 1.
        seed: Of the numbers; equal seeds give equal radii.

    Returns:
        Radii, (count,), m.

    Raises:
        OptionError: A number is out of its range.
    """
    count, random = _count(count), _random(seed)
    median = number("median", median, above=0.0)
    deviation = number("deviation", deviation, at_least=0.0, at_most=1.0)
    z = random.standard_normal(count)
    while (beyond := np.abs(z) > MOST_DEVIATIONS).any():
        z[beyond] = random.standard_normal(int(beyond.sum()))
    return np.asarray(median * np.exp(deviation * z))


def sieved_radii(count: int, diameters: npt.ArrayLike, passing: npt.ArrayLike, seed: int = 0) -> Array:
    """Draws radii by a sieve analysis.

    Between two sieves the mass is spread evenly over the logarithm of the diameter. The balls are of one density, so
    in number the small ones prevail: a ball of diameter d is drawn as often as its share of the mass over d³.

    Args:
        count: Number of balls.
        diameters: Openings of the sieves, (m,), m, increasing; nothing is smaller than the first.
        passing: Share of the mass that passes each, (m,), from 0 to 1, not decreasing.
        seed: Of the numbers; equal seeds give equal radii.

    Returns:
        Radii, (count,), m.

    Raises:
        OptionError: The table is no sieve curve.
    """
    count, random = _count(count), _random(seed)
    openings = array("diameters", diameters, error=OptionError)
    shares = array("passing", passing, error=OptionError)
    if openings.ndim != 1 or len(openings) < 2 or not (np.isfinite(openings) & (openings > 0.0)).all():
        refuse(OptionError, "diameters", diameters, "must be at least two positive lengths")
    if (np.diff(openings) <= 0.0).any():
        refuse(OptionError, "diameters", diameters, "must increase")
    if shares.shape != openings.shape or not np.isfinite(shares).all() or (np.diff(shares) < 0.0).any():
        refuse(OptionError, "passing", passing, "must be one share for each sieve, not decreasing")
    if shares[0] != 0.0 or shares[-1] != 1.0:
        refuse(OptionError, "passing", passing, "must begin with 0 and end with 1")
    # With mass even in x = ln d, the number of balls goes with exp(-3 x): its integral over each piece.
    x = np.log(openings)
    fine = np.exp(-3.0 * (x - x[0]))
    pieces = np.diff(shares) / np.diff(x) * -np.diff(fine) / 3.0
    piece = random.choice(len(pieces), size=count, p=pieces / pieces.sum())
    u = random.random(count)
    drawn = fine[piece] + u * (fine[piece + 1] - fine[piece])
    return np.asarray(0.5 * openings[0] * drawn ** (-1.0 / 3.0))


def _count(count: int) -> int:
    return whole("count", count, at_least=1, at_most=MOST_BALLS, error=OptionError)


def _random(seed: int) -> np.random.Generator:
    return np.random.default_rng(whole("seed", seed, at_least=0, error=OptionError))
