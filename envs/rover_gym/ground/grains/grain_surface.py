"""The surface of a bed of balls as a map of heights, and sections through it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.polytopes import box_around
from rover_gym.core.rotations import rotation_matrix
from rover_gym.core.validation import array, number, refuse, vector

if TYPE_CHECKING:
    from rover_gym.core import RoverModel, Simulation


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
        refuse(OptionError, "bounds", bounds, "must be x_min, z_min, x_max, z_max")
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
        refuse(OptionError, "cell", edge, f"gives a map of more than {MOST_CELLS} cells")
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


MAP = (0, 2)  # the axes x and z


@dataclass(frozen=True)
class Footprint:
    """Parts of a rover on the map, each as all points within a distance of a line.

    Attributes:
        names: Of the parts, with wheels first.
        ends: (n_parts, 2, 2) x and z of both ends of each line, m.
        margin: (n_parts,) distance from the line, m.
    """

    names: tuple[str, ...]
    ends: Array
    margin: Array

    def bounds(self) -> tuple[float, float]:
        """Least and largest x of the parts, m."""
        x = self.ends[:, :, 0]
        return float((x.min(axis=1) - self.margin).min()), float((x.max(axis=1) + self.margin).max())

    def distance(self, places: Array) -> Array:
        """Distance of places from the nearest part, negative within one.

        Args:
            places: (n, 2) x and z, m.

        Returns:
            (n,) m.
        """
        nearest = np.full(len(places), np.inf)
        for (a, b), margin in zip(self.ends, self.margin, strict=True):
            along = b - a
            share = np.clip((places - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
            away = places - a - share[:, None] * along
            np.minimum(nearest, np.hypot(away[:, 0], away[:, 1]) - margin, out=nearest)
        return nearest

    def has_moved(self, before: Footprint, distance: float) -> bool:
        """Whether a part is there that was not, or an end of one has moved farther than a distance, m."""
        known = {name: i for i, name in enumerate(before.names)}
        if not known.keys() >= set(self.names):
            return True
        moved = self.ends - before.ends[[known[name] for name in self.names]]
        return bool(np.hypot(moved[..., 0], moved[..., 1]).max() > distance)


class Parts:
    """Wheels, boxes and balls of a model, to see where they are.

    Args:
        model: The rover.
    """

    def __init__(self, model: RoverModel) -> None:
        described: dict[str, Any] = model.to_dict()
        self._wheels = [
            (wheel["solid"], np.asarray(wheel["axle"], dtype=np.float64), wheel["radius"], 0.5 * wheel["width"])
            for wheel in described["wheels"]
        ]
        on_wheels = {name for name, *_ in self._wheels}
        self._shapes: list[tuple[str, str, Array, Array, Array]] = []
        for solid in described["solids"]:
            shapes = list(solid.get("shapes") or ())
            if solid.get("shape"):
                place = solid.get("centre_of_mass") or (0.0, 0.0, 0.0)
                shapes.append(solid["shape"] | {"collides": solid.get("collides", False), "position": place})
            for k, shape in enumerate(shapes):
                if shape.get("collides") and solid["name"] not in on_wheels:
                    position = np.array(shape.get("position") or (0.0, 0.0, 0.0), dtype=np.float64)
                    turn = rotation_matrix(shape.get("rotation") or (0.0, 0.0, 0.0))
                    middle, half = box_around(shape)
                    position = position + turn @ middle
                    self._shapes.append((f"{solid['name']}/{k}", solid["name"], position, turn, half))

    def footprint(self, rover: Simulation, below: float) -> Footprint:
        """The wheels, and what else hangs lower than a height, m."""
        poses = rover.poses()
        names, ends, margins = [], [], []
        for name, own_axle, radius, half_width in self._wheels:
            centre, rotation = poses[name]
            axle = rotation @ own_axle
            heading = np.array([-axle[2], axle[0]])
            length = float(np.hypot(*heading))
            heading = heading / length if length > 0.0 else np.array([1.0, 0.0])
            middle = centre[list(MAP)]
            names.append(name)
            ends.append((middle - radius * heading, middle + radius * heading))
            margins.append(half_width * length + radius * abs(axle[1]))
        for name, solid, position, turn, half in self._shapes:
            origin, rotation = poses[solid]
            centre, rotation = origin + rotation @ position, rotation @ turn
            if centre[1] - np.abs(rotation[1]) @ half >= below:
                continue
            longest = int(half.argmax())
            line = rotation[list(MAP), longest] * half[longest]
            middle = centre[list(MAP)]
            names.append(name)
            ends.append((middle - line, middle + line))
            margins.append(float(np.linalg.norm(np.delete(half, longest))))
        return Footprint(tuple(names), np.array(ends), np.array(margins))
