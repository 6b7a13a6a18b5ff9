"""A policy that plans with the simulator itself: sampling-based model-predictive control of commands.

Every `period` seconds it samples command sequences, simulates a copy of the rover under each for `horizon` seconds, and
adds the cost-to-go of a `FieldPlan` at the end of each. The next round samples around the mean of the best tenth
(cross-entropy method, Rubinstein 1999). The first command of the cheapest sequence is executed.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, OptionError, StateError
from rover_gym.core.extras import require
from rover_gym.core.validation import array, number, refuse, vector, whole
from rover_gym.drive.commands.command import N_COMMANDS, CommandController, CommandLimits
from rover_gym.drive.commands.driven import check_observed, driven_rover, given_or_usual
from rover_gym.drive.planning.rollouts import Ends, Rollouts
from rover_gym.drive.scan.scan_policy import PLAN_POINTS, scan_grid
from rover_gym.drive.search.field_plan import FieldPlan
from rover_gym.drive.search.ground_map import MOST_CELLS, GroundMap, MapOptions
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import Point, Start
from rover_gym.ground.maps.ground_lookup import TerrainLike, as_terrain
from rover_gym.models.lookup import ModelLike

Array = npt.NDArray[np.float64]

#: How far the map goes beyond the goal on all sides, m.
MARGIN = 4.0


class ScannedGround:
    """A map of heights that grows with each height scan.

    Args:
        env: The environment, with a height scan, after its reset: the map reaches as far from the rover as its goal
            does, and `MARGIN` farther.

    Raises:
        OptionError: The environment has no height scan.
        MissingExtraError: SciPy is not installed.
    """

    def __init__(self, env: RoverEnv) -> None:
        self._ndimage = require("scipy.ndimage", "planning")
        scan, layout = scan_grid(env), env.observation_layout
        self._heights, self._q = layout["height_scan"], layout["q"].start
        self._scale = layout.scale
        place = env.simulation.q[[0, 2]]
        reach = float(np.hypot(*(np.array(env.goal) - place))) + MARGIN
        cells = int(np.ceil(2.0 * reach / scan.spacing))
        if cells > MOST_CELLS:
            refuse(
                OptionError,
                "height_scan",
                scan.spacing,
                f"gives a map with {cells} cells on each side, at most {MOST_CELLS} are allowed",
            )
        self._map = GroundMap(scan, MapOptions(cells=cells), 1.0)
        self._cells = np.zeros((cells, cells), np.float32)
        self._corner = np.zeros(2, np.int64)
        self._map.begin(self._cells, self._corner, (float(place[0]), float(place[1])))

    def see(self, observation: npt.NDArray[np.floating[Any]]) -> None:
        """Writes the scan of an observation `(size,)` into the map."""
        seen = observation.astype(np.float64)
        x, y, z, heading = (float(seen[self._q + k]) for k in (0, 1, 2, 4))
        heights = seen[self._heights] * self._scale[self._heights] + y
        self._map.remember(self._cells, self._corner, heights, (x, z), heading)

    @property
    def terrain(self) -> HeightField:
        """The map as ground; what was not seen is as high as the nearest place that was."""
        unknown = np.isnan(self._cells)
        nearest = self._ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
        spacing = self._map.cell
        corner = (float(self._corner[0] * spacing), float(self._corner[1] * spacing))
        return HeightField(self._cells[tuple(nearest)].T, spacing, corner)


#: Torques of the steady sequences, over that at which a wheel pulls with its share of the weight: forward, hard
#: forward, backward, none.
LEVELS = (0.1, 0.4, -0.2, 0.0)

#: Curvature and sideways direction of the steady sequences, within [-1, 1].
TURNS = ((-1.0, 0.0), (-0.5, 0.0), (0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, -0.7), (0.0, 0.7))


class RawActions:
    """Takes the place of a `CommandController`: what it is given are the actions.

    Args:
        env: The environment, read once.
        controller: Gives the set-points that suit a turn.
        spread: Standard deviations of torques, over that at which a wheel pulls with its share of the weight, and of
            set-points, over the steering limit.

    Attributes:
        spread: `(n_actions,)` standard deviations of the entries.
        library: `(n, n_actions)` actions of steady sequences.
    """

    def __init__(self, env: RoverEnv, controller: CommandController, spread: tuple[float, float]) -> None:
        task, model = env.task, env.model
        n, n_wheels = task.n_actions, len(model.wheel_names)
        weight = model.mass * math.hypot(*env.gravity)
        share = (weight / n_wheels * model.wheel_radii / model.wheel_torque_limits).clip(0.0, 1.0)
        self.spread = np.full(n, spread[1])
        self.spread[:n_wheels] = spread[0] * share
        commands = np.zeros((len(TURNS), N_COMMANDS))
        commands[:, 1:] = TURNS
        turns = controller.act(np.zeros((len(TURNS), task.layout.size)), commands).astype(np.float64)
        self.library = np.tile(turns, (len(LEVELS), 1))
        self.library[:, :n_wheels] = np.repeat(LEVELS, len(TURNS))[:, None] * share

    def act(self, _observations: npt.NDArray[Any], actions: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """The actions `(n, n_actions)`."""
        clipped: npt.NDArray[np.float32] = np.clip(actions, -1.0, 1.0).astype(np.float32)
        return clipped


@dataclass(frozen=True)
class PlannerOptions:
    """Sampling and costs of `PlannerPolicy`.

    Attributes:
        samples: Sequences per round.
        iterations: Rounds per planning, each around the best of the previous round.
        horizon: Length of a roll-out, s.
        knot: How long a command of the sequence is held, s.
        period: Time between plannings, s.
        actions: What is sampled: "commands", or "raw" actions, wheel torques and steering set-points.
        spread: Standard deviations of the samples of speed, curvature and sideways direction, each within [-1, 1].
        raw_spread: Standard deviations of wheel torques, relative to the torque at which a wheel pulls with its share
            of the weight, and of steering set-points, relative to the steering limit.
        energy_price: Cost of a joule, in metres of good ground.
        time_price: Cost of a second, in metres of good ground.
        failure_price: Cost of a failed episode, in metres of good ground.
        time_step: Largest physics step of the roll-outs, s.
    """

    samples: int = 40
    iterations: int = 2
    horizon: float = 2.4
    knot: float = 0.6
    period: float = 0.3
    actions: Literal["commands", "raw"] = "commands"
    spread: tuple[float, float, float] = (0.4, 0.5, 0.4)
    raw_spread: tuple[float, float] = (0.2, 0.3)
    energy_price: float = 2e-4
    time_price: float = 0.1
    failure_price: float = 20.0
    time_step: float = 0.025

    def __post_init__(self) -> None:
        whole("samples", self.samples, at_least=2, at_most=100_000)
        whole("iterations", self.iterations, at_least=1, at_most=100)
        for name in ("horizon", "knot", "period", "time_step"):
            number(name, getattr(self, name), at_least=1e-3, at_most=1e3)
        for name in ("energy_price", "time_price", "failure_price"):
            number(name, getattr(self, name), at_least=0.0)
        for value in vector("spread", self.spread, N_COMMANDS):
            number("spread", value, at_least=0.0)
        for value in vector("raw_spread", self.raw_spread, 2):
            number("raw_spread", value, at_least=0.0)
        if self.actions not in ("commands", "raw"):
            refuse(OptionError, "actions", self.actions, "must be 'commands' or 'raw'")


class PlannerPolicy:
    """Drives a `RoverEnv` by planning in copies of it; `predict` is stable-baselines3's.

    It reads the environment's state and ground, which is privileged information. To study model errors, `model`,
    `friction` and `terrain` change the copies and not the environment.

    Args:
        env: A `Rover-v0`, wrapped or not; not a vector.
        options: Sampling and costs.
        limits: The values of a command of 1.
        seed: Of the samples.
        threads: Threads that step the roll-outs; None for one per core.
        model: The rover of the roll-outs, see `Rollouts`.
        friction: Friction of the roll-outs, see `Rollouts`.
        terrain: The ground of the roll-outs and of the field's plan, or its file; the episode's by default.
        sees: "field" for the whole ground, or "scan" for the ground covered by the height scans so far. Unseen ground
            gets the height of the nearest seen place.

    Raises:
        OptionError: An argument is out of its range, or the environment has no height scan to see by.
        MissingExtraError: SciPy is not installed.
    """

    def __init__(
        self,
        env: Any,
        options: PlannerOptions | None = None,
        *,
        limits: CommandLimits | None = None,
        seed: int = 0,
        threads: int | None = None,
        model: ModelLike | None = None,
        friction: float | None = None,
        terrain: TerrainLike | None = None,
        sees: Literal["field", "scan"] = "field",
    ) -> None:
        if sees not in ("field", "scan"):
            refuse(OptionError, "sees", sees, "must be 'field' or 'scan'")
        if sees == "scan" and terrain is not None:
            refuse(OptionError, "terrain", terrain, "must not be given with sees='scan'")
        self.options = given_or_usual("options", options, PlannerOptions)
        self._env: RoverEnv = driven_rover(env, type(self).__name__)
        if self._env.batch.n > 1:
            refuse(OptionError, "env", env, "must be a single environment: PlannerPolicy reads its simulation")
        commands = CommandController(self._env, limits)
        self._controller: CommandController | RawActions = commands
        self._spread = np.array(self.options.spread)
        if self.options.actions == "raw":
            self._controller = raw = RawActions(self._env, commands, self.options.raw_spread)
            self._spread = raw.spread
        self._rollouts: Rollouts | None = None
        self._make_rollouts = partial(
            Rollouts,
            self._env,
            self.options.samples,
            time_step=self.options.time_step,
            threads=threads,
            model=model,
            friction=friction,
        )
        self._terrain = None if terrain is None else as_terrain("terrain", terrain)
        self._seen: ScannedGround | None = None
        if sees == "scan":
            scan_grid(self._env)
        self._sees_scan = sees == "scan"
        self._random = np.random.default_rng(whole("seed", seed, at_least=0))
        self._hold = max(1, round(self.options.knot / self._env.dt))
        self._knots = max(1, math.ceil(self.options.horizon / (self._hold * self._env.dt) - 1e-9))
        self._periods = max(1, round(self.options.period / self._env.dt))
        self._start: Start | None = None
        self._goal: Point | None = None
        self._field: FieldPlan | None = None
        self._sequence: Array = np.zeros((self._knots, len(self._spread)))
        self._since = 0
        self._library = _library(self._knots)
        if isinstance(self._controller, RawActions):
            self._library = np.repeat(self._controller.library[:, None], self._knots, axis=1)

    def predict(
        self,
        observation: npt.NDArray[np.float32],
        state: tuple[npt.NDArray[Any], ...] | None = None,
        episode_start: npt.NDArray[np.bool_] | None = None,  # noqa: ARG002 - the signature is stable-baselines3's
        deterministic: bool = True,  # noqa: ARG002 - as above
    ) -> tuple[npt.NDArray[np.float32], tuple[npt.NDArray[Any], ...] | None]:
        """The action for the environment's last observation `(size,)`.

        A new episode is noticed by its start. `state` is returned unchanged.

        Raises:
            StateError: The observation is not `(size,)`, or has an entry that is not finite; nothing was planned.
        """
        seen = array("observation", observation, error=StateError)
        if seen.ndim != 1:
            refuse(StateError, "observation", seen.shape, "must be the observation of a single environment")
        check_observed(seen, self._env.task.layout.size)
        begins, due = self._env.start is not self._start, self._since % self._periods == 0
        if self._sees_scan and (begins or due):
            self._look(seen, begins)
        if begins:
            self._begin()
        elif self._env.goal != self._goal or (self._sees_scan and due):
            self._aim()
        if self._since % self._periods == 0:
            self._plan()
        self._since += 1
        action = self._controller.act(seen[None].astype(np.float32), self._sequence[:1])
        return action[0], state

    def plan_command(self, observation: npt.NDArray[np.floating[Any]]) -> tuple[float, float, float]:
        """Plans anew from the environment's last observation `(size,)`.

        Returns:
            The first command: speed, m/s, curvature, 1/m, and direction of travel off the trunk's x axis, rad.

        Raises:
            OptionError: Raw actions are planned.
        """
        controller = self._controller
        if isinstance(controller, RawActions):
            refuse(OptionError, "actions", "raw", "must be 'commands' to plan a command")
        begins = self._env.start is not self._start
        if self._sees_scan:
            self._look(np.asarray(observation, np.float64), begins)
        if begins:
            self._begin()
        elif self._env.goal != self._goal or self._sees_scan:
            self._aim()
        self._plan()
        self._since = self._periods
        speed, curvature, sideways = self._sequence[0].tolist()
        limits = controller.limits
        return (
            speed * limits.speed,
            curvature * limits.curvature,
            sideways * math.radians(limits.sideways_deg),
        )

    def plan(self, state: tuple[npt.NDArray[Any], ...] | None = None) -> Array | None:  # noqa: ARG002 - as `predict`
        """`(points, 2)` the path of the commands to come, ahead and to the right of the trunk, m; None of raw actions.

        The path is that of wheels that do not slip.
        """
        if isinstance(self._controller, RawActions) or self._field is None:
            return None
        limits, dt = self._controller.limits, self._env.dt
        done = (self._since - 1) % self._periods
        speed, turning, aside = np.repeat(self._sequence, self._hold, axis=0)[done:].T
        steps = dt * limits.speed * speed
        heading = np.cumsum(limits.curvature * turning * steps) + math.radians(limits.sideways_deg) * aside
        way = np.cumsum(np.stack((steps * np.cos(heading), -steps * np.sin(heading)), axis=1), axis=0)
        chosen = np.linspace(0, len(way) - 1, PLAN_POINTS - 1).round().astype(int)
        return np.concatenate((np.zeros((1, 2)), way[chosen]))

    def _look(self, seen: Array, begins: bool) -> None:
        """Adds the height scan of an observation to the map."""
        if self._seen is None or begins:
            self._seen = ScannedGround(self._env)
        self._seen.see(seen)
        self._terrain = self._seen.terrain

    def _begin(self) -> None:
        self._aim()
        self._rollouts = self._make_rollouts()
        self._start, self._since = self._env.start, 0
        self._sequence = np.zeros_like(self._sequence)
        if not isinstance(self._controller, RawActions):
            self._sequence[:, 0] = 1.0

    def _aim(self) -> None:
        """Plans over the field to the present goal, the next of a course where the last one is reached."""
        simulation = self._env.simulation
        terrain = simulation.terrain if self._terrain is None else self._terrain
        self._goal = self._env.goal
        self._field = FieldPlan.over(terrain, self._env.model, simulation.q[[0, 2]], self._goal)

    def _plan(self) -> None:
        """Draws, drives and judges roll-outs; keeps the sequence that the rover follows."""
        options = self.options
        rollouts, field = self._rollouts, self._field
        assert rollouts is not None and field is not None  # noqa: PT018, S101 - `_begin` made them
        mean = self._shifted()
        fixed = np.concatenate((mean[None], self._library))[: options.samples]
        for _ in range(options.iterations):
            drawn = mean + self._random.normal(size=(options.samples - len(fixed), *mean.shape)) * self._spread
            plans = np.clip(np.concatenate((fixed, drawn)), -1.0, 1.0)
            costs = self._costs(rollouts.drive(self._controller, plans, self._hold, self._terrain), field)
            order = np.argsort(costs, kind="stable")
            mean = plans[order[: max(1, options.samples // 10)]].mean(axis=0)
            fixed = np.stack((plans[order[0]], mean))
        self._sequence = plans[order[0]]

    def _shifted(self) -> Array:
        """The last sequence, begun later by the time that has passed since."""
        passed = min(self._since, self._periods) / self._hold
        at = np.minimum(np.arange(self._knots) + passed, self._knots - 1)
        return np.asarray(self._sequence[np.rint(at).astype(int)])

    def _costs(self, ends: Ends, field: FieldPlan) -> Array:
        """(n,) what each roll-out costs, in metres of good ground."""
        options = self.options
        rest = np.where(ends.reached, 0.0, field.cost_to_go(ends.place))
        rest[~np.isfinite(rest)] = options.failure_price
        return np.asarray(
            rest
            + options.time_price * ends.time
            + options.energy_price * ends.energy
            + options.failure_price * np.where(ends.failed, 1.0, ends.stuck)
        )


def _library(knots: int) -> Array:
    """(n, knots, 3) sequences of one command each, forward and backward, and back followed by forward."""
    turns = [(k, s) for k in (-1.0, -0.5, 0.0, 0.5, 1.0) for s in (-0.7, 0.0, 0.7)]
    steady = [[(v, k, s)] * knots for v in (1.0, -1.0) for k, s in turns]
    half = (knots + 1) // 2
    around = [[(-1.0, -k, s)] * half + [(1.0, k, s)] * (knots - half) for k in (-1.0, 0.0, 1.0) for s in (-0.7, 0.7)]
    return np.array(steady + around)
