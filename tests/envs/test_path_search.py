"""The path search of the core against the same search written in NumPy."""

import math
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pytest
from refusals import refused

from rover_gym import Plane, SphereField, StateError
from rover_gym.core import OptionError, PathSearch, atan2, exp, sin_cos
from rover_gym.drive import MapOptions, PathCosts, ScanPolicy
from rover_gym.drive.scan.scan_policy import ScanMemory
from rover_gym.drive.search.arc_search import STEPS, Arcs, ArcSearch, RoverOutline, SearchTask, ways_by_price
from rover_gym.drive.search.ground_map import GroundMap
from rover_gym.envs import RoverEnv
from rover_gym.envs.start import HeightScan, scan_points

Array = npt.NDArray[np.float64]

Places = npt.NDArray[np.int64]

FINER = 2

HEADINGS = 144

SAME_PLACE, SAME_HEADING = 0.2, 0.25

RETREAT_SWERVE, RETREAT_TO_GO = 4.0, 0.2


def after(first: Array, second: Array) -> Array:
    """`(n, m, steps, 3)` poses `second` `(m, steps, 3)`, each as seen from poses `first` `(n, 3)`."""
    ahead, right, theta = (first[:, i, None, None] for i in range(3))
    sine, cosine = np.sin(theta), np.cos(theta)
    return np.stack(
        (
            ahead + cosine * second[..., 0] + sine * second[..., 1],
            right - sine * second[..., 0] + cosine * second[..., 1],
            theta + second[..., 2],
        ),
        axis=-1,
    )


class OracleGrid:
    """The grid of heights."""

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
        rows, columns = (np.rint(way / self._cell).astype(np.int64) for way in (-ahead, right))
        self._offsets = rows * self._width + columns

    def spread(self, heights: Array) -> Array:
        """The grid, flat, of heights `(rows * columns,)` in the order of the scan, by linear interpolation."""
        coarse = heights.reshape(self._scan.rows, self._scan.columns)
        grid = np.full((self._shape[0] + 2 * self._margin, self._width), float(np.median(heights)))
        inner = grid[self._margin : self._margin + self._shape[0], self._margin : self._margin + self._shape[1]]
        inner[::FINER, ::FINER] = coarse
        inner[1::FINER, ::FINER] = 0.5 * (coarse[:-1] + coarse[1:])
        inner[:, 1::FINER] = 0.5 * (inner[:, :-1:FINER] + inner[:, 2::FINER])
        return grid.ravel()

    def places(self, poses: Array) -> Places:
        """`(..., n)` where the points lie in the grid for poses `(..., 3)` from the present one."""
        row = np.rint(self._origin[0] - poses[..., 0] / self._cell).astype(np.int64)
        column = np.rint(self._origin[1] + poses[..., 1] / self._cell).astype(np.int64)
        row = np.clip(row, -1, self._shape[0]) + self._margin
        column = np.clip(column, -1, self._shape[1]) + self._margin
        heading = np.rint(poses[..., 2] * (HEADINGS / math.tau)).astype(np.intp) % HEADINGS
        places: Places = self._offsets.take(heading, axis=0)
        places += (row * self._width + column)[..., None]  # in place: this is where the time goes
        return places


class OracleSearch:
    """Finds paths for a rover."""

    def __init__(
        self,
        first: Arcs,
        further: Arcs,
        commands: Array,
        *,
        grid: OracleGrid,
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
        columns = np.stack((np.ones_like(x), x, z), axis=1)
        self._fit = np.linalg.pinv(columns)
        self._underside = outline.underside.T
        self._clearance = outline.clearance
        self._n_wheels = len(x)

    def totals(self, heights: Array, task: SearchTask) -> Array:
        """`(len(first),)` the cost of the cheapest path found that begins with each arc; infinite without one."""
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
            return np.where(way == task.retreat, cost + RETREAT_TO_GO * self._to_go(ends, nearest, task), np.inf)
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
        found = np.full(len(mine), np.inf)
        np.minimum.at(found, root, cost + self._to_go(ends, nearest, task))
        return found

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


SCAN = HeightScan(33, 25, 0.12)

X_C, REACH, RADIUS, ARRIVAL = 0.05, 0.9, 0.15, 0.3


def rover_arcs() -> tuple[Arcs, Arcs, Array]:
    first = Arcs.grid([-1.0, 0.0, 1.0], [-0.4, 0.0, 0.4], 1.0).joined(Arcs.grid([-1.0, 0.0, 1.0], [0.0], -1.0))
    further = Arcs.grid([-1.0, 0.0, 1.0], [-0.4, 0.4], 1.0).joined(Arcs.grid([0.0], [0.0], -1.0))
    return first, further, np.column_stack((first.direction, first.curvature, first.sideways))


def searches(costs: PathCosts) -> tuple[ArcSearch, OracleGrid, OracleSearch]:
    env = RoverEnv(terrain="plane")
    outline = RoverOutline.of(env.model, SCAN.spacing)
    first, further, commands = rover_arcs()
    shared: dict[str, Any] = {"outline": outline, "reach": REACH, "radius": RADIUS, "arrival": ARRIVAL, "costs": costs}
    points = np.concatenate((outline.wheels, outline.underside)) - [X_C, 0.0]
    grid = OracleGrid(SCAN, points, X_C)
    oracle = OracleSearch(first, further, commands, grid=grid, **shared)
    return ArcSearch(first, further, commands, scan=SCAN, x_c=X_C, **shared), grid, oracle


def rocky(rng: np.random.Generator) -> Array:
    """Heights of a scan with some rocks on a slope."""
    x, z = SCAN.offsets.T
    heights: Array = 0.1 * rng.normal() * x + 0.1 * rng.normal() * z
    for _ in range(15):
        away = np.hypot(x - rng.uniform(-2.0, 2.0), z - rng.uniform(-1.5, 1.5))
        radius = rng.uniform(0.1, 0.5)
        heights = np.maximum(heights, np.sqrt(np.maximum(0.0, radius**2 - away**2)) - 0.3 * radius)
    return heights


def test_an_arc_after_another_goes_on_from_its_end() -> None:
    whole = Arcs.grid([0.5], [0.0], 1.0).poses(2.0, 2)[0]
    half = Arcs.grid([0.5], [0.0], 1.0).poses(1.0, 1)
    np.testing.assert_allclose(after(half[:, -1], half)[0, 0, 0], whole[1], atol=1e-12)


def test_the_grid_gives_the_heights_of_the_ground_under_the_rover() -> None:
    scan = HeightScan(41, 31, 0.1)
    ground = SphereField([[0.4, -0.2, 0.3], [-0.6, -0.3, -0.5]], [0.6, 0.7], Plane())
    points = np.array([[0.5, -0.4], [0.5, 0.4], [-0.6, 0.0]])
    grid = OracleGrid(scan, points, 0.1)
    heights = grid.spread(ground.heights(scan_points(scan.offsets, (0.0, 0.0), 0.0)))
    rng = np.random.default_rng(0)
    poses = rng.uniform((-0.5, -0.3, -3.0), (0.5, 0.3, 3.0), (200, 3))
    seen = heights[grid.places(poses)]
    for pose, row in zip(poses, seen, strict=True):
        place = (0.1 + pose[0], pose[1])
        expected = ground.heights(scan_points(points, place, pose[2]))
        # The nearest cell is at most 5 cm away, where these rocks rise by half of that at most.
        assert np.abs(row - expected).max() < 0.12
    # Far outside the ground is as it mostly is.
    assert heights[grid.places(np.array([50.0, -50.0, 1.0]))].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("costs", [PathCosts(), PathCosts(depth=1), PathCosts(depth=3, width=5, later=0.5)])
def test_the_core_finds_what_numpy_finds(costs: PathCosts) -> None:
    search, grid, oracle = searches(costs)
    rng = np.random.default_rng(7)
    chosen = set()
    for k in range(60):
        heights = rocky(rng)
        task = SearchTask(
            goal=(rng.uniform(-1.0, 4.0), rng.uniform(-3.0, 3.0)),
            command=np.zeros(3) if k % 5 == 0 else rng.uniform(-1.0, 1.0, 3),
            boldness=rng.uniform(0.2, 1.0),
            traps=rng.uniform((-1.0, -1.0, -3.0), (1.0, 1.0, 3.0), (k % 4, 3)),
            retreat=(0.0, 0.0, -1.0, 1.0)[k % 4],
        )
        found = search.best(heights, task)
        totals = oracle.totals(grid.spread(heights), task)
        # The core adds costs of poses in single precision.
        assert totals[found] <= totals.min() + 1e-4
        chosen.add(found)
    assert len(chosen) > 5


def test_straight_ways_lead_where_no_ways_do() -> None:
    search, grid, oracle = searches(PathCosts())
    rng = np.random.default_rng(8)
    points = SCAN.offsets - [X_C, 0.0]
    for _ in range(20):
        heights = rocky(rng)
        goal = (rng.uniform(3.0, 6.0), rng.uniform(-4.0, 4.0))
        ways = np.hypot(*(points - goal).T)
        task = SearchTask(goal, rng.uniform(-1.0, 1.0, 3), 1.0, np.zeros((0, 3)), 0.0, ways=ways)
        totals = oracle.totals(grid.spread(heights), task)
        # Between the points of the scan the distance is not quite linear, nor beyond its border.
        assert totals[search.best(heights, task)] <= totals.min() + 0.1


def test_ways_lead_round_a_wall() -> None:
    """The goal is straight ahead behind a wall; the cost-to-go leads round it to the left."""
    search, _, _ = searches(PathCosts())
    ways = 5.0 + SCAN.offsets[:, 1]
    task = SearchTask((4.0, 0.0), np.zeros(3), 1.0, np.zeros((0, 3)), 0.0)
    _, _, commands = rover_arcs()
    ahead = commands[search.best(np.zeros(825), task)]
    left = commands[search.best(np.zeros(825), replace(task, ways=ways))]
    assert ahead.tolist() == [1.0, 0.0, 0.0]
    assert left[0] == left[1] == 1.0


def test_the_way_over_a_map_is_the_distance_where_nothing_is_in_it() -> None:
    search, _, _ = searches(PathCosts())
    level = np.zeros((40, 50))
    known = np.full((40, 50), 0.3)
    known[:, 20:] = np.nan
    ways = search.ways(known, 0.1, (30, 10), 1.0, level)
    assert ways[30, 10] == 0.0
    assert ways[30, 45] == pytest.approx(3.5)
    assert ways[10, 30] == pytest.approx(0.1 * 20 * math.sqrt(2.0))
    wall = np.zeros((40, 50))
    wall[5:25, 24:26] = 0.5
    assert search.ways(wall, 0.1, (15, 10), 1.0, level)[15, 40] > 3.0 + 0.5
    assert search.ways(wall, 0.1, (15, 10), 0.0, level)[15, 40] == pytest.approx(3.0)
    price = np.zeros((40, 50))
    price[:, 30:] = 2.0
    assert search.ways(known, 0.1, (30, 10), 1.0, price)[30, 45] == pytest.approx(2.0 + 3.0 * 1.5, abs=0.3)
    bad: list[tuple[str, tuple[Any, ...]]] = [
        ("heights", (np.zeros((2, 50)), 0.1, (0, 0), 1.0, level)),
        ("heights", (np.full((40, 50), np.inf), 0.1, (0, 0), 1.0, level)),
        ("spacing", (known, 0.0, (0, 0), 1.0, level)),
        ("goal", (known, 0.1, (0, np.nan), 1.0, level)),
        ("boldness", (known, 0.1, (0, 0), -1.0, level)),
        ("extra", (known, 0.1, (0, 0), 1.0, np.zeros((3, 3)))),
        ("extra", (known, 0.1, (0, 0), 1.0, -price)),
    ]
    for field, given in bad:
        with pytest.raises(OptionError, match=field):
            search.ways(*given)


def test_ways_by_price_alone_are_the_cheapest_of_all() -> None:
    """The Bellman-Ford algorithm finds the same costs, and no path crosses closed cells."""
    rng = np.random.default_rng(3)
    price = 1.0 + rng.exponential(size=(12, 9))
    price[rng.random(price.shape) < 0.25] = np.inf
    price[:, 6], price[4, 2] = np.inf, 1.0  # a wall, and the goal before it
    expected = np.full(price.shape, np.inf)
    expected[4, 2] = 0.0
    for _ in range(price.size):
        onward = np.pad(expected, 1, constant_values=np.inf)
        into = np.pad(price, 1, constant_values=np.inf)
        for i, j in ((i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)):
            beside = (slice(i, i + price.shape[0]), slice(j, j + price.shape[1]))
            expected = np.minimum(expected, onward[beside] + 0.5 * math.hypot(i - 1, j - 1) * into[beside])
        expected[np.isinf(price)] = np.inf
    ways = ways_by_price(price, 0.5, (4, 2))
    assert np.isinf(ways[:, 6:]).all()
    assert 20 < np.isfinite(ways).sum() < 60
    np.testing.assert_allclose(ways, expected, rtol=1e-12)


def test_what_is_wrong_is_named() -> None:
    search, _, _ = searches(PathCosts())
    task = SearchTask((1.0, 0.0), np.zeros(3), 1.0, np.zeros((0, 3)), 0.0)
    with pytest.raises(OptionError, match=r"heights.*825 finite heights"):
        search.best(np.zeros(7), task)
    with pytest.raises(OptionError, match="heights"):
        search.best(np.full(825, np.nan), task)
    first, further, commands = rover_arcs()
    outline = {
        "wheels": np.zeros((4, 2)),
        "underside": np.zeros((2, 2)),
        "clearance": np.zeros(2),
        "plane_fit": np.zeros((3, 4)),
        "x_c": 0.0,
        "radius": 0.1,
    }
    given: dict[str, Any] = {
        "scan": (33, 25, 0.1),
        "outline": outline,
        "costs": vars(PathCosts()),
        "first": {"poses": first.poses(1.0, 4), "direction": first.direction, "commands": commands},
        "further": {"poses": further.poses(1.0, 4), "direction": further.direction},
        "reach": 1.0,
        "arrival": 0.1,
    }
    PathSearch(**given)
    wrong: list[tuple[str, dict[str, Any]]] = [
        ("scan", {"scan": (1, 25, 0.1)}),
        ("scan", {"scan": (33, 25, 0.0)}),
        ("outline", {"outline": outline | {"clearance": np.zeros(3)}}),
        ("outline.plane_fit", {"outline": outline | {"plane_fit": np.zeros((2, 4))}}),
        ("costs.depth", {"costs": vars(PathCosts()) | {"depth": 0}}),
        ("costs.belly", {"costs": {}}),
        ("first", {"first": given["first"] | {"poses": first.poses(1.0, 3)}}),
        ("first.commands", {"first": given["first"] | {"commands": commands[1:]}}),
        ("reach", {"reach": 0.0}),
        ("arrival", {"arrival": np.nan}),
    ]
    for field, change in wrong:
        with refused(OptionError, field, field):
            PathSearch(**(given | change))


def test_a_far_away_pose_lies_on_the_median() -> None:
    """The policy decides with a goal far beyond its scan."""
    search, _, _ = searches(PathCosts())
    task = SearchTask((1e4, -1e4), np.zeros(3), 1.0, np.zeros((0, 3)), 0.0)
    assert 0 <= search.best(np.zeros(825), task) < 12


def test_the_policy_and_its_arguments_know_the_search() -> None:
    env = RoverEnv(terrain="rocks", **ScanPolicy.arguments())
    observation, _ = env.reset(seed=1)
    action, _ = ScanPolicy(env).predict(observation)
    assert np.isfinite(action).all()


MAP_SCAN = HeightScan(21, 17, 0.1)

GROUND = SphereField([[0.6, -0.1, 0.4], [-0.5, -0.2, -0.3]], [0.4, 0.5], Plane())


def taken(place: tuple[float, float], heading: float) -> npt.NDArray[np.float64]:
    return np.asarray(GROUND.heights(scan_points(MAP_SCAN.offsets, place, heading)))


def empty(cells: int, place: tuple[float, float]) -> tuple[GroundMap, npt.NDArray[np.float32], npt.NDArray[np.int64]]:
    ground = GroundMap(MAP_SCAN, MapOptions(cells=cells), 0.3)
    heights, corner = np.zeros((cells, cells), np.float32), np.zeros(2, np.int64)
    ground.begin(heights, corner, place)
    return ground, heights, corner


def true_heights(corner: npt.NDArray[np.int64], cells: int) -> npt.NDArray[np.float64]:
    x, z = (0.1 * (corner[k] + np.arange(cells)) for k in (0, 1))
    points = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(GROUND.heights(points)).reshape(cells, cells)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_the_map_shows_the_ground_that_was_scanned(heading: float) -> None:
    place = (0.13, -0.08)
    ground, heights, corner = empty(60, place)
    assert np.isnan(heights).all()
    ground.remember(heights, corner, taken(place, heading), place, heading)
    seen = np.isfinite(heights)
    # The scan covers 2.0 by 1.6 m, a cell 0.01 m2.
    assert seen.sum() == pytest.approx(320, abs=25)
    assert np.abs(heights - true_heights(corner, 60))[seen].max() < 0.06


def test_what_was_seen_stays_when_the_map_moves() -> None:
    ground, heights, corner = empty(40, (0.0, 0.0))
    ground.remember(heights, corner, taken((0.0, 0.0), 0.0), (0.0, 0.0), 0.0)
    before = int(np.isfinite(heights).sum())
    first = corner.copy()
    ground.remember(heights, corner, taken((0.9, 0.4), 0.3), (0.9, 0.4), 0.3)
    assert (corner - first).tolist() == [9, 4]
    seen = np.isfinite(heights)
    assert seen.sum() > before
    assert np.abs(heights - true_heights(corner, 40))[seen].max() < 0.06
    # Far away nothing of it is left, and the scan is all that is known.
    ground.remember(heights, corner, taken((50.0, 0.0), 0.0), (50.0, 0.0), 0.0)
    assert np.isfinite(heights).sum() == pytest.approx(21 * 17, abs=40)


def test_a_rover_remembers_the_ground_of_its_own_episode() -> None:
    env = gym.make("RoverRocks-v0", difficulty=1.0, **ScanPolicy.arguments())
    policy = ScanPolicy(env, map=MapOptions(cells=100))
    observation, _ = env.reset(seed=3)
    action, state = policy.predict(observation)
    assert env.action_space.contains(action)
    both = np.stack((observation, observation))
    twice = (np.concatenate((part, part)) for part in state)
    actions, state = policy.predict(both, tuple(twice), np.array([False, True]))
    assert actions.shape == (2, 12)
    memory = ScanMemory.of(state, 2, 100)
    x, z = ((memory.corner[1, k] + np.arange(100)) * ScanPolicy.arguments()["height_scan"][2] for k in (0, 1))
    points = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    truth = np.asarray(env.unwrapped.simulation.terrain.heights(points)).reshape(100, 100)  # type: ignore[union-attr]
    off = np.abs(memory.ground[1] - truth)
    assert np.nanmedian(off) < 0.01
    assert 1500 < np.isfinite(off).sum() < 2300


def test_a_map_that_is_none_is_refused() -> None:
    env = gym.make("RoverRocks-v0", **ScanPolicy.arguments())
    with pytest.raises(OptionError, match="map"):
        ScanPolicy(env, map=160)  # type: ignore[arg-type]
    for name, value in (("cells", 7), ("risk", -1.0), ("unknown", np.nan), ("trap", np.inf), ("every", 0)):
        with pytest.raises(OptionError, match=f"map.{name}"):
            MapOptions(**{name: value})  # type: ignore[arg-type]
    observation, _ = env.reset(seed=1)
    _, state = ScanPolicy(env).predict(observation)
    with pytest.raises(StateError, match="state"):
        ScanPolicy(env, map=MapOptions()).predict(observation, state)


def test_a_rover_with_a_map_comes_out_of_a_deep_dead_end() -> None:
    """A bay of rocks, 5 m wide and 4 m deep, stands open to the rover; the goal lies behind it.

    Without a map the policy is still in it after a minute.
    """
    end = [[5.0, 0.0, z] for z in np.arange(-2.5, 2.6, 0.6)]
    sides = [[x, 0.0, side * 2.8] for x in np.arange(1.0, 5.1, 0.6) for side in (-1.0, 1.0)]
    centres = end + sides
    terrain = SphereField(centres, [0.5] * len(centres), Plane())
    env = gym.make("Rover-v0", terrain=terrain, heading_deg=0.0, **ScanPolicy.arguments())
    observation, _ = env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (9.0, 0.0)})
    policy = ScanPolicy(env, map=MapOptions())
    state: Any = None
    over = False
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    assert info["termination"] == "goal"
