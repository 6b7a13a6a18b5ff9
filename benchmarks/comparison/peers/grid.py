"""A map of heights as engines want it that take triangles."""

import numpy as np
import numpy.typing as npt

from comparison.scene import Array
from rover_gym import HeightField


def corners(field: HeightField) -> Array:
    """(n_z n_x, 3) world places of the heights, row after row, m."""
    n_z, n_x = field.shape
    x = field.origin[0] + field.spacing[0] * np.arange(n_x)
    z = field.origin[1] + field.spacing[1] * np.arange(n_z)
    X, Z = np.meshgrid(x, z)
    return np.stack([X, field.grid.astype(float), Z], axis=-1).reshape(-1, 3)


def triangles(field: HeightField) -> npt.NDArray[np.int64]:
    """(2 cells, 3) indices into `corners`, counterclockwise from above.

    A cell is cut from its corner (j, i) to (j + 1, i + 1), as `HeightField` does.
    """
    n_z, n_x = field.shape
    index = np.arange(n_z * n_x).reshape(n_z, n_x)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])


def middle(field: HeightField) -> tuple[float, float]:
    """Place (x, z) of the map's middle, m."""
    x_min, z_min, x_max, z_max = field.bounds
    return 0.5 * (x_min + x_max), 0.5 * (z_min + z_max)


def wavefront(places: Array, faces: list[tuple[int, ...]]) -> str:
    """Text of an .obj file."""
    lines = ["v " + " ".join(repr(float(x)) for x in place) for place in places]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    return "\n".join(lines) + "\n"
