"""Large beds of balls out of a settled tile."""

from __future__ import annotations

import numpy as np

from rover_gym.grains.ball_bed import BallBed, box_walls, check_memory
from rover_gym.mechanics import OptionError
from rover_gym.validation import whole

MOST_TILES = 10_000


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
