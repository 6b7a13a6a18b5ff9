"""Beds of balls in space: balls that settled in a box under gravity."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, OptionError, arrange_balls
from rover_gym.core.validation import array, checked, number, refuse, whole
from rover_gym.ground.grains.grain_surface import surface_map

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
        refuse(OptionError, "diameters", diameters, "must be two or more positive lengths")
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


DENSITY = 2600.0  # kg/m³, of quartz

#: Memory of a ball in a simulation of a settled bed, with its contacts and what Python holds, bytes.
BYTES_PER_BALL = 5000

#: A bed has settled when its balls' mean speed is this share of that of a fall by a radius.
SETTLED = 0.02

#: Falls from the height of the loose packing that settling may take.
MOST_FALLS = 12.0


@dataclass(frozen=True)
class BallBed:
    """Balls at rest in a box with a floor at height 0.

    Attributes:
        radius: (n,) m.
        mass: (n,) kg.
        position: (n, 3) m.
        walls: (5, 6) floor and four sides, each as a point and the normal to its free side.
        width: Distance of the walls along x, from x = 0, m.
        depth: Distance of the walls along z, from z = 0, m.
    """

    radius: Array
    mass: Array
    position: Array
    walls: Array
    width: float
    depth: float

    @property
    def surface(self) -> float:
        """Mean height of the surface, m."""
        return float(np.nanmean(surface_map(self.position, self.radius).heights))

    @property
    def top(self) -> float:
        """Highest point of the balls, m."""
        return float((self.position[:, 1] + self.radius).max())

    @property
    def packing(self) -> float:
        """Share of the room below 0.8 of the surface's height that balls fill: upright sections through each."""
        height = 0.8 * self.surface
        low = np.clip((self.position[:, 1] - self.radius), 0.0, height)
        high = np.clip((self.position[:, 1] + self.radius), 0.0, height)
        a, b = low - self.position[:, 1], high - self.position[:, 1]
        volumes = np.pi * (self.radius**2 * (b - a) - (b**3 - a**3) / 3.0)
        return float(volumes.sum() / (self.width * self.depth * height))

    def simulation(self, **options: Any) -> GrainSimulation:
        """The bed as a simulation; the options are those of `GrainSimulation`."""
        return GrainSimulation(self.radius, self.mass, self.position, **{"walls": self.walls, **options})


def check_memory(field: str, count: int) -> None:
    """Refuses more balls than fit into the memory that is free, before any of it is taken.

    Args:
        field: Name of the argument that sets the number.
        count: Number of balls.

    Raises:
        OptionError: More than a million balls, or more than fit.
    """
    if count > MOST_BALLS:
        refuse(OptionError, field, count, f"gives more than {MOST_BALLS} balls")
    needed = count * BYTES_PER_BALL
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else needed
    if needed > free:
        refuse(OptionError, field, count, f"needs about {needed / 1e6:.0f} MB of memory, {free / 1e6:.0f} MB are free")


@checked(width=float, depth=float)
def box_walls(width: float, depth: float) -> Array:
    """(5, 6) a floor at height 0 and four sides, from x = 0 and z = 0, each as a point and the normal to its free side.

    Args:
        width: Distance of the walls along x, m.
        depth: Distance of the walls along z, m.
    """
    walls = np.zeros((5, 6))
    walls[0, 4] = walls[1, 3] = walls[3, 5] = 1.0
    walls[2, [0, 3]] = width, -1.0
    walls[4, [2, 5]] = depth, -1.0
    return walls


def settled_balls(
    count: int,
    width: float,
    depth: float,
    *,
    radius_min: float | None = None,
    radius_max: float | None = None,
    radius: npt.ArrayLike | None = None,
    density: float = DENSITY,
    seed: int = 0,
    **options: Any,
) -> BallBed:
    """Drops a loose packing into a box and lets it come to rest.

    Args:
        count: Number of balls.
        width: Length of the box along x, m.
        depth: Length of the box along z, m.
        radius_min: Smallest radius, m, of radii drawn evenly;
        radius_max: and the largest.
        radius: The radii, (count,), m, instead of a range: such as `sieved_radii` draws.
        density: Of the balls, kg/m³.
        seed: Of radii and places; equal seeds give equal beds.
        **options: Those of `GrainSimulation`, such as friction and gravity.

    Raises:
        OptionError: A number is out of its range, the box is too small for the balls, they need more memory than there
            is, there are both radii and a range or neither, or there is no gravity.
        ModelError: An option is invalid.
        StepError: A step failed.
    """
    count = whole("count", count, at_least=1, at_most=MOST_BALLS, error=OptionError)
    width, depth = number("width", width, above=0.0), number("depth", depth, above=0.0)
    density = number("density", density, above=0.0)
    check_memory("count", count)
    if radius is None:
        radii = even_radii(count, radius_min, radius_max, seed)
    elif radius_min is not None or radius_max is not None:
        refuse(OptionError, "radius", radius, "cannot be combined with radius_min and radius_max")
    else:
        radii = np.asarray(radius, dtype=float)
        if radii.shape != (count,) or not (np.isfinite(radii) & (radii > 0.0)).all():
            refuse(OptionError, "radius", radius, f"must be {count} positive lengths")
    largest = float(radii.max())
    for name, length in (("width", width), ("depth", depth)):
        if length < 2.01 * largest:
            refuse(OptionError, name, length, f"leaves no room for the largest ball's diameter, {2.0 * largest:g} m")
    position = arrange_balls(radii, width=width, depth=depth, seed=seed)
    packing = (radii, 4.0 / 3.0 * np.pi * density * radii**3, position)
    walls = box_walls(width, depth)
    sim = GrainSimulation(*packing, walls=walls, **options)
    settle(sim)
    return BallBed(sim.radius, sim.mass, sim.position, walls, width, depth)


@checked(sim="GrainSimulation")
def settle(sim: GrainSimulation) -> None:
    """Steps balls until they are at rest, or for a time in which they could have fallen 12 times from their top.

    Raises:
        OptionError: There is no gravity.
        StepError: A step failed.
    """
    g = float(np.linalg.norm(sim.settings["gravity"]))
    if g == 0.0:
        refuse(OptionError, "gravity", sim.settings["gravity"], "must point down, so that the balls settle")
    places = sim.position[:, 1]
    height = float((places + sim.radius).max() - (places - sim.radius).min())
    still = SETTLED * float(np.sqrt(2.0 * g * sim.radius.mean()))
    fall = float(np.sqrt(2.0 * height / g))
    start = sim.time
    while sim.time - start < MOST_FALLS * fall:
        sim.step(10)
        speed = float(np.sqrt(2.0 * sim.energy().kinetic / sim.mass.sum()))
        if sim.time - start > fall and speed < still:
            break


MOST_TILES = 10_000

#: Share of the room in a shallow bed that settled balls fill, up to the tops of the uppermost.
PACKING = 0.5


@checked(bed="BallBed")
def tiled(bed: BallBed, along: int, across: int) -> BallBed:
    """Lays a bed beside its mirror images, as often as wanted along x and z.

    Each tile is mirrored in the wall that it shares with the one before. So no two balls overlap, and a ball that
    leaned on a wall leans on its image. Images bear no friction between each other: what the friction of a wall held
    sags by some hundredths of a radius.

    Args:
        bed: The tile.
        along: Tiles along x.
        across: Tiles along z.

    Returns:
        The bed of all tiles, in one box.

    Raises:
        OptionError: A number of tiles is not positive, or the bed would not fit into the memory.
    """
    along = whole("along", along, at_least=1, at_most=MOST_TILES, error=OptionError)
    across = whole("across", across, at_least=1, at_most=MOST_TILES, error=OptionError)
    n = along * across
    check_memory("along", n * len(bed.radius))
    position = np.repeat(bed.position[None], n, axis=0)
    i, k = (index.ravel()[:, None] for index in np.meshgrid(np.arange(along), np.arange(across), indexing="ij"))
    for axis, index, size in ((0, i, bed.width), (2, k, bed.depth)):
        own = position[:, :, axis]
        position[:, :, axis] = index * size + np.where(index % 2 == 0, own, size - own)
    width, depth = along * bed.width, across * bed.depth
    return BallBed(
        np.tile(bed.radius, n),
        np.tile(bed.mass, n),
        position.reshape(-1, 3),
        box_walls(width, depth),
        width,
        depth,
    )


def settled_track(
    length: float,
    across: float,
    layers: float,
    *,
    tile: float = 1.0,
    radius_min: float,
    radius_max: float,
    density: float = DENSITY,
    seed: int = 0,
    **options: Any,
) -> BallBed:
    """A long shallow bed out of one settled tile, without the balls that reach above its layers, if there are several.

    Args:
        length: Least length along x, m; whole tiles are laid.
        across: Width along z, m.
        layers: Depth of the bed in mean diameters, about; below 1, the share of a layer that stays, drawn by the seed.
        tile: Length of the settled tile, m.
        radius_min: Smallest radius, m, of radii drawn evenly;
        radius_max: and the largest.
        density: Of the balls, kg/m³.
        seed: Of radii and places; equal seeds give equal beds.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the bed would not fit into the memory.
    """
    length, across = number("length", length, above=0.0), number("across", across, above=0.0)
    layers, tile = number("layers", layers, above=0.0), number("tile", tile, above=0.0, at_most=length)
    mean = 0.5 * (number("radius_min", radius_min, above=0.0) + number("radius_max", radius_max, above=0.0))
    along = math.ceil(length / tile - 1e-9)
    count = PACKING * tile * across * max(layers, 1.0) * 2.0 * mean / (4.0 / 3.0 * math.pi * mean**3)
    if not 1.0 <= count <= MOST_BALLS:
        refuse(OptionError, "tile", tile, f"gives a tile of {count:.3g} balls; 1 to {MOST_BALLS} are allowed")
    check_memory("length", along * round(count))
    sizes = {"radius_min": radius_min, "radius_max": radius_max}
    bed = settled_balls(round(count), tile, across, **sizes, density=density, seed=seed, **options)
    if layers > 1.0:
        kept = bed.position[:, 1] + bed.radius <= layers * 2.0 * mean
    else:
        kept = np.random.default_rng(seed).random(len(bed.radius)) < layers
    if not kept.any():
        refuse(OptionError, "layers", layers, "gives a bed without balls")
    bed = replace(bed, radius=bed.radius[kept], mass=bed.mass[kept], position=bed.position[kept])
    settled = bed.simulation(**options)
    settle(settled)
    bed = replace(bed, position=settled.position)
    return tiled(bed, along, 1)
