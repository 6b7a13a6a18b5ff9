"""Searches the cheapest path over the ground of a height scan, a sequence of arcs.

The search keeps the cheapest paths of each length, apart from each other by place and heading (beam search). A path
costs, in metres of way,

    the way from its end to the goal, and the turn to face it
    belly   where the underside comes closer to the ground than a margin, by how much, along the way
    climb   what the wheels rise, each by itself, and more where one rises steeply
    lean    the square of the slope of the plane through the points under the wheels, along the way
    turns   a change of the command, a change of direction, an arc driven backward
    memory  how close it comes to places where the rover got stuck
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.env.rocks import HeightScan
from rover_gym.mechanics import OptionError, PathSearch
from rover_gym.policy.rover_outline import RoverOutline
from rover_gym.policy.sweeps import Arcs
from rover_gym.validation import number, refuse

Array = npt.NDArray[np.float64]

#: Poses on an arc.
STEPS = 4


@dataclass(frozen=True)
class PathCosts:
    """What a path costs, in metres of way. Lengths of the rover are in wheel radii where not said otherwise.

    Attributes:
        belly: Of a metre with the underside a wheel radius below the margin.
        margin: Clearance that costs nothing.
        climb: Of a wheel's rise by a radius.
        step: Of the square of a rise between two poses, beyond half a radius.
        lean: Of a metre at a slope of 1.
        facing: Of a radian off the goal, over the rover's reach.
        swerve: Of a change of a command from 0 to its limit.
        switch: Of a change between forward and backward.
        reverse: Of an arc driven backward.
        memory: Of a pose at a place where the rover got stuck.
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
    """Finds paths for a rover: `rover_gym.mechanics.PathSearch` with the rover's arcs and outline.

    Args:
        first: The arcs that a path may begin with.
        further: Those that it may go on with.
        commands: `(len(first), 3)` the command of each first arc: speed, curvature, sideways.
        scan: The grid of the height scan.
        outline: The rover from above.
        x_c: x of the point that follows the path, m.
        reach: The rover's reach, m.
        radius: Its wheels' radius, m.
        arrival: Distance within which the goal is reached, m.
        costs: What a path costs.
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
        self._search = PathSearch(
            scan=(scan.rows, scan.columns, scan.spacing),
            outline={
                "wheels": outline.wheels,
                "underside": outline.underside,
                "clearance": outline.clearance,
                "plane_fit": _plane_fit(*outline.wheels.T),
                "x_c": x_c,
                "radius": radius,
            },
            costs=vars(costs),
            first={"poses": first.poses(length, STEPS), "direction": first.direction, "commands": commands},
            further={"poses": further.poses(length, STEPS), "direction": further.direction},
            reach=reach,
            arrival=arrival,
        )

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
        refuse(OptionError, "model", len(x), "must have wheels that do not stand in a line")
    fit: Array = (cofactors.T[:, :, None] * columns / determinant).sum(axis=1)
    return fit
