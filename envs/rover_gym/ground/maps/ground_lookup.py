"""A ground by its name, by its file, or as it is."""

from __future__ import annotations

import os
from typing import TypeAlias

from rover_gym.core import Plane, Terrain, TerrainError, Union
from rover_gym.core.validation import refuse
from rover_gym.ground.maps.map_files import MAP_ENDINGS, MESH_ENDINGS, is_terrain_file, open_terrain

#: A terrain, a name or a file, as `as_terrain` takes it.
TerrainLike: TypeAlias = Terrain | str | os.PathLike[str]


def as_terrain(field: str, value: object) -> Terrain:
    """The ground that an argument means.

    Args:
        field: Name of the argument.
        value: A terrain, "plane", the file of a map or a mesh, or a list of these, which are one ground together.

    Raises:
        TerrainError: It is none of these.
        OSError: The file cannot be read.
    """
    if isinstance(value, Terrain):
        return value
    if isinstance(value, str) and value == "plane":
        return Plane()
    if isinstance(value, (list, tuple)):
        return Union([as_terrain(f"{field}[{i}]", one) for i, one in enumerate(value)])
    if not is_terrain_file(value):
        endings = ", ".join((*MAP_ENDINGS, *MESH_ENDINGS))
        refuse(TerrainError, field, value, f"must be a terrain, 'plane', or a file that ends in {endings}")
    return open_terrain(value)  # type: ignore[arg-type] # is_terrain_file has checked it
