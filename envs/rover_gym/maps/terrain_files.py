"""A terrain by the file that holds it."""

import os
from pathlib import Path
from typing import Any

from rover_gym.maps.map_files import ENDINGS as MAPS
from rover_gym.maps.mesh_files import ENDINGS as MESHES
from rover_gym.mechanics import HeightField, TerrainError, TriangleMesh
from rover_gym.validation import refuse


def is_terrain_file(name: object) -> bool:
    """Whether this is a path that ends like a map's or a mesh's."""
    if not isinstance(name, (str, os.PathLike)):
        return False
    return Path(os.fsdecode(name)).suffix.lower() in (*MAPS, *MESHES)


def open_terrain(path: str | os.PathLike[str], **options: Any) -> HeightField | TriangleMesh:
    """The map or mesh in a file.

    Args:
        path: A path that ends in one of `MAPS` or `MESHES`.
        **options: Those of `HeightField.from_file` or `TriangleMesh.from_file`.

    Raises:
        TerrainError: The file is of another kind, is damaged, or does not say enough.
        OSError: The file cannot be read.
    """
    if not is_terrain_file(path):
        refuse(TerrainError, "terrain", os.fsdecode(path), f"must end in {', '.join((*MAPS, *MESHES))}")
    if Path(path).suffix.lower() in MAPS:
        return HeightField.from_file(path, **options)
    return TriangleMesh.from_file(path, **options)
