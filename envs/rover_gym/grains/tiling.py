"""Large beds of balls out of a settled tile."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rover_gym.grains.ball_bed import DENSITY, BallBed, box_walls, check_memory, settle, settled_balls
from rover_gym.grains.sizes import MOST_BALLS
from rover_gym.mechanics import OptionError
from rover_gym.validation import checked, number, refuse, whole

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
        refuse(OptionError, "tile", tile, f"makes a tile of {count:.3g} balls, not 1 to {MOST_BALLS}")
    check_memory("length", along * round(count))
    sizes = {"radius_min": radius_min, "radius_max": radius_max}
    bed = settled_balls(round(count), tile, across, **sizes, density=density, seed=seed, **options)
    if layers > 1.0:
        kept = bed.position[:, 1] + bed.radius <= layers * 2.0 * mean
    else:
        kept = np.random.default_rng(seed).random(len(bed.radius)) < layers
    if not kept.any():
        refuse(OptionError, "layers", layers, "leaves no ball")
    bed = replace(bed, radius=bed.radius[kept], mass=bed.mass[kept], position=bed.position[kept])
    settled = bed.simulation(**options)
    settle(settled)
    bed = replace(bed, position=settled.position)
    return tiled(bed, along, 1)
