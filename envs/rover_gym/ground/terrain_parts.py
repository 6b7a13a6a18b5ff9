"""What a terrain is made of: its plane, its spheres and its surfaces, for those who draw or store it."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, Plane, SoftGround, SphereField, Terrain, TriangleMesh, Union

Array = npt.NDArray[np.float64]


def parts_of(terrain: Terrain) -> Iterator[Terrain]:
    """The terrains of a union, and of unions in it, and the surface of sand; the terrain itself if it is none."""
    if isinstance(terrain, Union):
        for part in terrain.parts:
            yield from parts_of(part)
    elif isinstance(terrain, SoftGround):
        yield from parts_of(terrain.surface)
    else:
        yield terrain


def sand_of(terrain: Terrain) -> SoftGround | None:
    """The sand of a terrain; None on firm ground."""
    if isinstance(terrain, SoftGround):
        return terrain
    parts = terrain.parts if isinstance(terrain, Union) else ()
    return next((sand for sand in map(sand_of, parts) if sand is not None), None)


def plane_of(terrain: Terrain) -> Plane | None:
    """The plane of a terrain, under spheres and other parts too; None where there is none."""
    for part in parts_of(terrain):
        if isinstance(part, Plane):
            return part
        if isinstance(part, SphereField) and part.ground is not None:
            return part.ground
    return None


def spheres_of(terrain: Terrain) -> tuple[Array, Array]:
    """Centres `(n, 3)` and radii `(n,)` of all spheres of a terrain, m."""
    fields = [part for part in parts_of(terrain) if isinstance(part, SphereField)]
    if not fields:
        return np.empty((0, 3)), np.empty(0)
    return np.concatenate([field.centres for field in fields]), np.concatenate([field.radii for field in fields])


def surfaces_of(terrain: Terrain) -> list[HeightField | TriangleMesh]:
    """The height fields and meshes of a terrain."""
    return [part for part in parts_of(terrain) if isinstance(part, (HeightField, TriangleMesh))]


def bounds_of(surface: HeightField | TriangleMesh) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and greatest x and z of a height field or a mesh, m."""
    if isinstance(surface, TriangleMesh):
        places = np.asarray(surface.vertices)[:, [0, 2]]
        low, high = places.min(axis=0), places.max(axis=0)
    else:
        rows, columns = surface.shape
        low = np.asarray(surface.origin)
        high = low + np.asarray(surface.spacing) * (columns - 1, rows - 1)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def heights_of(terrain: Terrain, points: npt.ArrayLike) -> Array:
    """`(n,)` height of the visible ground at (x, z), m; nan where there is none."""
    places = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if isinstance(terrain, Plane):
        n = terrain.normal
        return np.asarray(-(places @ n[[0, 2]] + terrain.offset) / n[1])
    return np.asarray(terrain.heights(places))


def surface_heights(terrain: Terrain, points: npt.ArrayLike) -> Array:
    """`(n,)` height of the highest height field or mesh of a terrain at (x, z), m; nan where there is none."""
    places = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    found = [surface.heights(places) for surface in surfaces_of(terrain)]
    return np.asarray(np.fmax.reduce(found)) if found else np.full(len(places), np.nan)


def bare_heights(terrain: Terrain, points: npt.ArrayLike) -> Array:
    """`(n,)` height of the ground without its spheres at (x, z), m; nan where there is none."""
    places = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    plane, fields = plane_of(terrain), surface_heights(terrain, places)
    return fields if plane is None else np.fmax(fields, heights_of(plane, places))


def triangles_of(
    surface: HeightField | TriangleMesh, low: npt.ArrayLike, high: npt.ArrayLike, most: int
) -> tuple[Array, npt.NDArray[np.int64]]:
    """Vertices `(n, 3)`, m, and triangles `(m, 3)` of a surface, counter-clockwise seen from outside.

    Args:
        surface: A height field or a mesh.
        low: Least x and z of the piece of a height field, m; a mesh is whole.
        high: Largest x and z of the piece, m.
        most: Most heights of the piece: beyond, every second, third, ... row and column are shown, and the last ones.
    """
    if isinstance(surface, TriangleMesh):
        return np.asarray(surface.vertices), surface.triangles.astype(np.int64)
    x, z, heights = map_of(surface, low, high, most)
    grid_x, grid_z = np.meshgrid(x, z)
    vertices = np.column_stack((grid_x.ravel(), heights.ravel(), grid_z.ravel()))
    corner = np.arange(len(z) - 1)[:, None] * len(x) + np.arange(len(x) - 1)
    a, b, c, d = (corner + shift for shift in (0, 1, len(x) + 1, len(x)))
    # The diagonal runs from (j, i) to (j + 1, i + 1).
    triangles = np.stack((np.stack((a, c, b), axis=-1), np.stack((a, d, c), axis=-1)), axis=-2).reshape(-1, 3)
    known = np.isfinite(vertices[:, 1])
    return vertices, triangles[known[triangles].all(axis=1)]


def map_of(surface: HeightField, low: npt.ArrayLike, high: npt.ArrayLike, most: int) -> tuple[Array, Array, Array]:
    """Columns x (n_x,), rows z (n_z,) and heights (n_z, n_x), m, of a piece of a height field, as `triangles_of`."""
    rows, columns = surface.shape
    places = [_lines(low, high, surface, axis, count) for axis, count in ((0, columns), (1, rows))]
    step = max(1, int(np.ceil(np.sqrt(len(places[0]) * len(places[1]) / most))))
    i, j = (np.union1d(lines[::step], lines[-1]) for lines in places)
    x = surface.origin[0] + i * surface.spacing[0]
    z = surface.origin[1] + j * surface.spacing[1]
    return x, z, surface.grid[np.ix_(j, i)].astype(np.float64)


def _lines(
    low: npt.ArrayLike, high: npt.ArrayLike, surface: HeightField, axis: int, count: int
) -> npt.NDArray[np.int64]:
    """Indices of the columns (axis 0) or rows (axis 1) within bounds, at least two."""
    begin, step = surface.origin[axis], surface.spacing[axis]
    first = int(np.clip(np.floor((np.asarray(low)[axis] - begin) / step), 0, count - 2))
    last = int(np.clip(np.ceil((np.asarray(high)[axis] - begin) / step), first + 1, count - 1))
    return np.arange(first, last + 1)
