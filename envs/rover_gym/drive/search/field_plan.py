"""Cost-to-go over a whole field.

The costs are those of Dijkstra's algorithm (Dijkstra 1959) on a grid, as `rover_gym.core.PathSearch` computes
them.

The price of a place grows with the height of the ground under the trunk above the mean of its surroundings, relative to
the trunk's clearance. `PlannerPolicy` uses the cost-to-go at the end of each roll-out.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel
from rover_gym.core.extras import require
from rover_gym.core.validation import number, refuse, vector
from rover_gym.drive.search.arc_search import ways_by_price
from rover_gym.ground.maps.ground_lookup import TerrainLike, as_terrain
from rover_gym.ground.terrain_parts import heights_of
from rover_gym.models.lookup import ModelLike, as_model
from rover_gym.models.statics import Statics, check_statics

Array = npt.NDArray[np.float64]

#: Most cells of a grid: some hundred megabytes with its graph.
MAX_CELLS = 1_000_000
#: Price of a metre where the ground stands as high as the trunk's clearance, beside 1 for the metre itself.
STEEP = 3.0
#: Rows and columns from a cell to its neighbours.
NEIGHBOURS = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j])


@dataclass(frozen=True, eq=False)
class FieldPlan:
    """Costs to a goal on a grid over a field; `FieldPlan.over` plans them.

    Attributes:
        goal: The goal (x, z), m.
        corner: Least x and z of the grid, m.
        resolution: Side of a cell, m.
        price: (rows along x, columns along z) cost of a metre into a cell, at least 1.
        cost: (rows, columns) cost from a cell to the goal, in metres of good ground.
    """

    goal: tuple[float, float]
    corner: tuple[float, float]
    resolution: float
    price: Array
    cost: Array

    @classmethod
    def over(
        cls,
        terrain: TerrainLike,
        model: ModelLike,
        start: npt.ArrayLike,
        goal: npt.ArrayLike,
        *,
        resolution: float = 0.1,
        margin: float = 3.0,
    ) -> "FieldPlan":
        """Plans from every cell of the rectangle about start and goal.

        Args:
            terrain: The ground, or its file. Cells without ground are not crossed.
            model: The rover, its name in the gallery or its file: size and clearance of its trunk.
            start: (x, z), m.
            goal: (x, z), m.
            resolution: Side of a cell, m.
            margin: How far the grid goes beyond the rectangle of start and goal, m.

        Raises:
            MissingExtraError: SciPy is not installed.
            OptionError: An argument is out of its range, or the grid has more than a million cells.
        """
        terrain, model = as_terrain("terrain", terrain), as_model("model", model)
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
        row, column = np.rint((end - low) / resolution).astype(int).tolist()
        cost = ways_by_price(price, resolution, (row, column))
        return cls((float(end[0]), float(end[1])), (float(low[0]), float(low[1])), resolution, price, cost)

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
        if not np.isfinite(self.cost[tuple(cell)]):
            refuse(OptionError, "start", begin.tolist(), "has no path to the goal")
        cells = [cell]
        while self.cost[tuple(cell)] > 0.0:
            beside = np.clip(cell + NEIGHBOURS, 0, np.array(self.cost.shape) - 1)
            i, j = beside.T
            onward = self.cost[i, j] + self.resolution * np.hypot(*NEIGHBOURS.T) * self.price[i, j]
            cell = beside[np.argmin(onward)]
            cells.append(cell)
        return np.asarray(self.corner + self.resolution * np.array(cells))


@lru_cache(maxsize=8)
def _stance(model: RoverModel) -> Statics:
    """The rover on level ground, for which it must settle once."""
    return check_statics(model)
