"""`ScanPolicy`: plans the cheapest path over the height scan and backs off if it gets stuck."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel, StateError, exp, sin_cos
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.command import N_COMMANDS, CommandController, CommandLimits
from rover_gym.drive.commands.driven import Actions, Gains, ObservingPolicy, State, driven_rover, given_or_usual
from rover_gym.drive.commands.features import ground_slope
from rover_gym.drive.commands.turning import Turning
from rover_gym.drive.forecast.arc_forecast import FORECAST_FILE, USUAL_WAY, ArcFeatures, ArcForecast, ForesightCosts
from rover_gym.drive.forecast.network_files import FOLDER, FORECAST, Network, PolicyError, is_there
from rover_gym.drive.search.arc_search import Arcs, ArcSearch, PathCosts, RoverOutline, SearchTask
from rover_gym.drive.search.ground_map import GroundMap, MapOptions
from rover_gym.envs.observation import Array, Mask
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import HeightScan, wheel_centres
from rover_gym.models.lookup import ModelLike, as_model

Counts = npt.NDArray[np.int64]

#: Points of a planned path.
PLAN_POINTS = 13

#: Traps that are remembered; a further one replaces the oldest.
TRAPS = 12


@dataclass
class ScanMemory:
    """The memory of n rovers; all zeros at the start of an episode.

    Attributes:
        command: `(n, 3)` the command.
        age: `(n,)` observations since the start.
        anchor: `(n, 2)` place where the rover was when it last moved, m.
        still: `(n,)` time since then, s.
        nearest: `(n,)` distance to the goal when it last made progress, m.
        fruitless: `(n,)` time since then, s.
        retreat: `(n,)` time that it still backs off, s.
        away: `(n,)` direction in which, 1 or -1.
        traps: `(n, TRAPS, 3)` x and z, m, and heading, rad, of places where it got stuck.
        n_traps: `(n,)` how many there have been.
        ground: `(n, cells, cells)` heights of the ground that was seen, m; see `GroundMap`. No cells without a map.
        corner: `(n, 2)` where its first cell lies, in cells.
        ways: `(n, cells, cells)` the way to the goal from each cell, m, when it was last computed.
        ways_corner: `(n, 2)` where the first cell lay then.
        start: `(n, 2)` place of the start, m.
    """

    command: Array
    age: Counts
    anchor: Array
    still: Array
    nearest: Array
    fruitless: Array
    retreat: Array
    away: Array
    traps: Array
    n_traps: Counts
    ground: npt.NDArray[np.float32]
    corner: Counts
    ways: npt.NDArray[np.float32]
    ways_corner: Counts
    start: Array

    @classmethod
    def of(cls, state: tuple[npt.NDArray[Any], ...] | None, n: int, cells: int = 0) -> "ScanMemory":
        """A copy of the memory in a state from `predict`, or the memory of n rovers at a start.

        Maps have so many `cells` along each side.

        Raises:
            StateError: The state is of another policy or of another number of rovers.
        """
        fresh = cls(
            command=np.zeros((n, N_COMMANDS)),
            age=np.zeros(n, np.int64),
            anchor=np.zeros((n, 2)),
            still=np.zeros(n),
            nearest=np.zeros(n),
            fruitless=np.zeros(n),
            retreat=np.zeros(n),
            away=np.zeros(n),
            traps=np.zeros((n, TRAPS, 3)),
            n_traps=np.zeros(n, np.int64),
            ground=np.zeros((n, cells, cells), np.float32),
            corner=np.zeros((n, 2), np.int64),
            ways=np.zeros((n, cells, cells), np.float32),
            ways_corner=np.zeros((n, 2), np.int64),
            start=np.zeros((n, 2)),
        )
        if state is None:
            return fresh
        shapes, expected = [np.shape(values) for values in state], [values.shape for values in fresh.state]
        if shapes != expected:
            refuse(StateError, "state", shapes, f"must be a state that predict returned for {n} rovers")
        return cls(*(values.copy() for values in state))

    @property
    def state(self) -> tuple[npt.NDArray[Any], ...]:
        """The arrays, as `predict` returns them."""
        return tuple(vars(self).values())

    def forget(self, rovers: npt.NDArray[np.bool_]) -> None:
        """Resets the memory of the rovers marked in `rovers` `(n,)`."""
        for values in vars(self).values():
            values[rovers] = 0

    def notice(self, place: tuple[float, float], distance: float, period: float, least: float, i: int) -> None:
        """Counts the times of rover i after a period, s, at a place and a distance to the goal, m.

        It has moved, or made progress, if that is more than `least` m.
        """
        begins = self.age[i] == 0
        if begins:
            self.start[i] = place
        self.still[i] += period
        self.fruitless[i] += period
        if begins or math.dist(place, self.anchor[i].tolist()) > least:
            self.anchor[i], self.still[i] = place, 0.0
        if begins or distance < self.nearest[i] - least:
            self.nearest[i], self.fruitless[i] = distance, 0.0
        self.retreat[i] = max(0.0, self.retreat[i] - period)

    def back_off(self, trap: tuple[float, float, float], direction: float, time: float, i: int) -> None:
        """Rover i got stuck at a trap, and backs off in a direction for a time, s."""
        self.traps[i, self.n_traps[i] % TRAPS] = trap
        self.n_traps[i] += 1
        self.away[i], self.retreat[i] = direction, time
        # It has that time to move before it counts as stuck again.
        self.still[i] = 0.0

    def known_traps(self, i: int) -> Array:
        """`(m, 3)` the traps of rover i."""
        return self.traps[i, : min(int(self.n_traps[i]), TRAPS)]


def scan_grid(rover: RoverEnv) -> HeightScan:
    """The grid of an environment's height scan.

    Raises:
        OptionError: It has none, or one of a single row or column.
    """
    offsets = rover.task.scan
    if offsets is None:
        refuse(OptionError, "height_scan", False, "must be given, for instance by ScanPolicy.arguments()")
    columns = int(np.count_nonzero(offsets[:, 0] == offsets[0, 0]))
    rows = len(offsets) // columns
    if rows < 2 or columns < 2:
        refuse(OptionError, "height_scan", (rows, columns), "must have at least two rows and two columns")
    return HeightScan(rows, columns, float(offsets[0, 0] - offsets[columns, 0]))


#: Rows and columns of the height scan that the policy asks for, and their spacing over the rover's reach.
SCAN = (48, 40, 0.1)

#: Largest angle of travel off the trunk's x axis, degrees, and largest curvature, 1/m.
MAX_SIDEWAYS_DEG, MAX_CURVATURE = 30.0, 3.0

#: Largest speed over that at which the slowest motor has no torque left.
SHARE_OF_TOP_SPEED = 0.9

#: Way that counts as movement, and distance to the goal that counts as progress, over the rover's reach.
PROGRESS = 0.15

#: Distance of a trap ahead of a stuck rover, relative to the rover's reach.
TRAP_AHEAD = 0.3

#: Time without movement after which the rover pushes, s.
PUSH_AFTER = 0.3

#: Height of a fence at the field's edge, in wheel radii, the cost of an arc that leads through it, in reaches, and the
#: length to which an arc is followed for that, over its own: a fast rover stops behind its end.
FENCE, THROUGH_FENCE, FOLLOWED = 8.0, 50.0, 1.5

#: Fraction of the time to high-centring after which the rover backs off.
HIGH = 0.05

#: Time without movement after which a rover that is high-centred tries the other direction, s: once each way.
HIGH_PATIENCE = 0.7


@dataclass(frozen=True)
class ScanGains(Gains):
    """The policy's speed and times.

    Attributes:
        speed: Speed, m/s, where the motors reach it.
        push: Commanded speed if a rock has stopped the rover, m/s: the torque grows with the missing speed.
        response: Time constant of the speed controller for the whole rover's mass, s.
        period: Time between decisions, s.
        patience: Time without movement until the rover backs off, s, for a rover that takes a second or less for its
            own reach; longer in proportion for a slower one, as the times below.
        retreat: Time that it backs off, s.
        insistence: Time without progress after which it backs off for twice as long, s; after twice that, thrice.
        courage: Time without progress that halves the cost of risks, s.
        least: Least factor on the cost of risks.
    """

    speed: float = 1.2
    push: float = 2.5
    response: float = 0.2
    period: float = 0.2
    patience: float = 1.0
    retreat: float = 1.2
    insistence: float = 10.0
    courage: float = 12.0
    least: float = 0.2


class ScanPolicy(ObservingPolicy):
    """Drives a rover to its goal by planning over the height scan, with the `predict` of `ObservingPolicy`.

    Every 0.2 s it compares paths of four arcs, each 0.6 of the rover's reach long, see
    `rover_gym.drive.search.arc_search`. The model defines the wheels and the underside of all collision shapes, which
    moves with the plane through the ground under the wheels. The first arc of the cheapest path becomes the command of
    `CommandController`.

    The policy backs off for a second or so

    - if it has not moved for a second,
    - if the trunk begins to carry the rover (the observation's `stuck`),
    - if the cheapest path begins backward.

    It remembers up to 12 such places and avoids them. If a rock stops the rover, it pushes with most of its torque. The
    longer it makes no progress, the farther it backs off and the more risk it takes. Success rates are in
    docs/policy-results.md.

    Example:
        >>> env = gym.make("RoverRocks-v0", difficulty=1.0, **ScanPolicy.arguments())
        >>> policy = ScanPolicy(env)

    Args:
        env: A rover environment with a height scan, wrapped or not, or a vector of them. It is read once, for layout
            and rover constants.
        gains: Speed and times.
        costs: Costs of a path.
        map: Options of a map of all scans, which gives the cost-to-go; None for the straight distance.
        forecast: A learned one-second prediction of each arc, see `rover_gym.drive.forecast.arc_forecast`: the folder
            of a trained one, or True for the package's. The policy adds the costs of the predicted outcomes, and drives
            an arc fast if that is cheaper.
        foresight: Costs of predicted outcomes.

    Attributes:
        gains: Speed and times.
        arcs: Arcs for the first segment of a path.
        commands: `(n_arcs, 3)` their commands, at a speed of 1.
        cruise: The first entry of a command at cruising speed, `cruise_speed` in m/s.
        push: The same where the policy pushes.
        search: Finds the cheapest path.
        controller: Turns commands into actions.
        forecast: The prediction; None without one.

    Raises:
        OptionError: The environment has no height scan, or all wheels are in one line.
        PolicyError: The folder does not contain a forecast.
    """

    def __init__(
        self,
        env: Any,
        gains: ScanGains | None = None,
        costs: PathCosts | None = None,
        *,
        map: MapOptions | None = None,  # noqa: A002 - what it is
        forecast: str | Path | bool | None = None,
        foresight: ForesightCosts | None = None,
    ) -> None:
        rover = driven_rover(env, type(self).__name__)
        super().__init__(rover)
        self.gains, costs = given_or_usual("gains", gains, ScanGains), given_or_usual("costs", costs, PathCosts)
        map_options = None if map is None else given_or_usual("map", map, MapOptions)
        self._caution, self.foresight = 1.0, given_or_usual("foresight", foresight, ForesightCosts)
        scan = scan_grid(rover)
        layout, model = rover.observation_layout, rover.model
        self._layout, self._scale, self._offsets = layout, layout.scale, scan.offsets
        self._heights, self._goal = layout["height_scan"], layout["goal"]
        self._q, self._stuck = layout["q"].start, layout["stuck"].start

        turning = Turning.of(model, model.mass * math.hypot(*rover.gravity))
        limits = _limits(rover, turning, self.gains)
        outline = RoverOutline.of(model, scan.spacing)
        self.radius = float(model.wheel_radii.max())
        self._margin = None if rover.task.n_further else rover.task.field_margin
        self.clearance = float(outline.clearance.min(initial=math.inf))
        self._x_c, self.reach = turning.x_c, _reach(model)
        # Times are meant for a rover that takes at most a second for its own reach.
        speed = min(self.gains.speed, SHARE_OF_TOP_SPEED * _top_speed(model))
        self.pace = max(1.0, self.reach / speed)
        self.controller = CommandController(rover, limits)
        self.cruise_speed = speed
        self.cruise, self.push = speed / limits.speed, self.gains.push / limits.speed
        first, further = _arcs(rover, turning, limits)
        side = math.radians(limits.sideways_deg)
        self.commands = np.column_stack((first.direction, first.curvature / limits.curvature, first.sideways / side))
        self.arcs = first
        self.search = ArcSearch(
            first,
            further,
            self.commands,
            scan=scan,
            outline=outline,
            x_c=turning.x_c,
            reach=self.reach,
            radius=self.radius,
            arrival=0.6 * rover.task.goal_tolerance,
            costs=costs,
        )
        self._ahead = costs.length * self.reach
        self._ends = first.poses(FOLLOWED * self._ahead, 1)[:, 0, :2]
        self._map = None if map_options is None else GroundMap(scan, map_options, TRAP_AHEAD * self.reach)
        self._cells = 0 if map_options is None else map_options.cells
        self.forecast: ArcForecast | None = None
        if forecast is not None and forecast is not False:
            folder = FOLDER / FORECAST if forecast is True else Path(forecast)
            if not is_there(folder / FORECAST_FILE):
                refuse(PolicyError, "forecast", str(folder / FORECAST_FILE), "is not there")
            features = ArcFeatures(rover, self)
            self._length = features.length
            self.forecast = ArcForecast(features, Network.read(folder / FORECAST_FILE))
            self._caution = self.foresight.caution
        self.hold_periods = hold_periods(self.gains.period, rover.dt)
        self._period = self.hold_periods * rover.dt

    @staticmethod
    def arguments(model: ModelLike | None = None) -> dict[str, Any]:
        """Arguments for an environment with a height scan that fits the rover's size.

        Args:
            model: The rover, its name in the gallery or its file; None for the built-in one.

        Raises:
            ModelError: There is no such model.
        """
        rows, columns, spacing = SCAN
        rover = RoverModel() if model is None else as_model("model", model)
        return {"height_scan": (rows, columns, round(spacing * _reach(rover), 2))}

    def act(self, rows: Array, state: State, starts: Mask, _deterministic: bool) -> tuple[Actions, State]:
        """Actions along the commands, each held for `gains.period` seconds, and the memory with the commands."""
        memory = ScanMemory.of(state, len(rows), self._cells)
        memory.forget(starts)
        due = np.flatnonzero(memory.age % self.hold_periods == 0)
        if len(due):
            slopes = ground_slope(self._layout, rows[due])
            for i, slope in zip(due.tolist(), slopes.tolist(), strict=True):
                memory.command[i] = self._decide(rows[i], slope, memory, i)
        actions = self.controller.act(rows, memory.command)
        memory.age += 1
        return actions, memory.state

    def choices(self) -> Array:
        """`(n, points, 2)` the first arcs that it chooses from, ahead and to the right of the trunk, m."""
        return self._drawn(self.arcs)

    def plan(self, state: tuple[npt.NDArray[Any], ...] | None) -> Array | None:
        """`(points, 2)` the arc that a state of one rover follows, ahead and to the right of the trunk, m."""
        if state is None:
            return None
        speed, curvature, sideways = ScanMemory.of(state, 1, self._cells).command[0].tolist()
        limits = self.controller.limits
        arc = Arcs(
            np.array([limits.curvature * curvature]),
            np.array([math.radians(limits.sideways_deg) * sideways]),
            np.array([math.copysign(1.0, speed)]),
        )
        drawn: Array = self._drawn(arc)[0]
        return drawn

    def _drawn(self, arcs: Arcs) -> Array:
        """`(n, points, 2)` points of arcs, from where they begin."""
        ways = arcs.poses(self._ahead, PLAN_POINTS - 1)[..., :2]
        points: Array = np.concatenate((np.zeros((len(arcs), 1, 2)), ways), axis=1)
        points[..., 0] += self._x_c
        return points

    def _decide(self, row: Array, slope: list[float], memory: ScanMemory, i: int) -> Array:
        """The command for one observation, scaled as the environment returns it; updates what is remembered."""
        self.notice(row, memory, i)
        arc, pushes = self.choose(row, slope, memory, i)
        command: Array = self.commands[arc] * [self.push if pushes else self.cruise, 1.0, 1.0]
        self.begin_arc(row, command, memory, i)
        return command

    def notice(self, row: Array, memory: ScanMemory, i: int) -> None:
        """Counts the times of rover i up to an observation, and backs off if it has not moved for too long."""
        x, z, heading = (float(row[self._q + k]) for k in (0, 2, 4))
        goal = row[self._goal] * self._scale[self._goal]
        memory.notice((x, z), math.hypot(*goal), self._period, PROGRESS * self.reach, i)
        is_high = row[self._stuck] > HIGH
        patience = HIGH_PATIENCE if is_high else self.gains.patience * self.pace
        if memory.age[i] > 0 and (memory.still[i] > patience or (is_high and memory.retreat[i] == 0.0)):
            self._back_off(memory, i, x, z, heading)

    def choose(
        self, row: Array, slope: list[float], memory: ScanMemory, i: int, further: Array | None = None
    ) -> tuple[int, bool]:
        """The first arc of the cheapest path from an observation of rover i, and whether to push on it.

        What is remembered changes only by the map, where there is one. `further` `(n_arcs,)` are costs of the first
        arcs beside the policy's own, m.
        """
        x, z, heading = (float(row[self._q + k]) for k in (0, 2, 4))
        goal = row[self._goal] * self._scale[self._goal]
        sine, cosine = sin_cos(heading)
        ahead, right, turned = (memory.known_traps(i) - [x, z, heading]).T
        heights = self.fenced(row, slope, memory.start[i])
        boldness = self._boldness(memory.fruitless[i])
        extra, fast = self._outlook(row, slope, heights, boldness)
        fence = self._through_fence(row, memory.start[i])
        costs = [cost for cost in (extra, further, fence) if cost is not None]
        retreat = float(memory.away[i]) if memory.retreat[i] > 0.0 else 0.0
        if fence is not None and (fence[self.arcs.direction == retreat] > 0.0).all():
            retreat = 0.0  # backing off would leave the field
        task = SearchTask(
            goal=(float(goal[0]) - self._x_c, float(goal[1])),
            command=memory.command[i].copy(),
            boldness=self._caution * boldness,
            traps=np.column_stack((ahead * cosine - right * sine, ahead * sine + right * cosine, turned)),
            retreat=retreat,
            extra=sum(costs[1:], costs[0]) if costs else None,
            ways=self._ways(row, slope, memory, i),
        )
        arc = self.search.best(heights, task)
        turns_back = self.commands[arc, 0] < 0.0 and not task.retreat
        is_held = memory.still[i] > PUSH_AFTER * self.pace and not turns_back
        return arc, bool(is_held or row[self._stuck] > HIGH or fast[arc])

    def beyond_field(self, rows: Array, starts: Array) -> npt.NDArray[np.bool_] | None:
        """`(n, points)` whether points of the scan lie beyond the edge of the field; None where it has none.

        Args:
            rows: `(n, size)` observations.
            starts: `(n, 2)` where the episodes began, m.
        """
        return self._beyond(rows, starts, self._offsets)

    def _beyond(self, rows: Array, starts: Array, points: Array) -> npt.NDArray[np.bool_] | None:
        """`(n, m)` whether points `(m, 2)` ahead and to the right of each trunk, m, lie beyond the field's edge."""
        if self._margin is None:
            return None
        places, headings = rows[:, [self._q, self._q + 2]], rows[:, self._q + 4, None]
        goals = rows[:, self._goal] * self._scale[self._goal]
        sine, cosine = sin_cos(headings)
        turn = np.concatenate((cosine, -sine), axis=1), np.concatenate((sine, cosine), axis=1)
        goals = places + goals[:, :1] * turn[0] + goals[:, 1:] * turn[1]
        low, high = np.minimum(starts, goals) - self._margin, np.maximum(starts, goals) + self._margin
        beyond = np.zeros((len(rows), len(points)), np.bool_)
        for k in (0, 1):
            at = places[:, k, None] + points[:, 0] * turn[0][:, k, None] + points[:, 1] * turn[1][:, k, None]
            beyond |= (at < low[:, k, None]) | (at > high[:, k, None])
        return beyond

    def _through_fence(self, row: Array, start: Array) -> Array | None:
        """`(n_arcs,)` further costs, m, of the first arcs that lead beyond the field's edge; None if none does."""
        beyond = self._beyond(row[None], start[None], self._ends)
        if beyond is None or not beyond.any():
            return None
        costs: Array = THROUGH_FENCE * self.reach * beyond[0]
        return costs

    def begin_arc(self, row: Array, command: Array, memory: ScanMemory, i: int) -> None:
        """Rover i begins to drive by a command: if it leads backward of its own accord, it backs off for a while."""
        if command[0] < 0.0 and memory.retreat[i] == 0.0:
            x, z, heading = (float(row[self._q + k]) for k in (0, 2, 4))
            memory.command[i, 0] = 1.0  # the way not to go
            self._back_off(memory, i, x, z, heading)

    def _ways(self, row: Array, slope: list[float], memory: ScanMemory, i: int) -> Array | None:
        """The way to the goal from each point of the scan over the remembered map, m, which then holds the scan."""
        if self._map is None:
            return None
        x, y, z, heading = (float(row[self._q + k]) for k in (0, 1, 2, 4))
        cells, corner = memory.ground[i], memory.corner[i]
        if memory.age[i] == 0:
            self._map.begin(cells, corner, (x, z))
        heights = row[self._heights] * self._scale[self._heights] + y
        self._map.remember(cells, corner, heights, (x, z), heading)
        if memory.age[i] // self.hold_periods % self._map.options.every == 0:
            ahead, right = (row[self._goal] * self._scale[self._goal]).tolist()
            sine, cosine = sin_cos(heading)
            memory.ways[i] = self._map.ways(
                self.search,
                cells,
                corner,
                heading=heading,
                goal=(x + ahead * cosine + right * sine, z - ahead * sine + right * cosine),
                slope=slope,
                boldness=self._caution * self._boldness(memory.fruitless[i]),
                traps=memory.known_traps(i),
            )
            memory.ways_corner[i] = corner
        return self._map.at_scan(memory.ways[i], memory.ways_corner[i], (x, z), heading)

    def fenced(self, row: Array, slope: list[float], start: Array) -> Array:
        """The scan's heights over the ground plane, m, with a fence where the field ends.

        Args:
            row: An observation `(size,)`.
            slope: Slope of the ground plane ahead and to the right.
            start: `(2,)` where the episode began, m.
        """
        heights = self._over_plane(row, slope)
        beyond = self.beyond_field(row[None], start[None])
        if beyond is not None:
            heights[beyond[0]] = FENCE * self.radius
        return heights

    def ground(self, row: Array) -> tuple[list[float], Array]:
        """Slope of the ground plane ahead and to the right, and the scan's heights over it, m, for an observation."""
        slope: list[float] = ground_slope(self._layout, row[None])[0].tolist()
        return slope, self._over_plane(row, slope)

    def _over_plane(self, row: Array, slope: list[float]) -> Array:
        """The scan's heights above the ground plane, m, so that a slope alone has no cost."""
        rise = slope[0] * self._offsets[:, 0] + slope[1] * self._offsets[:, 1]
        return row[self._heights] * self._scale[self._heights] - rise

    def _boldness(self, fruitless: float) -> float:
        """Factor on the cost of risks after a time without progress, s."""
        halvings = fruitless / (self.gains.courage * self.pace)
        return max(self.gains.least, float(exp(-math.log(2.0) * halvings)))

    def _outlook(
        self, row: Array, slope: list[float], heights: Array, boldness: float
    ) -> tuple[Array | None, npt.NDArray[np.bool_]]:
        """`(n_arcs,)` further costs of the first arcs, m, and whether they are driven fast."""
        if self.forecast is None:
            return None, np.zeros(len(self.arcs), np.bool_)
        costs, fast = self.foresight.price(self.forecast(row, slope, heights), boldness)
        return self._length / USUAL_WAY * costs, fast

    def _back_off(self, memory: ScanMemory, i: int, x: float, z: float, heading: float) -> None:
        """Remembers a trap where the rover was about to go, and that it shall drive the other way for a while."""
        direction = -1.0 if memory.command[i, 0] < 0.0 else 1.0
        sine, cosine = sin_cos(heading)
        ahead = TRAP_AHEAD * self.reach * direction
        longer = 1.0 + memory.fruitless[i] / (self.gains.insistence * self.pace)
        trap, time = (x + ahead * cosine, z - ahead * sine, heading), self.gains.retreat * self.pace * longer
        memory.back_off(trap, -direction, time, i)


def hold_periods(period: float, dt: float) -> int:
    """Control periods of dt, s, between decisions."""
    return max(1, round(period / dt))


def _reach(model: RoverModel) -> float:
    """The largest distance of a wheel's edge from the trunk's origin, seen from above, m."""
    return float((np.hypot(*wheel_centres(model).T) + model.wheel_radii).max())


def _top_speed(model: RoverModel) -> float:
    """The speed at which the slowest motor has no torque left, m/s; infinite without such a limit."""
    wheels = zip(model.to_dict()["wheels"], model.wheel_radii.tolist(), strict=True)
    tops = (wheel["motor"]["no_load_speed"] * radius for wheel, radius in wheels if wheel.get("motor"))
    return min(tops, default=math.inf)


def _limits(rover: RoverEnv, turning: Turning, gains: ScanGains) -> CommandLimits:
    """The commands' limits: what the motors and the steering can follow."""
    return CommandLimits(
        speed=max(gains.push, gains.speed),
        curvature=min(turning.max_curvature(rover.max_steering), turning.max_curvature_at(gains.speed), MAX_CURVATURE),
        sideways_deg=max(1.0, min(MAX_SIDEWAYS_DEG, 0.9 * math.degrees(rover.max_steering))),
        response=gains.response,
    )


def _arcs(rover: RoverEnv, turning: Turning, limits: CommandLimits) -> tuple[Arcs, Arcs]:
    """Arcs for the first and the following segments. Only a rover that steers all wheels drives sideways."""
    steered = [i for i, entry in enumerate(turning.steering.entries) if entry >= 0]
    side = math.radians(limits.sideways_deg) if len(steered) == len(turning.wheels) else 0.0

    def spread(n: int, most: float) -> Array:
        return np.linspace(-most, most, n) if most > 0.0 else np.zeros(1)

    bend = limits.curvature
    first = Arcs.grid(spread(9, bend), spread(5, side), 1.0).joined(Arcs.grid(spread(5, bend), spread(3, side), -1.0))
    further = Arcs.grid(spread(7, bend), spread(3, side), 1.0).joined(Arcs.grid(spread(3, bend), [0.0], -1.0))
    wheels = np.array(turning.wheels)[steered]
    return first.within(rover.max_steering, wheels), further.within(rover.max_steering, wheels)
