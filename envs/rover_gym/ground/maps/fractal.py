"""Generates rough ground from a seed: a self-affine surface, craters and ripples.

The surface is the sum of waves with random phases whose power falls as `k^(-2H - 2)` with the wave number k: its
heights differ over a distance d by about `d^H`, with H the Hurst exponent (Turcotte 1997, *Fractals and chaos in
geology and geophysics*, chapter 7).

A simple crater of diameter D is a paraboloid `0.2 D` deep from rim to floor with a rim of `0.036 D` (Pike 1977), around
it ejecta that fall off as `(r/R)^-3` (McGetchin, Settle and Head 1973).
"""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, TerrainError
from rover_gym.core.validation import number, refuse, whole

Heights: TypeAlias = npt.NDArray[np.float64]
Pair: TypeAlias = tuple[float, float]

#: Most heights of a map, whose waves take 110 bytes a height, and most craters.
MOST_HEIGHTS = 4 * 10**7
MOST_CRATERS = 10**6

#: Largest height and smallest length of ripples, m.
MOST_RIPPLE, LEAST_RIPPLE = 1e6, 1e-3

#: Smallest diameter of a crater, m.
LEAST_DIAMETER = 1e-3

#: Depth from rim to floor and height of the rim, as shares of the diameter.
CRATER_DEPTH = 0.2
CRATER_RIM = 0.036

#: Ejecta end at this many radii.
EJECTA = 3.0


def pair(field: str, value: object, *, above: float | None = None) -> Pair:
    """One number for both, or two."""
    try:
        first, second = value  # type: ignore[misc]
    except TypeError:
        first = second = value
    except ValueError:
        refuse(TerrainError, field, value, "must be one number or two")
    return (
        number(field, first, above=above, error=TerrainError),
        number(field, second, above=above, error=TerrainError),
    )


def fractal_map(
    size: float | tuple[float, float],
    spacing: float | tuple[float, float],
    roughness: float,
    *,
    hurst: float = 0.7,
    longest_wave: float | None = None,
    craters: float = 0.0,
    crater_diameter: tuple[float, float] = (0.5, 5.0),
    ripple_height: float = 0.0,
    ripple_length: float = 1.0,
    seed: int = 0,
    origin: tuple[float, float] | None = None,
    material: str = "ground",
) -> HeightField:
    """Generates rough ground from a seed: a self-affine surface, optionally with craters and ripples.

    The power of a wave of k cycles a metre falls as k^(-2 hurst - 2) from `longest_wave` to two
    cells. Craters are bowls with a rim, a fifth as deep as wide; those as wide as D or wider
    number D^-2. Ripples are waves across x, steeper on one side.

    Args:
        size: Extent along x and z, m: one number, or two.
        spacing: Distance of columns and of rows, m.
        roughness: Root mean square of the rough part's heights, m.
        hurst: Hurst exponent, in (0, 1); 0.7 by default.
        longest_wave: Longest wave, m; half the smaller extent by default.
        craters: Expected number of craters in each m² of a diameter of 1 m or more; 0 by
            default.
        crater_diameter: Smallest and largest diameter of craters, m; (0.5, 5) by default.
        ripple_height: Height of ripples from trough to crest, m; 0 by default.
        ripple_length: Their wavelength, m.
        seed: Seed of the random numbers; equal seeds give equal ground.
        origin: Place (x, z) of the first height, m; by default the middle of the map is at the world's origin.
        material: Name of its material.

    Raises:
        TerrainError: An argument is out of its range.

    Source: Turcotte 1997 (spectral synthesis); Pike 1977 and McGetchin, Settle and Head
    1973 (craters).
    """
    extent, step = pair("size", size, above=0.0), pair("spacing", spacing, above=0.0)
    rms = number("roughness", roughness, at_least=0.0, error=TerrainError)
    exponent = number("hurst", hurst, above=0.0, at_most=1.0, error=TerrainError)
    counts = [extent[k] / step[k] for k in range(2)]
    if max(counts) > MOST_HEIGHTS or (counts[0] + 2) * (counts[1] + 2) > MOST_HEIGHTS:
        refuse(TerrainError, "size", size, f"gives more than {MOST_HEIGHTS} heights")
    columns, rows = (max(2, math.floor(n + 0.5) + 1) for n in counts)
    longest = 0.5 * min(extent)
    if longest_wave is not None:
        longest = number("longest_wave", longest_wave, at_least=2.0 * max(step), error=TerrainError)
    random = np.random.default_rng(whole("seed", seed, error=TerrainError))
    place = (-0.5 * step[0] * (columns - 1), -0.5 * step[1] * (rows - 1)) if origin is None else pair("origin", origin)

    heights = _rough(random, (rows, columns), step, rms, exponent, longest)
    density = number("craters", craters, at_least=0.0, error=TerrainError)
    smallest, largest = pair("crater_diameter", crater_diameter, above=0.0)
    number("crater_diameter", smallest, at_least=LEAST_DIAMETER, error=TerrainError)
    if largest < smallest:
        refuse(TerrainError, "crater_diameter", crater_diameter, "must be a pair (smallest, largest)")
    if density > 0.0:
        _add_craters(random, heights, step, density, smallest, largest)
    ripple = number("ripple_height", ripple_height, at_least=0.0, at_most=MOST_RIPPLE, error=TerrainError)
    length = number("ripple_length", ripple_length, at_least=LEAST_RIPPLE, error=TerrainError)
    if ripple > 0.0:
        phase = 2.0 * np.pi * (np.arange(columns) * step[0] / length + random.random())
        heights += 0.5 * ripple * np.sin(phase + 0.5 * np.sin(phase))
    return HeightField(heights.astype(np.float32), step, place, material)


def _rough(
    random: np.random.Generator, shape: tuple[int, int], step: Pair, rms: float, hurst: float, longest: float
) -> Heights:
    """A self-affine surface with mean 0 and the given root mean square, m."""
    rows, columns = shape
    # Twice the map, since the waves repeat.
    high, wide = 2 * rows, 2 * columns
    k = np.hypot(np.fft.fftfreq(high, step[1])[:, None], np.fft.rfftfreq(wide, step[0])[None, :])
    waves = random.standard_normal(k.shape) + 1j * random.standard_normal(k.shape)
    with np.errstate(divide="ignore"):
        waves *= np.where(k >= 1.0 / longest, k ** (-hurst - 1.0), 0.0)
    heights: Heights = np.fft.irfft2(waves, (high, wide))[:rows, :columns]
    heights -= heights.mean()
    spread = math.sqrt(float((heights**2).mean()))
    return heights * (rms / spread) if spread > 0.0 else np.zeros(shape)


def _add_craters(
    random: np.random.Generator, heights: Heights, step: Pair, density: float, smallest: float, largest: float
) -> None:
    """Adds craters with `density D^-2` of them a m² at least as wide as D, the largest first."""
    rows, columns = heights.shape
    margin = 0.5 * EJECTA * largest
    extent = (step[0] * (columns - 1), step[1] * (rows - 1))
    area = (extent[0] + 2.0 * margin) * (extent[1] + 2.0 * margin)
    expected = density * (smallest**-2 - largest**-2) * area
    if not expected < MOST_CRATERS:
        refuse(TerrainError, "craters", density, f"gives more than {MOST_CRATERS} craters")
    count = int(random.poisson(expected))
    share = random.random(count)
    diameters = np.sort((smallest**-2 - share * (smallest**-2 - largest**-2)) ** -0.5)[::-1]
    places = random.random((count, 2)) * [extent[0] + 2.0 * margin, extent[1] + 2.0 * margin] - margin
    for diameter, (x, z) in zip(diameters, places, strict=True):
        radius = 0.5 * diameter
        low = [max(0, math.floor((c - EJECTA * radius) / s)) for c, s in zip((x, z), step, strict=True)]
        high = [
            min(n, math.ceil((c + EJECTA * radius) / s) + 1)
            for c, s, n in zip((x, z), step, (columns, rows), strict=True)
        ]
        if low[0] >= high[0] or low[1] >= high[1]:
            continue
        across = np.arange(low[0], high[0]) * step[0] - x
        along = np.arange(low[1], high[1]) * step[1] - z
        r = np.hypot(across[None, :], along[:, None]) / radius
        depth, rim = CRATER_DEPTH * diameter, CRATER_RIM * diameter
        bowl = rim - depth + depth * r**2
        ejecta = rim * np.maximum(r, 1.0) ** -3 - rim * EJECTA**-3
        part = heights[low[1] : high[1], low[0] : high[0]]
        part += np.where(r < 1.0, bowl - rim * EJECTA**-3, np.where(r < EJECTA, ejecta, 0.0))
