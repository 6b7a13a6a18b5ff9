"""A height scan as a finer grid with a margin, and the points of a rover on it by pose."""

import math

import numpy as np
import numpy.typing as npt

from rover_gym.env.rocks import HeightScan
from rover_gym.mechanics import sin_cos

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.int32]

#: Cells of the grid per spacing of the scan.
FINER = 2

#: Headings at which the points are tabulated.
HEADINGS = 144


class GroundGrid:
    """Heights at the points of a rover, in any pose, from a height scan.

    Beyond the scan the ground has the median height of its points.

    Args:
        scan: The grid of the scan.
        points: `(n, 2)` x and z of the rover's points from the point that follows the path, m.
        x_c: x of that point in the trunk's frame, m.
    """

    def __init__(self, scan: HeightScan, points: Array, x_c: float) -> None:
        self._scan = scan
        self._cell = scan.spacing / FINER
        reach = float(np.hypot(*points.T).max(initial=0.0))
        self._margin = math.ceil(reach / self._cell) + 2
        self._shape = (FINER * (scan.rows - 1) + 1, FINER * (scan.columns - 1) + 1)
        self._width = self._shape[1] + 2 * self._margin
        self._origin = (0.5 * (self._shape[0] - 1) - x_c / self._cell, 0.5 * (self._shape[1] - 1))
        sine, cosine = sin_cos(np.arange(HEADINGS) * math.tau / HEADINGS)
        x, z = points.T
        ahead = cosine[:, None] * x + sine[:, None] * z
        right = cosine[:, None] * z - sine[:, None] * x
        rows, columns = (np.rint(way / self._cell).astype(np.int32) for way in (-ahead, right))
        self._offsets = rows * self._width + columns

    def spread(self, heights: Array) -> Array:
        """The grid, flat, of heights `(rows * columns,)` in the order of the scan, by linear interpolation."""
        coarse = heights.reshape(self._scan.rows, self._scan.columns)
        grid = np.full((self._shape[0] + 2 * self._margin, self._width), float(np.median(heights)))
        inner = grid[self._margin : self._margin + self._shape[0], self._margin : self._margin + self._shape[1]]
        inner[::FINER, ::FINER] = coarse
        inner[1::FINER, ::FINER] = 0.5 * (coarse[:-1] + coarse[1:])
        inner[:, 1::FINER] = 0.5 * (inner[:, :-1:FINER] + inner[:, 2::FINER])
        return grid.ravel().astype(np.float32)

    def places(self, poses: Array) -> Places:
        """`(..., n)` where the points lie in the grid for poses `(..., 3)` from the present one."""
        row = np.rint(self._origin[0] - poses[..., 0] / self._cell).astype(np.int32)
        column = np.rint(self._origin[1] + poses[..., 1] / self._cell).astype(np.int32)
        row = np.clip(row, -1, self._shape[0]) + self._margin
        column = np.clip(column, -1, self._shape[1]) + self._margin
        heading = np.rint(poses[..., 2] * (HEADINGS / math.tau)).astype(np.intp) % HEADINGS
        places: Places = self._offsets.take(heading, axis=0)
        places += (row * self._width + column)[..., None]  # in place: this is where the time goes
        return places
