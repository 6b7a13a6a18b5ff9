"""The surface of a bed of balls as a map of heights, and sections through it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError
from rover_gym.validation import array, number, refuse, vector

Array = npt.NDArray[np.float64]

MOST_CELLS = 4_000_000


@dataclass(frozen=True)
class SurfaceMap:
    """Heights of a bed's surface on a grid.

    Attributes:
        heights: (n_z, n_x) m; nan where no ball lies.
        origin: x and z of the middle of the first cell, m.
        cell: Edge of a cell, m.
    """

    heights: Array
    origin: tuple[float, float]
    cell: float

    @property
    def x(self) -> Array:
        """(n_x,) middles of the cells, m."""
        return np.asarray(self.origin[0] + self.cell * np.arange(self.heights.shape[1]), dtype=np.float64)

    @property
    def z(self) -> Array:
        """(n_z,) middles of the cells, m."""
        return np.asarray(self.origin[1] + self.cell * np.arange(self.heights.shape[0]), dtype=np.float64)

    def at(self, places: npt.ArrayLike, width: float = 0.0) -> Array:
        """Mean height about places.

        Args:
            places: (..., 2) x and z, m.
            width: Edge of the square over which the mean is taken, m; at least a cell.

        Returns:
            (...) m; nan where no ball lies.
        """
        points = np.asarray(places, dtype=np.float64)
        column, row = (np.round((points[..., i] - self.origin[i]) / self.cell).astype(int) for i in range(2))
        reach = int(0.5 * width / self.cell)
        total, known = np.zeros(points.shape[:-1]), np.zeros(points.shape[:-1])
        for i in range(-reach, reach + 1):
            for k in range(-reach, reach + 1):
                inside = (row + i >= 0) & (row + i < self.heights.shape[0])
                inside &= (column + k >= 0) & (column + k < self.heights.shape[1])
                found = np.full(total.shape, np.nan)
                found[inside] = self.heights[row[inside] + i, column[inside] + k]
                total += np.nan_to_num(found)
                known += np.isfinite(found)
        return np.divide(total, known, out=np.full_like(total, np.nan), where=known > 0)

    def smoothed(self, cells: int) -> SurfaceMap:
        """The map of mean heights over squares of an odd number of cells.

        Cells without a ball do not count; where they are most of a square, the mean is nan.
        """
        known = np.isfinite(self.heights)
        total, count = (_box_sum(values, cells) for values in (np.where(known, self.heights, 0.0), known * 1.0))
        means = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0.5 * cells**2)
        return replace(self, heights=means)


def _box_sum(values: Array, cells: int) -> Array:
    """Sums over squares about each entry."""
    half = cells // 2
    padded = np.pad(values, ((half + 1, half), (half + 1, half)))
    sums = padded.cumsum(axis=0).cumsum(axis=1)
    n = 2 * half + 1
    result: Array = sums[n:, n:] - sums[:-n, n:] - sums[n:, :-n] + sums[:-n, :-n]
    return result


def _corners(bounds: object) -> tuple[Array, Array]:
    """Least x and z and largest x and z of bounds, m."""
    least_x, least_z, largest_x, largest_z = vector("bounds", bounds, 4)
    if largest_x < least_x or largest_z < least_z:
        refuse(OptionError, "bounds", bounds, "must be the least x and z, then the largest")
    return np.array([least_x, least_z]), np.array([largest_x, largest_z])


def surface_map(
    position: npt.ArrayLike,
    radius: npt.ArrayLike,
    cell: float | None = None,
    bounds: tuple[float, float, float, float] | None = None,
) -> SurfaceMap:
    """The highest point of the balls over the middle of each cell.

    Args:
        position: (n, 3) centres, m, y up.
        radius: (n,) m.
        cell: Edge of a cell, m; the mean radius by default.
        bounds: Least x and z, largest x and z of the map, m; those of the centres by default.

    Raises:
        OptionError: There are no balls, or the map would have more than 4 million cells.
    """
    places = array("position", position, error=OptionError)
    radii = array("radius", radius, error=OptionError)
    if radii.ndim != 1 or not len(radii):
        refuse(OptionError, "radius", radius, "must hold a number for each ball, and at least one")
    if places.shape != (len(radii), 3) or not np.isfinite(places).all():
        refuse(OptionError, "position", position, f"must be finite, of shape ({len(radii)}, 3)")
    if not (np.isfinite(radii) & (radii > 0.0)).all():
        refuse(OptionError, "radius", radius, "must be positive")
    edge = float(radii.mean()) if cell is None else number("cell", cell, above=0.0)
    flat = places[:, [0, 2]]
    low, high = (flat.min(axis=0), flat.max(axis=0)) if bounds is None else _corners(bounds)
    n_x, n_z = (np.floor((high - low) / edge) + 1.0).tolist()
    if not n_x * n_z <= MOST_CELLS:
        refuse(OptionError, "cell", edge, f"makes a map of more than {MOST_CELLS} cells")
    heights = np.full((int(n_z), int(n_x)), -np.inf)
    near = np.round((flat - low) / edge).astype(np.int64)
    reach = int(np.ceil(float(radii.max()) / edge))
    for i in range(-reach, reach + 1):
        for k in range(-reach, reach + 1):
            column, row = near[:, 0] + i, near[:, 1] + k
            apart = (low[0] + edge * column - flat[:, 0]) ** 2 + (low[1] + edge * row - flat[:, 1]) ** 2
            over = (apart < radii**2) & (column >= 0) & (column < n_x) & (row >= 0) & (row < n_z)
            tops = places[over, 1] + np.sqrt(radii[over] ** 2 - apart[over])
            np.maximum.at(heights, (row[over], column[over]), tops)
    heights[np.isneginf(heights)] = np.nan
    return SurfaceMap(heights, (float(low[0]), float(low[1])), edge)
