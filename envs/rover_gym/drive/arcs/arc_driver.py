"""Drives rovers by the planner's arcs: the table of arcs, what a policy observes, and the planner's memory.

An action is an arc of `ScanPolicy` at cruising speed or pushing. Curvature and sideways motion are relative to what the
rover can steer, so that the same table serves every rover. Lengths in the observation are relative to the rover's
reach, heights to its wheel radius: a policy sees every rover in its own measure.
"""

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import CommandError, OptionError, sin_cos
from rover_gym.core.validation import array, refuse
from rover_gym.drive.commands.command import N_COMMANDS, CommandController, Step
from rover_gym.drive.commands.features import ground_slope
from rover_gym.drive.forecast.rover_view import LARGEST, N_FEATURES, RoverView
from rover_gym.drive.scan.scan_policy import SCAN, ScanMemory, ScanPolicy, scan_grid
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.rover_env import RoverEnv

#: Direction, curvature and sideways motion of the arcs, over their limits: those of a rover that steers all wheels.
ARCS: Array = np.array(
    [
        (1.0, kappa, beta)
        for kappa, most in zip(np.linspace(-1.0, 1.0, 9), (0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0), strict=True)
        for beta in np.linspace(-1.0, 1.0, 5)
        if abs(beta) <= most
    ]
    + [
        (-1.0, kappa, beta)
        for kappa, most in zip(np.linspace(-1.0, 1.0, 5), (0.0, 0.0, 1.0, 0.0, 0.0), strict=True)
        for beta in (-1.0, 0.0, 1.0)
        if abs(beta) <= most
    ]
)

#: Actions: each arc at cruising speed, then each while pushing.
N_ARCS = 2 * len(ARCS)

#: Traps that are observed, the last ones, and the farthest, in reaches.
SEEN_TRAPS, FARTHEST_TRAP = 3, 4.0

ArcObservation = dict[str, npt.NDArray[np.float32]]

#: Sizes of the observation's parts beside the scan.
SIZES = {"features": N_FEATURES, "command": N_COMMANDS, "clocks": 5 + 3 * SEEN_TRAPS}


def observation_space() -> gym.spaces.Dict:
    """The space of one rover's observations, the same for every rover."""
    rows, columns, _ = SCAN
    parts: dict[str, gym.Space[Any]] = {
        "scan": gym.spaces.Box(-LARGEST, LARGEST, (rows, columns), np.float32),
        **{name: gym.spaces.Box(-LARGEST, LARGEST, (size,), np.float32) for name, size in SIZES.items()},
    }
    return gym.spaces.Dict(parts)


def arc_space() -> "gym.spaces.Discrete":
    """The space of the arcs."""
    return gym.spaces.Discrete(N_ARCS)


def arc_of(command: npt.ArrayLike, *, pushes: bool) -> int:
    """The action nearest to a direction, curvature and sideways motion `(3,)`, in [-1, 1]."""
    apart = ((ARCS - np.asarray(command, np.float64)) ** 2 * [4.0, 1.0, 1.0]).sum(axis=1)
    return int(np.argmin(apart)) + len(ARCS) * bool(pushes)


class ArcDriver:
    """Drives n rovers of one kind by arcs.

    Args:
        rover: An environment with the height scan of `ScanPolicy.arguments`, read once.
        n: Number of rovers.
        planner: A planner for the rover, whose limits and memory it shares; a new `ScanPolicy` by default.

    Attributes:
        planner: The planner.
        hold: Control periods that an arc is held.
        memory: What the planner remembers of each rover.
    """

    def __init__(self, rover: RoverEnv, n: int, planner: ScanPolicy | None = None) -> None:
        scan = scan_grid(rover)
        if (scan.rows, scan.columns) != SCAN[:2]:
            given = (scan.rows, scan.columns, scan.spacing)
            refuse(OptionError, "height_scan", given, f"must be that of ScanPolicy.arguments(model), {SCAN[:2]} points")
        self.planner = ScanPolicy(rover) if planner is None else planner
        plan = self.planner
        self.hold = plan.hold_periods
        self.memory = ScanMemory.of(None, n)
        self.controller: CommandController = plan.controller
        speeds = np.repeat([plan.cruise, plan.push], len(ARCS))[:, None]
        self.commands = np.concatenate((ARCS, ARCS)) * np.concatenate((speeds, np.ones((N_ARCS, 2))), axis=1)
        layout = rover.observation_layout
        self._layout, self._scale, self._shape = layout, layout.scale, SCAN[:2]
        self._offsets = scan_grid(rover).offsets
        self._view = RoverView(rover, plan)

    # -- memory

    def begin(self, rovers: Mask) -> None:
        """Forgets what is remembered of rovers `(n,)`."""
        self.memory.forget(rovers)

    def notice(self, seen: Observations, rovers: Mask) -> None:
        """Counts the times of rovers `(n,)` up to their observations `(n, size)`."""
        for i in np.flatnonzero(rovers).tolist():
            self.planner.notice(seen[i].astype(np.float64), self.memory, i)

    def choose(self, seen: Observations, arcs: npt.NDArray[np.integer], rovers: Mask) -> None:
        """Rovers `(n,)` begin to drive along arcs `(n,)`."""
        for i in np.flatnonzero(rovers).tolist():
            command = self.commands[int(arcs[i])]
            self.planner.begin_arc(seen[i].astype(np.float64), command, self.memory, i)
            self.memory.command[i] = command
        self.memory.age[rovers] += self.hold

    # -- actions

    def drive(self, seen: Observations, moved: Mask, step: Step) -> tuple[Observations, Array, Mask, Mask]:
        """Holds the arcs of rovers `(n,)`, or until an episode ends; as `CommandController.hold`."""
        return self.controller.hold(seen, self.memory.command, self.hold, moved, step)

    def expert(self, seen: Observations, rovers: Mask, teacher: ScanPolicy | None = None) -> npt.NDArray[np.int64]:
        """`(n,)` the arcs that a planner would choose for rovers `(n,)`, 0 for the others. By default its own."""
        plan = self.planner if teacher is None else teacher
        labels = np.zeros(len(seen), np.int64)
        slopes = ground_slope(self._layout, seen)
        for i in np.flatnonzero(rovers).tolist():
            arc, pushes = plan.choose(seen[i].astype(np.float64), slopes[i].tolist(), self.memory, i)
            labels[i] = arc_of(plan.commands[arc], pushes=pushes)
        return labels

    # -- observations

    def observe(self, seen: Observations) -> ArcObservation:
        """What a policy observes of each rover, from observations `(n, size)`."""
        rows = seen.astype(np.float64)
        layout, plan, memory, n = self._layout, self.planner, self.memory, len(seen)
        slope = ground_slope(layout, rows)
        rise = slope[:, :1] * self._offsets[:, 0] + slope[:, 1:] * self._offsets[:, 1]
        heights = rows[:, layout["height_scan"]] * self._scale[layout["height_scan"]] - rise - self._view.level
        heights = (heights / plan.radius).clip(-LARGEST, LARGEST)
        beyond = plan.beyond_field(rows, memory.start)
        if beyond is not None:
            heights[beyond] = LARGEST
        scan = heights.reshape(n, *self._shape)
        return {
            "scan": scan.astype(np.float32),
            "features": self._view(rows, slope),
            "command": memory.command.astype(np.float32),
            "clocks": self._clocks(rows).clip(-LARGEST, LARGEST).astype(np.float32),
        }

    def _clocks(self, rows: Array) -> Array:
        """`(n, 5 + 3 SEEN_TRAPS)` the planner's times, and the last places where a rover got stuck."""
        memory, plan, n = self.memory, self.planner, len(rows)
        gains, pace = plan.gains, plan.pace
        clocks = np.zeros((n, SIZES["clocks"]))
        clocks[:, 0] = memory.still / (gains.patience * pace)
        clocks[:, 1] = np.minimum(memory.fruitless / (gains.courage * pace), LARGEST)
        clocks[:, 2] = memory.retreat / (gains.retreat * pace)
        clocks[:, 3] = memory.away * (memory.retreat > 0.0)
        clocks[:, 4] = np.minimum(memory.n_traps, 10) / 5.0
        q, number = self._layout["q"].start, np.arange(n)
        sine, cosine = sin_cos(rows[:, q + 4])
        for k in range(SEEN_TRAPS):
            last = memory.n_traps - 1 - k
            trap = memory.traps[number, last % memory.traps.shape[1]]
            dx, dz = ((trap[:, :2] - rows[:, [q, q + 2]]) / plan.reach).T
            ahead, right = dx * cosine - dz * sine, dx * sine + dz * cosine
            near = (last >= 0) & (ahead * ahead + right * right < FARTHEST_TRAP * FARTHEST_TRAP)
            clocks[:, 5 + 3 * k : 8 + 3 * k] = np.where(near[:, None], np.stack((near, ahead, right), axis=1), 0.0)
        return clocks


def check_arcs(actions: object, n: int) -> npt.NDArray[np.int64]:
    """Checks arcs `(n,)`.

    Raises:
        CommandError: They are not n whole numbers from 0 to 63.
    """
    arcs = array("action", actions, error=CommandError)
    if arcs.shape != (n,):
        refuse(CommandError, "action", arcs.shape, f"must have shape {(n,)}")
    if not ((arcs >= 0) & (arcs < N_ARCS) & (arcs == np.floor(arcs))).all():
        refuse(CommandError, "action", actions, f"must be whole numbers from 0 to {N_ARCS - 1}")
    return arcs.astype(np.int64)
