"""Cuts a map into patches, each with a material of its own, for a friction that differs from place to place."""

import numpy as np

from rover_gym.core import HeightField, TerrainError, Union
from rover_gym.core.validation import checked, refuse, whole

#: Most patches along a side; a step looks at each of them.
MOST_PATCHES = 100


@checked(ground="HeightField")
def patched_map(ground: HeightField, rows: int, columns: int) -> Union:
    """Cuts a map into a grid of patches that meet without gaps.

    Their materials are `patch_0_0`, `patch_0_1` and so on, by row along z and column along x. Patches without any known
    ground are left out.

    Args:
        ground: The map.
        rows: Patches along z.
        columns: Patches along x.

    Raises:
        OptionError: A number is not within 1 to 100.
        TerrainError: The map has fewer cells than patches along a side.
    """
    heights, (dx, dz), (x, z) = ground.grid, ground.spacing, ground.origin
    edges = []
    for name, given, points in (("rows", rows, heights.shape[0]), ("columns", columns, heights.shape[1])):
        n, cells = whole(name, given, at_least=1, at_most=MOST_PATCHES), points - 1
        if n > cells:
            refuse(TerrainError, name, n, f"must be at most {cells}, the cells of the map along this side")
        edges.append(np.round(np.linspace(0, cells, n + 1)).astype(int).tolist())
    patches = []
    for j, (top, bottom) in enumerate(zip(edges[0], edges[0][1:], strict=False)):
        for i, (left, right) in enumerate(zip(edges[1], edges[1][1:], strict=False)):
            own = heights[top : bottom + 1, left : right + 1]
            known = np.isfinite(own)
            if (known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:]).any():
                place = (x + left * dx, z + top * dz)
                patches.append(HeightField(own, (dx, dz), place, f"patch_{j}_{i}", ground.map_frame))
    return Union(patches)
