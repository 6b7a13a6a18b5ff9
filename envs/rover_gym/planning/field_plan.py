"""The way over a whole field: what it costs to reach the goal from anywhere.

The costs are those of Dijkstra's algorithm (Dijkstra 1959) on a grid.

The price of a place tells how badly the rover fits there: how high the ground stands under its trunk, over the mean of
the ground about it, compared with the trunk's clearance. `PlannerPolicy` looks the end of each future up in it.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.ground import heights_of
from rover_gym.mechanics import OptionError, RoverModel, Terrain
from rover_gym.models.statics import Statics, check_statics
from rover_gym.validation import number, refuse, vector

Array = npt.NDArray[np.float64]

#: Most cells of a grid: some hundred megabytes with its graph.
MAX_CELLS = 1_000_000
#: Price of a metre where the ground stands as high as the trunk's clearance, beside 1 for the metre itself.
STEEP = 3.0


@dataclass(frozen=True, eq=False)
class FieldPlan:
    """Costs to a goal on a grid over a field; `FieldPlan.over` plans them.

    Attributes:
        goal: The goal (x, z), m.
        corner: Least x and z of the grid, m.
        resolution: Side of a cell, m.
        price: (rows along x, columns along z) cost of a metre through a cell, at least 1.
        cost: (rows, columns) cost from a cell to the goal, in metres of good ground.
        towards: (rows, columns) the next cell on the way, as an index into the flat grid; negative at the goal.
    """

    goal: tuple[float, float]
    corner: tuple[float, float]
    resolution: float
    price: Array
    cost: Array
    towards: npt.NDArray[np.int64]

    @classmethod
    def over(
        cls,
        terrain: Terrain,
        model: RoverModel,
        start: npt.ArrayLike,
        goal: npt.ArrayLike,
        *,
        resolution: float = 0.1,
        margin: float = 3.0,
    ) -> "FieldPlan":
        """Plans from every cell of the rectangle about start and goal.

        Args:
            terrain: The ground. Cells without ground are not crossed.
            model: The rover, from which come the size and the clearance of its trunk.
            start: (x, z), m.
            goal: (x, z), m.
            resolution: Side of a cell, m.
            margin: How far the grid goes beyond the rectangle of start and goal, m.

        Raises:
            MissingExtraError: SciPy is not installed.
            OptionError: An argument is out of its range, or the grid has more than a million cells.
        """
        ndimage = require("scipy.ndimage", "planning")
        begin, end = np.array(vector("start", start, 2)), np.array(vector("goal", goal, 2))
        resolution = number("resolution", resolution, at_least=1e-3)
        margin = number("margin", margin, at_least=resolution)
        low, high = np.minimum(begin, end) - margin, np.maximum(begin, end) + margin
        shape = np.ceil((high - low) / resolution).astype(np.int64) + 1
        if shape.prod() > MAX_CELLS:
            refuse(
                OptionError, "resolution", resolution, f"gives {shape.prod()} cells, at most {MAX_CELLS} are allowed"
            )
        places = np.stack(
            np.meshgrid(*(low[k] + resolution * np.arange(shape[k]) for k in (0, 1)), indexing="ij"), axis=-1
        )
        heights = heights_of(terrain, places.reshape(-1, 2)).reshape(tuple(shape))
        unknown = ~np.isfinite(heights)
        level = np.where(unknown, np.nanmean(heights) if not unknown.all() else 0.0, heights)
        stance = _stance(model)
        half = 0.5 * stance.track
        about = ndimage.uniform_filter(level, max(1, round(2.0 * model.clear_radius / resolution)), mode="nearest")
        reach = np.arange(-int(half / resolution), int(half / resolution) + 1) * resolution
        disc = np.hypot(*np.meshgrid(reach, reach)) <= half
        stands = ndimage.maximum_filter(level - about, footprint=disc, mode="nearest")
        lowest = min(stance.clearance, float(model.wheel_radii.max()) * 2.0)
        price = 1.0 + STEEP * np.clip(stands / lowest, 0.0, 3.0) ** 2
        price[unknown] = np.inf
        cost, towards = _dijkstra(price, resolution, tuple(np.rint((end - low) / resolution).astype(int)))
        return cls((float(end[0]), float(end[1])), (float(low[0]), float(low[1])), resolution, price, cost, towards)

    def cost_to_go(self, points: npt.ArrayLike) -> Array:
        """(n,) cost from places to the goal, in metres of good ground; beyond the grid by the straight way to its edge.

        Args:
            points: (n, 2) x and z, m.
        """
        places = (np.asarray(points, dtype=np.float64).reshape(-1, 2) - self.corner) / self.resolution
        top = np.array(self.cost.shape) - 1.0
        within = np.clip(places, 0.0, top)
        first = np.minimum(within.astype(np.int64), self.cost.shape - np.array(2))
        f, g = (within - first).T
        i, j = first.T
        c = self.cost
        inside = (1 - f) * ((1 - g) * c[i, j] + g * c[i, j + 1]) + f * ((1 - g) * c[i + 1, j] + g * c[i + 1, j + 1])
        outside = self.resolution * np.hypot(*(places - within).T)
        return np.asarray(inside + (1.0 + STEEP) * outside)

    def way(self, start: npt.ArrayLike) -> Array:
        """(n, 2) places x and z on the cheapest way from a place to the goal, m, a cell apart.

        Raises:
            OptionError: No way leads from there.
        """
        begin = np.array(vector("start", start, 2))
        cell = np.clip(np.rint((begin - self.corner) / self.resolution), 0, np.array(self.cost.shape) - 1).astype(int)
        at = int(np.ravel_multi_index(tuple(cell), self.cost.shape))
        if not np.isfinite(self.cost.flat[at]):
            refuse(OptionError, "start", begin.tolist(), "has no way to the goal")
        cells = [at]
        while (at := int(self.towards.flat[at])) >= 0:
            cells.append(at)
        rows, columns = np.unravel_index(cells, self.cost.shape)
        return np.asarray(self.corner + self.resolution * np.stack((rows, columns), axis=1))


@lru_cache(maxsize=8)
def _stance(model: RoverModel) -> Statics:
    """The rover on level ground, for which it must settle once."""
    return check_statics(model)


def _dijkstra(price: Array, resolution: float, goal: tuple[int, ...]) -> tuple[Array, npt.NDArray[np.int64]]:
    """Costs to the goal and next cells, over the eight neighbours of each cell."""
    sparse, graph = require("scipy.sparse", "planning"), require("scipy.sparse.csgraph", "planning")
    cells = np.arange(price.size).reshape(price.shape)
    heads, tails, weights = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = (slice(0, price.shape[0] - di), slice(max(0, -dj), price.shape[1] - max(0, dj)))
        b = (slice(di, None), slice(max(0, dj), price.shape[1] - max(0, -dj)))
        weight = 0.5 * (price[a] + price[b]) * resolution * np.hypot(di, dj)
        open_ = np.isfinite(weight)
        heads.append(cells[a][open_])
        tails.append(cells[b][open_])
        weights.append(weight[open_])
    size = price.size
    edges = sparse.coo_array((np.concatenate(weights), (np.concatenate(heads), np.concatenate(tails))), (size, size))
    place = int(np.ravel_multi_index(goal, price.shape))
    cost, before = graph.dijkstra(edges.tocsr(), directed=False, indices=place, return_predecessors=True)
    return cost.reshape(price.shape), before.astype(np.int64).reshape(price.shape)
