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

from rover_gym.mechanics import OptionError, atan2, exp, sin_cos
from rover_gym.policy.ground_grid import GroundGrid
from rover_gym.policy.rover_outline import RoverOutline
from rover_gym.policy.sweeps import Arcs, after
from rover_gym.validation import number, refuse

Array = npt.NDArray[np.float64]

#: Poses on an arc.
STEPS = 4

#: Lengths of the rover's reach, and the turn, rad, within which two ends of paths count as one.
SAME_PLACE, SAME_HEADING = 0.2, 0.25

#: While the rover backs off: the further cost of a change of the command, since wheels that are being steered do not
#: push, over that of other times; and the cost of the way to the goal.
RETREAT_SWERVE, RETREAT_TO_GO = 4.0, 0.2


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
    """

    goal: tuple[float, float]
    command: Array
    boldness: float
    traps: Array
    retreat: float


class ArcSearch:
    """Finds paths for a rover.

    Args:
        first: The arcs that a path may begin with.
        further: Those that it may go on with.
        commands: `(len(first), 3)` the command of each first arc: speed, curvature, sideways.
        grid: Heights under the wheels, then under the underside, by pose.
        outline: The rover's points, in this order.
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
        grid: GroundGrid,
        outline: RoverOutline,
        reach: float,
        radius: float,
        arrival: float,
        costs: PathCosts,
    ) -> None:
        self._commands, self._further = commands, further
        self._grid, self.costs = grid, costs
        self._reach, self._radius, self._arrival = reach, radius, arrival
        self._step = costs.length * reach / STEPS
        self._first_poses = first.poses(costs.length * reach, STEPS)
        self._further_poses = further.poses(costs.length * reach, STEPS)
        self._first_places = grid.places(self._first_poses)
        self._places_now = grid.places(np.zeros(3))
        x, z = outline.wheels.T
        self._fit = _plane_fit(x, z).astype(np.float32)
        self._underside = outline.underside.T.astype(np.float32)
        self._clearance = outline.clearance.astype(np.float32)
        self._n_wheels = len(x)

    def best(self, heights: Array, task: SearchTask) -> int:
        """The first arc of the cheapest path over heights as `GroundGrid.spread` gives them."""
        costs, mine = self.costs, self._commands
        now = heights[self._places_now[: self._n_wheels]]
        risk, wheels = self._risk(heights.take(self._first_places), np.broadcast_to(now, (len(mine), len(now))))
        distance = self._distance(self._first_poses, task)
        # What lies behind the goal costs nothing.
        cost = task.boldness * np.where(np.minimum.accumulate(distance, axis=1) < self._arrival, 0.0, risk).sum(axis=1)
        cost += costs.memory * self._nearness(self._first_poses, task)
        if task.command[0] != 0.0:
            cost += costs.swerve * np.abs(mine[:, 1:] - task.command[1:]).sum(axis=1)
        cost += costs.switch * (mine[:, 0] * task.command[0] < 0.0) + costs.reverse * (mine[:, 0] < 0.0)
        ends, nearest, way = self._first_poses[:, -1], distance.min(axis=1), mine[:, 0]
        if task.retreat:
            cost += RETREAT_SWERVE * costs.swerve * np.abs(mine[:, 1:] - task.command[1:]).sum(axis=1)
            total = np.where(way == task.retreat, cost + RETREAT_TO_GO * self._to_go(ends, nearest, task), np.inf)
            return int(np.argmin(total))
        root = np.arange(len(mine))
        n = len(self._further)
        for arc in range(1, int(costs.depth)):
            kept = self._apart(cost + self._to_go(ends, nearest, task), ends)
            poses = after(ends[kept], self._further_poses)
            before = np.broadcast_to(wheels[kept, None], (len(kept), n, self._n_wheels))
            risk, wheels = self._risk(heights.take(self._grid.places(poses)), before)
            distance = np.minimum(np.minimum.accumulate(self._distance(poses, task), axis=2), nearest[kept, None, None])
            risk = task.boldness * np.where(distance < self._arrival, 0.0, risk).sum(axis=2)
            more = costs.later**arc * (risk + costs.memory * self._nearness(poses, task))
            directions = self._further.direction
            more = more + costs.switch * (directions * way[kept, None] < 0.0) + costs.reverse * (directions < 0.0)
            cost = (cost[kept, None] + more).ravel()
            nearest, ends = distance[..., -1].ravel(), poses[:, :, -1].reshape(-1, 3)
            wheels = wheels.reshape(-1, self._n_wheels)
            root, way = np.repeat(root[kept], n), np.tile(directions, len(kept))
        return int(root[np.argmin(cost + self._to_go(ends, nearest, task))])

    def _apart(self, totals: Array, ends: Array) -> npt.NDArray[np.intp]:
        """The cheapest paths whose ends are apart from those of cheaper ones."""
        size = np.array([SAME_PLACE * self._reach, SAME_PLACE * self._reach, SAME_HEADING])
        order = np.argsort(totals, kind="stable")
        cells = np.rint(ends[order] / size).astype(int).tolist()
        kept: dict[tuple[int, ...], int] = {}
        for path, cell in zip(order.tolist(), cells, strict=True):
            kept.setdefault(tuple(cell), path)
            if len(kept) == self.costs.width:
                break
        return np.array(list(kept.values()))

    def _risk(self, seen: Array, before: Array) -> tuple[Array, Array]:
        """`(..., STEPS)` costs of poses by the heights `(..., STEPS, points)`, and the wheels' heights at the last."""
        costs = self.costs
        wheels, under = seen[..., : self._n_wheels], seen[..., self._n_wheels :]
        # Sums, not products of matrices: the bits must not depend on how many are asked at once.
        level, ahead, right = ((wheels * row).sum(axis=-1)[..., None] for row in self._fit)
        risk = self._step * costs.lean * (ahead * ahead + right * right)[..., 0]
        if under.shape[-1]:
            x, z = self._underside
            gaps = ahead * x
            gaps += right * z
            gaps += self._clearance
            gaps -= under
            gap = (gaps.min(axis=-1) + level[..., 0]) / self._radius
            low = np.maximum(0.0, costs.margin - gap)
            risk += self._step * costs.belly * low * (1.0 + low)
        passed = np.concatenate((before[..., None, :], wheels), axis=-2)
        rise = np.maximum(0.0, np.diff(passed, axis=-2)) / self._radius
        steep = np.maximum(0.0, rise - 0.5)
        risk += (costs.climb * rise + costs.step * steep * steep).sum(axis=-1)
        return risk, wheels[..., -1, :]

    @staticmethod
    def _distance(poses: Array, task: SearchTask) -> Array:
        """Distances of poses from the goal, m."""
        away: Array = np.sqrt((poses[..., 0] - task.goal[0]) ** 2 + (poses[..., 1] - task.goal[1]) ** 2)
        return away

    def _to_go(self, ends: Array, nearest: Array, task: SearchTask) -> Array:
        """`(n,)` way from the ends of paths to the goal, m; 0 for those that pass it."""
        ahead, right = task.goal[0] - ends[:, 0], task.goal[1] - ends[:, 1]
        sine, cosine = sin_cos(ends[:, 2])
        bearing = np.abs(atan2(ahead * sine + right * cosine, ahead * cosine - right * sine))
        distance = np.sqrt(ahead * ahead + right * right)
        turn = self.costs.facing * np.minimum(bearing, 2.0) * np.minimum(distance, self._reach)
        to_go: Array = np.where(nearest < self._arrival, 0.0, distance + turn)
        return to_go

    def _nearness(self, poses: Array, task: SearchTask) -> Array:
        """How close the poses of paths come to the traps, 1 at one, summed over the traps."""
        total = np.zeros(poses.shape[:-2])
        for ahead, right, heading in task.traps.tolist():
            apart = (poses[..., 0] - ahead) ** 2 + (poses[..., 1] - right) ** 2
            turned = 1.0 - sin_cos(poses[..., 2] - heading)[1]
            total += exp(-apart / (0.3 * self._reach) ** 2 - 10.0 * turned).max(axis=-1)
        return total


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
