"""Map of the ground from a rover's height scans, with the cost-to-go over it.

The map is a square of cells about the rover, as wide as the spacing of the scan. Each scan updates the heights that it
covers, by linear interpolation. `PathSearch.ways` gives the cost-to-go from each cell: it has the same terms as
`ScanPolicy`'s paths, and over unseen ground only the distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import exp, sin_cos
from rover_gym.core.validation import number, whole
from rover_gym.drive.search.arc_search import ArcSearch
from rover_gym.envs.start import HeightScan, Point, scan_points

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.float32]
Corner = npt.NDArray[np.int64]

#: Most cells along a side.
MOST_CELLS = 2000

#: Distance of the rover from the map's middle, relative to the side, at which the map moves.
LEFT = 0.125


@dataclass(frozen=True)
class MapOptions:
    """Size of the map and costs of the way over it.

    Attributes:
        cells: Cells along each side, as wide as the spacing of the scan.
        risk: Factor on the costs of belly, climb and lean, which a path may still avoid.
        unknown: Additional cost per metre over unseen ground.
        trap: Additional cost per metre at a place where the rover got stuck.
        every: Decisions between two computations of the ways.
    """

    cells: int = 128
    risk: float = 0.4
    unknown: float = 0.0
    trap: float = 1.0
    every: int = 3

    def __post_init__(self) -> None:
        whole("map.cells", self.cells, at_least=8, at_most=MOST_CELLS)
        whole("map.every", self.every, at_least=1, at_most=1000)
        for name in ("risk", "unknown", "trap"):
            number(f"map.{name}", getattr(self, name), at_least=0.0, at_most=1e3)


class GroundMap:
    """Writes and reads maps `(cells, cells)`, along x and z, whose first cell lies at `corner`, in cells.

    Args:
        scan: The grid of the height scan.
        options: Size and costs.
        trap_size: Size of a place where the rover got stuck, m.
    """

    def __init__(self, scan: HeightScan, options: MapOptions, trap_size: float) -> None:
        self.scan, self.options, self.cell = scan, options, scan.spacing
        self._offsets, self._trap_size = scan.offsets, trap_size
        self._reach = int(np.ceil(0.5 * np.hypot(scan.rows - 1, scan.columns - 1))) + 1

    def begin(self, cells: Cells, corner: Corner, place: Point) -> None:
        """Forgets a map, and puts its middle at a place."""
        cells[:] = np.nan
        corner[:] = np.rint(np.array(place) / self.cell).astype(np.int64) - self.options.cells // 2

    def remember(self, cells: Cells, corner: Corner, heights: Array, place: Point, heading: float) -> None:
        """Writes the heights of a scan `(rows * columns,)`, m above the map's zero, taken at a place and a heading."""
        self._follow(cells, corner, place)
        low = np.maximum(np.rint(np.array(place) / self.cell).astype(np.int64) - self._reach - corner, 0)
        high = np.minimum(low + 2 * self._reach + 1, self.options.cells)
        dx, dz = ((corner[k] + np.arange(low[k], high[k])) * self.cell - place[k] for k in (0, 1))
        sine, cosine = sin_cos(heading)
        scan = self.scan
        row = 0.5 * (scan.rows - 1) - (dx[:, None] * cosine - dz * sine) / self.cell
        column = 0.5 * (scan.columns - 1) + (dx[:, None] * sine + dz * cosine) / self.cell
        seen = (row >= 0.0) & (row <= scan.rows - 1) & (column >= 0.0) & (column <= scan.columns - 1)
        window = cells[low[0] : high[0], low[1] : high[1]]
        window[seen] = _interpolated(heights.reshape(scan.rows, scan.columns), row[seen], column[seen])

    def ways(
        self,
        search: ArcSearch,
        cells: Cells,
        corner: Corner,
        *,
        heading: float,
        goal: Point,
        slope: Sequence[float],
        boldness: float,
        traps: Array,
    ) -> Array:
        """`(cells, cells)` the way to the goal from each cell, m.

        The slope of the ground plane, ahead and to the right, costs nothing.
        """
        options, n = self.options, len(cells)
        price = np.where(np.isnan(cells), options.unknown, 0.0)
        x, z = ((corner[k] + np.arange(n)) * self.cell for k in (0, 1))
        for at_x, at_z in traps[:, :2].tolist():
            near_x, near_z = exp(-(((x - at_x) / self._trap_size) ** 2)), exp(-(((z - at_z) / self._trap_size) ** 2))
            price += options.trap * near_x[:, None] * near_z
        sine, cosine = sin_cos(heading)
        rise_x, rise_z = slope[0] * cosine + slope[1] * sine, slope[1] * cosine - slope[0] * sine
        level = cells - (rise_x * x[:, None] + rise_z * z)
        aim = np.array(goal) / self.cell - corner
        # The search's first row is farthest ahead.
        ways = search.ways(
            np.ascontiguousarray(level[::-1]),
            self.cell,
            (n - 1.0 - aim[0], aim[1]),
            options.risk * boldness,
            np.ascontiguousarray(price[::-1]),
        )
        return ways[::-1]

    def at_scan(self, ways: npt.NDArray[np.floating], corner: Corner, place: Point, heading: float) -> Array:
        """`(rows * columns,)` the ways from the points of a scan taken at a place and a heading, m."""
        at = scan_points(self._offsets, place, heading) / self.cell - corner
        top = len(ways) - 1.0
        return _interpolated(ways, at[:, 0].clip(0.0, top), at[:, 1].clip(0.0, top))

    def _follow(self, cells: Cells, corner: Corner, place: Point) -> None:
        """Moves the map if the rover has left its middle."""
        n = self.options.cells
        shift = np.rint(np.array(place) / self.cell).astype(np.int64) - n // 2 - corner
        if np.abs(shift).max() <= LEFT * n:
            return
        old = cells.copy()
        cells[:] = np.nan
        corner += shift
        to, start = np.maximum(-shift, 0), np.maximum(shift, 0)
        size = np.maximum(n - np.abs(shift), 0)
        kept = old[start[0] : start[0] + size[0], start[1] : start[1] + size[1]]
        cells[to[0] : to[0] + size[0], to[1] : to[1] + size[1]] = kept


def _interpolated(values: npt.NDArray[np.floating], row: Array, column: Array) -> Array:
    """Values at rows and columns of a grid, by linear interpolation."""
    i, j = (np.minimum(at.astype(np.int64), n - 2) for at, n in zip((row, column), values.shape, strict=True))
    u, w = row - i, column - j
    near = values[i, j] * (1.0 - w) + values[i, j + 1] * w
    far = values[i + 1, j] * (1.0 - w) + values[i + 1, j + 1] * w
    found: Array = near * (1.0 - u) + far * u
    return found
