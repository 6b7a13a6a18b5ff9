"""Constructors of terrains from files.

The compiled classes build terrains from arrays. These functions read files and become methods of the classes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from rover_gym.core import HeightField, Plane, SphereField, Terrain, TerrainError, TriangleMesh
from rover_gym.core.validation import refuse, text_of_file
from rover_gym.ground.maps.fractal import fractal_map, pair
from rover_gym.ground.maps.map_files import open_terrain, read_map, read_mesh

#: Longest file of spheres, bytes.
MOST_BYTES = 1 << 28


def sphere_field_from_file(
    path: str | os.PathLike[str], ground: Plane | None = None, material: str = "rock"
) -> SphereField:
    """Reads spheres from a CSV file with the header `x,y,z,radius`, in m.

    Args:
        path: Path of the file.
        ground: The plane under the spheres; none by default.
        material: Name of the spheres' material.

    Raises:
        TerrainError: The file does not describe spheres; the message names the path.
        OSError: The file cannot be read.
    """
    header, *rows = text_of_file(path, MOST_BYTES, error=TerrainError).splitlines() or [""]
    if [name.strip().lower() for name in header.split(",")] != ["x", "y", "z", "radius"]:
        refuse(TerrainError, "path", os.fsdecode(path), "the file must begin with the header x,y,z,radius")
    try:
        table = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.empty((0, 4))
    except ValueError as error:
        refuse(TerrainError, "path", os.fsdecode(path), f"the file is not a table of numbers ({error})")
    if table.shape[1] != 4:
        refuse(TerrainError, "path", os.fsdecode(path), f"the file must have 4 columns, has {table.shape[1]}")
    try:
        return SphereField(table[:, :3], table[:, 3], ground, material)
    except TerrainError as error:
        named = TerrainError(f"{os.fsdecode(path)}: {error}")
        named.field, named.value = error.field, error.value
        raise named from None


def height_field_from_file(
    path: str | os.PathLike[str],
    *,
    spacing: float | tuple[float, float] | None = None,
    origin: tuple[float, float] | None = None,
    height_range: tuple[float, float] | None = None,
    scale: float | None = None,
    datum: float | None = None,
    band: int | None = None,
    nodata: float | None = None,
    material: str = "ground",
) -> HeightField:
    """Reads a map from a GeoTIFF, a PNG or a .npy file.

    Columns run along x and rows along z; of a map with north up, x is east and z south. A GeoTIFF contains its spacing,
    its unit, its marker for missing data and its place: `HeightField.place_of` converts map coordinates.

    Args:
        path: Path of the file; its ending determines the format.
        spacing: Distance of columns and of rows, m; needed where the file does not give it, and refused where it does.
        origin: Place (x, z) of the first height, m; by default the middle of the map is at the world's origin.
        height_range: Of a PNG: heights of black and white, (2,), m.
        scale: Factor from the file's numbers to m; of a GeoTIFF by default its own.
        datum: Height of the file that becomes 0, in its own numbers; of a GeoTIFF by default
            its lowest, otherwise 0.
        band: Band of a GeoTIFF, from 1; needed if the file has several.
        nodata: The number of the file that means missing data, besides the one that a GeoTIFF declares. NaN if no
            number does. By default a lowest number that looks like such a marker is refused.
        material: Name of its material.

    Raises:
        TerrainError: The file is not a map, or a required argument is missing; the message gives the file.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    read = read_map(
        path,
        spacing=None if spacing is None else pair("spacing", spacing),
        origin=None if origin is None else pair("origin", origin),
        height_range=height_range,
        scale=scale,
        datum=datum,
        band=band,
        nodata=nodata,
    )
    heights, step, place, frame = read
    return HeightField(heights, step, place, material, frame)


def triangle_mesh_from_file(
    path: str | os.PathLike[str],
    *,
    scale: float = 1.0,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    up: str = "y",
    material: str = "ground",
) -> TriangleMesh:
    """Reads a mesh from a file: OBJ, PLY, STL, GLB and other formats that `trimesh` reads.

    Equal corners are merged, and triangles without area are removed.

    Args:
        path: Path of the file; its ending determines the format.
        scale: Factor from the file's numbers to m.
        position: Place of the file's origin, (3,), m; the world's origin by default.
        up: Axis of the file that points up: "y" or "z".
        material: Name of its material.

    Raises:
        TerrainError: The file does not contain a valid mesh; the message gives the file.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    return TriangleMesh(*read_mesh(path, scale=scale, position=position, up=up), material)


SphereField.from_file = staticmethod(sphere_field_from_file)
HeightField.from_file = staticmethod(height_field_from_file)
HeightField.fractal = staticmethod(fractal_map)
TriangleMesh.from_file = staticmethod(triangle_mesh_from_file)
# Where the compiled module takes a terrain, it takes a file.
Terrain._opened = staticmethod(open_terrain)  # type: ignore[attr-defined]
