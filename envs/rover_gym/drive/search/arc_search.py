"""Searches the cheapest path over the ground of a height scan, a sequence of arcs.

The search keeps the cheapest paths of each length, apart from each other by place and heading (beam search). A path
costs, in metres of way,

    the way from its end to the goal, and the turn to face it
    belly   how far the underside is closer to the ground than a margin, along the way
    climb   the rise of each wheel, and more if it is steep
    lean    the square of the slope of the plane through the points under the wheels, along the way
    turns   a change of the command, a change of direction, an arc driven backward
    memory  how close it comes to places where the rover got stuck
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, PathSearch, Plane, RoverModel, atan2, sin_cos
from rover_gym.core.polytopes import box_around
from rover_gym.core.validation import number, refuse
from rover_gym.envs.start import HeightScan, wheel_centres

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RoverOutline:
    """A rover from above, in the trunk's frame with its joints at zero.

    Attributes:
        wheels: `(n_wheels, 2)` x and z of the wheels' centres, m.
        underside: `(n, 2)` x and z of the cells over which a box or a sphere of the rover reaches, m. Solids that carry
            a wheel rise with it over a rock and do not count within the wheel's radius.
        clearance: `(n,)` height of its lowest point in each cell over the ground that the wheels stand on, m.
    """

    wheels: Array
    underside: Array
    clearance: Array

    @classmethod
    def of(cls, model: RoverModel, cell: float) -> "RoverOutline":
        """The outline of a model, in square cells of a width, m."""
        zero, wheels, radii = np.zeros(model.nq), wheel_centres(model), model.wheel_radii
        ground = float(np.mean(np.asarray(model.wheel_contact_points(zero, Plane(), coordinates="state"))[:, 1]))
        poses = model.poses(zero)
        lowest: dict[tuple[int, int], float] = {}
        for solid in model.to_dict()["solids"]:
            origin, rotation = poses[solid["name"]]
            for points in _colliding(solid, 0.5 * cell):
                placed = points @ np.asarray(rotation).T + np.asarray(origin)
                if "parent" in solid:
                    apart = np.linalg.norm(placed[:, None, [0, 2]] - wheels, axis=2)
                    placed = placed[(apart > radii).all(axis=1)]
                cells = np.rint(placed[:, [0, 2]] / cell).astype(int).tolist()
                for (i, k), y in zip(cells, placed[:, 1].tolist(), strict=True):
                    lowest[i, k] = min(y, lowest.get((i, k), math.inf))
        places = sorted(lowest)
        return cls(
            wheels=wheels,
            underside=cell * np.array(places, dtype=np.float64).reshape(-1, 2),
            clearance=np.array([lowest[place] for place in places]) - ground,
        )


def _colliding(solid: Mapping[str, Any], spacing: float) -> Iterator[Array]:
    """Points `(m, 3)` on each shape of a solid that collides, or on the box around it, in the solid's frame, m."""
    alone = {"shape", "collides"} <= solid.keys()
    shapes = [solid["shape"] | {"collides": solid["collides"]}] if alone else solid.get("shapes", ())
    for shape in shapes:
        if not shape.get("collides"):
            continue
        centre = np.array(solid.get("centre_of_mass", (0.0,) * 3) if alone else shape.get("position", (0.0,) * 3))
        turn = np.eye(3) if alone else _rotation(shape.get("rotation", (0.0,) * 3))
        if shape["kind"] == "sphere":
            yield _sphere(shape["radius"], spacing) + centre
        else:
            middle, half = box_around(shape)
            yield (_box(2.0 * half, spacing) + middle) @ turn.T + centre


def _box(size: Any, spacing: float) -> Array:
    """Points on the surface of a box."""
    axes = [np.linspace(-0.5 * side, 0.5 * side, max(2, math.ceil(side / spacing) + 1)) for side in size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_a_face = np.isclose(np.abs(grid), 0.5 * np.array(size)).any(axis=1)
    surface: Array = grid[on_a_face]
    return surface


def _sphere(radius: float, spacing: float) -> Array:
    """Points on a sphere: those of the cube around it, drawn in."""
    cube = _box((2.0 * radius,) * 3, spacing)
    drawn_in: Array = radius * cube / np.linalg.norm(cube, axis=1, keepdims=True)
    return drawn_in


def _rotation(vector: Any) -> Array:
    """The rotation matrix of a rotation vector, axis times angle (Rodrigues)."""
    given = np.array(vector, dtype=np.float64)
    angle = float(np.linalg.norm(given))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = given / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = sin_cos(angle)
    turn: Array = np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross
    return turn


@dataclass(frozen=True)
class Arcs:
    """Arcs of constant command, one per row.

    The middle of the wheelbase moves off the trunk's x axis by a constant angle `beta`, while the trunk turns by
    `kappa` per metre. After the way t, negative on an arc driven backward,

        heading      theta = kappa t
        ahead        integral of  cos(theta + beta) dt
        to the left  integral of  sin(theta + beta) dt

    Attributes:
        curvature: `(n,)` 1/m, positive to the left.
        sideways: `(n,)` direction of travel off the trunk's x axis, rad, positive to the left.
        direction: `(n,)` 1 forward, -1 backward.
    """

    curvature: Array
    sideways: Array
    direction: Array

    def __len__(self) -> int:
        return len(self.curvature)

    @classmethod
    def grid(cls, curvatures: npt.ArrayLike, sideways: npt.ArrayLike, direction: float) -> "Arcs":
        """Each curvature with each sideways direction."""
        kappa, beta = (grid.ravel() for grid in np.meshgrid(curvatures, sideways, indexing="ij"))
        return cls(kappa, beta, np.full(len(kappa), direction))

    def joined(self, other: "Arcs") -> "Arcs":
        """These and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Arcs(*(np.concatenate(pair) for pair in pairs))

    def kept(self, which: npt.NDArray[np.bool_]) -> "Arcs":
        """The arcs that are marked in `which` `(n,)`."""
        return Arcs(*(values[which] for values in vars(self).values()))

    def steering(self, wheels: Array) -> Array:
        """`(n, n_wheels)` angles of wheels at x and z `(n_wheels, 2)` from the point that follows the path, rad."""
        sine, cosine = sin_cos(self.sideways)
        left = sine[:, None] + self.curvature[:, None] * wheels[:, 0]
        return atan2(left, cosine[:, None] + self.curvature[:, None] * wheels[:, 1])

    def within(self, max_steering: float, wheels: Array) -> "Arcs":
        """The arcs on which no wheel at x and z `(n_wheels, 2)` is steered more than a degree beyond a limit, rad."""
        if not len(wheels):
            return self
        largest: Array = np.abs(self.steering(wheels)).max(axis=1)
        return self.kept(largest <= max_steering + math.radians(1.0))

    def poses(self, length: float, steps: int) -> Array:
        """`(n, steps, 3)` way ahead, way to the right and heading after equal parts of a length, m and rad."""
        way = self.direction[:, None] * length * np.arange(1, steps + 1) / steps
        theta = self.curvature[:, None] * way
        # The chord of an arc leads in its mean direction, and is shorter by sin(theta / 2) / (theta / 2).
        half = 0.5 * theta
        turned = np.abs(half) > 1e-6
        chord = way * np.where(turned, sin_cos(half)[0] / np.where(turned, half, 1.0), 1.0)
        sine, cosine = sin_cos(half + self.sideways[:, None])
        return np.stack((chord * cosine, -chord * sine, theta), axis=-1)


#: Poses on an arc.
STEPS = 4


@dataclass(frozen=True)
class PathCosts:
    """What a path costs, in metres of way. Lengths of the rover are in wheel radii where not said otherwise.

    Attributes:
        belly: Cost of low clearance: a metre with the underside d radii below the margin costs belly d (1 + d).
        margin: Clearance that costs nothing.
        climb: Cost of a wheel's rise by a radius.
        step: Cost of the square of a wheel's rise between two poses, beyond half a radius.
        lean: Cost of a metre at a slope of 1; it grows with the square of the slope.
        facing: Cost of a heading one radian off the goal, over the rover's reach.
        swerve: Cost of a change of the curvature or sideways command from 0 to its limit.
        switch: Cost of a change between forward and backward.
        reverse: Cost of an arc driven backward.
        memory: Cost of an arc through a pose in which the rover got stuck.
        later: Factor on the costs of each arc after the first, since the rover plans again before it gets there.
        depth: Arcs of a path.
        width: Paths kept.
        length: Length of an arc, over the rover's reach.
    """

    belly: float = 15.0
    margin: float = 0.5
    climb: float = 0.12
    step: float = 0.2
    lean: float = 3.0
    facing: float = 0.2
    swerve: float = 0.08
    switch: float = 0.25
    reverse: float = 2.5
    memory: float = 0.8
    later: float = 0.8
    depth: int = 4
    width: int = 16
    length: float = 0.6

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(f"costs.{name}", value, at_least=0.0, at_most=1e3)
        for name in ("depth", "width"):
            value = getattr(self, name)
            if value != round(value) or value < 1:
                refuse(OptionError, f"costs.{name}", value, "must be a whole number from 1")


@dataclass(frozen=True)
class SearchTask:
    """What a search starts from.

    Attributes:
        goal: The goal ahead and to the right of the point that follows the path, m.
        command: `(3,)` the present command; its first entry is 0 at a start.
        boldness: Factor on the costs of belly, climb and lean.
        traps: `(n, 3)` places ahead and to the right, m, and headings, rad, where the rover got stuck.
        retreat: Direction of the first arc, 1 or -1, while the rover backs off; 0 for a free choice.
        extra: `(n,)` a further cost of each first arc, m; None for none.
        ways: `(rows * columns,)` way to the goal from each point of the scan, m; None for the straight way.
    """

    goal: tuple[float, float]
    command: Array
    boldness: float
    traps: Array
    retreat: float
    extra: Array | None = None
    ways: Array | None = None


class ArcSearch:
    """Finds paths for a rover: `rover_gym.core.PathSearch` with the rover's arcs and outline.

    Args:
        first: Arcs for the first segment of a path.
        further: Those that it may go on with.
        commands: `(len(first), 3)` the command of each first arc: speed, curvature, sideways.
        scan: The grid of the height scan.
        outline: The rover from above.
        x_c: x of the point that follows the path, m.
        reach: The rover's reach, m.
        radius: Its wheels' radius, m.
        arrival: Distance within which the goal is reached, m.
        costs: Costs of a path.
    """

    def __init__(
        self,
        first: Arcs,
        further: Arcs,
        commands: Array,
        *,
        scan: HeightScan,
        outline: RoverOutline,
        x_c: float,
        reach: float,
        radius: float,
        arrival: float,
        costs: PathCosts,
    ) -> None:
        length = costs.length * reach
        self._settings: dict[str, Any] = {
            "scan": (scan.rows, scan.columns, scan.spacing),
            "outline": {
                "wheels": outline.wheels,
                "underside": outline.underside,
                "clearance": outline.clearance,
                "plane_fit": _plane_fit(*outline.wheels.T),
                "x_c": x_c,
                "radius": radius,
            },
            "costs": vars(costs),
            "first": {"poses": first.poses(length, STEPS), "direction": first.direction, "commands": commands},
            "further": {"poses": further.poses(length, STEPS), "direction": further.direction},
            "reach": reach,
            "arrival": arrival,
        }
        self._search = PathSearch(**self._settings)

    def __getstate__(self) -> dict[str, Any]:
        """What the search is made of."""
        return self._settings

    def __setstate__(self, settings: dict[str, Any]) -> None:
        """Makes the search anew."""
        self._settings = settings
        self._search = PathSearch(**settings)

    def best(self, heights: Array, task: SearchTask) -> int:
        """The first arc of the cheapest path over heights `(rows * columns,)` of the scan, m."""
        t = task
        return self._search.best(heights, t.goal, t.command, t.boldness, t.traps, t.retreat, t.extra, t.ways)

    def ways(self, heights: Array, spacing: float, goal: tuple[float, float], boldness: float, extra: Array) -> Array:
        """`(rows, columns)` the way to a goal from each cell of a map, m; see `PathSearch.ways`."""
        return self._search.ways(heights, spacing, goal, boldness, extra)

    def under(self, heights: Array, poses: Array) -> npt.NDArray[np.float32]:
        """`(n, n_wheels + 3)` what lies under the rover in poses `(..., 3)`; see `PathSearch.under`."""
        return self._search.under(heights, poses)


#: Price of a metre where a rover cannot go, and way beyond which it has crossed such ground, in cells.
CLOSED = 1e9


def ways_by_price(price: Array, spacing: float, goal: tuple[int, int]) -> Array:
    """`(rows, columns)` the cheapest way to a cell of a map from every cell, by prices alone.

    Args:
        price: `(rows, columns)` price of a metre into a cell, at least 1; infinite where nothing leads.
        spacing: Distance of rows and columns, m.
        goal: Row and column of the goal.
    """
    closed = ~np.isfinite(price)
    unknown = np.full(price.shape, np.nan)
    ways = _search_by_price().ways(unknown, spacing, goal, 0.0, np.where(closed, CLOSED, price - 1.0))
    ways[closed | (ways >= CLOSED * spacing)] = np.inf
    return ways


@lru_cache(maxsize=1)
def _search_by_price() -> PathSearch:
    """A search for a rover of a point's size, for ground that costs what it is said to."""
    wheels, arc = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), {"poses": np.zeros((1, STEPS, 3)), "direction": [1.0]}
    return PathSearch(
        scan=(2, 2, 1.0),
        outline={
            "wheels": wheels,
            "underside": wheels,
            "clearance": np.ones(3),
            "plane_fit": _plane_fit(*wheels.T),
            "x_c": 0.0,
            "radius": 1.0,
        },
        costs=vars(PathCosts()),
        first={**arc, "commands": np.zeros((1, 3))},
        further=arc,
        reach=1.0,
        arrival=1.0,
    )


def _plane_fit(x: Array, z: Array) -> Array:
    """`(3, n)` level and slopes of the plane of least squares through points at x and z, by the points' heights.

    Raises:
        OptionError: The points lie in a line.
    """
    columns = np.stack((np.ones_like(x), x, z))
    a, b, c = (columns[:, None, :] * columns).sum(axis=2)
    cofactors = np.stack((np.cross(b, c), np.cross(c, a), np.cross(a, b)))
    determinant = float((a * cofactors[0]).sum())
    if not determinant > 1e-9 * float(a[0] * b[1] * c[2]):
        refuse(OptionError, "model", len(x), "must have wheels that are not all in one line")
    fit: Array = (cofactors.T[:, :, None] * columns / determinant).sum(axis=1)
    return fit
