"""Drives rovers by the planner's arcs: the table of arcs, what a policy observes, and the planner's memory.

An action is an arc of `ScanPolicy` at cruising speed or pushing. Curvature and sideways motion are relative to what the
rover can steer, so that the same table serves every rover. Lengths in the observation are relative to the rover's
reach, heights to its wheel radius: a policy sees every rover in its own measure.
"""

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.observation import Array, Mask, Observations
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import drive_signs, wheel_centres
from rover_gym.mechanics import CommandError, Plane, RoverModel, exp, sin_cos
from rover_gym.policy.command import N_COMMANDS, CommandController
from rover_gym.policy.features import ground_slope
from rover_gym.policy.scan_policy import SCAN, ScanMemory, ScanPolicy, scan_grid
from rover_gym.validation import array, refuse

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

#: Entries are clipped to this.
LARGEST = 5.0

#: Traps that are observed, the last ones, and the farthest, in reaches.
SEEN_TRAPS, FARTHEST_TRAP = 3, 4.0

#: Places of wheels, three on each side, and what is observed of the wheels at each: contact, load, traction, rim speed,
#: steering.
PLACES, OF_A_WHEEL = 6, 5

#: Steps of the rover: applies actions to the active rovers, with or without the height scan. Returns observations,
#: rewards, and which episodes have ended or reached their time limit.
Step = Callable[[Observations, Mask, bool], tuple[Observations, Array, Mask, Mask]]

ArcObservation = dict[str, npt.NDArray[np.float32]]

#: Sizes of the observation's parts beside the scan.
SIZES = {"features": 29 + PLACES * OF_A_WHEEL, "command": N_COMMANDS, "clocks": 5 + 3 * SEEN_TRAPS}


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
        self.planner = ScanPolicy(rover) if planner is None else planner
        plan = self.planner
        self.hold = plan.hold_periods
        self.memory = ScanMemory.of(None, n)
        self.controller: CommandController = plan.controller
        speeds = np.repeat([plan.cruise, plan.push], len(ARCS))[:, None]
        self.commands = np.concatenate((ARCS, ARCS)) * np.concatenate((speeds, np.ones((N_ARCS, 2))), axis=1)
        layout, model = rover.observation_layout, rover.model
        self._layout, self._scale, self._shape = layout, layout.scale, SCAN[:2]
        self._offsets = scan_grid(rover).offsets
        self._level = -float(model.resting_pose(Plane(), (0.0, 0.0), 0.0)[1])
        self._rover = _measures(rover, plan, self._level)
        self._wheels = _Wheels(rover, plan.cruise_speed)

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
        """Holds the arcs of rovers `(n,)`, or until an episode ends.

        Returns:
            The last observations `(n, size)`, sums of the rewards, and which episodes have ended or reached their time
            limit.
        """
        active, rewards = moved.copy(), np.zeros(len(moved))
        terminated, truncated = np.zeros_like(moved), np.zeros_like(moved)
        for left in reversed(range(self.hold)):
            if not active.any():
                break
            actions = self.controller.act(seen, self.memory.command)
            seen, earned, ended, timed_out = step(actions, active, left == 0)
            rewards[active] += earned[active]
            terminated |= ended & active
            truncated |= timed_out & active
            active &= ~(terminated | truncated)
        return seen, rewards, terminated, truncated

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
        heights = rows[:, layout["height_scan"]] * self._scale[layout["height_scan"]] - rise - self._level
        heights = (heights / plan.radius).clip(-LARGEST, LARGEST)
        beyond = plan.beyond_field(rows, memory.start)
        if beyond is not None:
            heights[beyond] = LARGEST
        scan = heights.reshape(n, *self._shape)

        q, velocity = layout["q"].start, layout["velocity"].start
        speeds = rows[:, velocity : velocity + 6] / ([plan.cruise_speed] * 3 + [1.0] * 3)
        goal = rows[:, layout["goal"]] * self._scale[layout["goal"]]
        distance = np.sqrt((goal**2).sum(axis=1))
        toward = goal / np.maximum(distance, 1e-3)[:, None]
        away = distance / plan.reach
        parts = [
            rows[:, [q + 3, q + 5]] * 2.0,
            slope * 3.0,
            speeds,
            rows[:, layout["stuck"]],
            toward,
            np.stack((np.minimum(away / 10.0, 3.0), exp(-away), exp(-0.2 * away)), axis=1),
            np.broadcast_to(self._rover, (n, len(self._rover))),
            self._wheels(rows),
        ]
        features = np.concatenate(parts, axis=1).clip(-LARGEST, LARGEST)
        return {
            "scan": scan.astype(np.float32),
            "features": features.astype(np.float32),
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


def _measures(rover: RoverEnv, plan: ScanPolicy, level: float) -> Array:
    """The rover itself: its measures over its reach, its speed, traction, mass and the height of its mass centre."""
    model: RoverModel = rover.model
    centres, reach = wheel_centres(model), plan.reach
    weight = model.mass * math.hypot(*rover.gravity)
    limits, controller = plan.controller.limits, plan.controller
    pull = float((model.wheel_torque_limits / model.wheel_radii).sum()) / weight
    radius = plan.radius
    return np.array(
        [
            float(np.ptp(centres[:, 0])) / reach,
            float(np.ptp(centres[:, 1])) / reach,
            3.0 * radius / reach,
            plan.clearance / radius,
            len(centres) / 6.0,
            limits.curvature * reach,
            float(bool(controller.steers_sideways)),
            float(bool(rover.task.steering.joints)),
            plan.cruise_speed / reach,
            math.log10(model.mass) - 2.0,
            math.log(pull),
            math.log(reach),
            float(model.tags(np.zeros(model.nq))["centre_of_mass"][1] - level) / reach,
        ]
    )


class _Wheels:
    """What is observed of the wheels: means over those at the front, in the middle and at the rear of each side."""

    def __init__(self, rover: RoverEnv, speed: float) -> None:
        layout, model = rover.observation_layout, rover.model
        joints = list(model.wheel_joint_indices)
        centres = wheel_centres(model)
        middle, span = 0.5 * (centres[:, 0].max() + centres[:, 0].min()), max(1e-6, float(np.ptp(centres[:, 0])))
        along = (centres[:, 0] - middle) / span
        place = np.where(along > 0.25, 0, np.where(along < -0.25, 2, 1)) + 3 * (centres[:, 1] > 0.0)
        members = (np.arange(PLACES)[:, None] == place).astype(np.float64)
        self._share = members / np.maximum(members.sum(axis=1, keepdims=True), 1.0)
        self._contact, self._load = layout["wheel_contact"], layout["normal_force"]
        rolling = layout["tangential_force"]
        self._traction = slice(rolling.start, rolling.stop, 2)
        self._rates = layout["velocity"].start + np.asarray(joints, np.intp)
        self._rim = model.wheel_radii * drive_signs(model) * layout.scale[self._rates] / speed
        q, steering = layout["q"].start, rover.task.steering
        steered = [steering.joints[entry] if entry >= 0 else 0 for entry in steering.entries]
        self._joints = q + np.array(steered, np.intp)
        self._steered = np.array([float(entry >= 0) for entry in steering.entries])

    def __call__(self, rows: Array) -> Array:
        """`(n, PLACES * OF_A_WHEEL)`; zeros at a place without a wheel."""
        of_wheels = (
            rows[:, self._contact],
            0.5 * rows[:, self._load].clip(0.0, 6.0),
            0.5 * rows[:, self._traction].clip(-6.0, 6.0),
            (self._rim * rows[:, self._rates]).clip(-3.0, 3.0),
            self._steered * rows[:, self._joints],
        )
        # Sums wheel by wheel: the same bits for any number of rovers.
        means = [(values[:, None, :] * self._share).sum(axis=2) for values in of_wheels]
        return np.concatenate(means, axis=1)
