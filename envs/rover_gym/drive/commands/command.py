"""Drives rovers by three numbers: speed, curvature and sideways direction; vectorised over rovers.

A command sets the motion of the point in the middle of the wheelbase: speed `v` in a direction `beta` off the trunk's
x axis, while the trunk turns by `kappa` per metre of path; `beta` and `kappa` are positive to the left. This is the
twist (cos(beta), sin(beta), kappa) times `v`, and the wheels' angles and rim speeds are those of
`rover_gym.drive.commands.wheel_kinematics`. With beta = 0 these are `PDPolicy`'s formulas. The torques come from the
same wheel regulator, `rover_gym.drive.commands.regulator`, with a feedforward of the force that holds the rover on a
slope.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core import atan2, sin_cos
from rover_gym.core.validation import number
from rover_gym.drive.commands.driven import given_or_usual
from rover_gym.drive.commands.regulator import YAW, WheelRegulator
from rover_gym.drive.commands.turning import SCRUB_RATE, WIDENING, Turning
from rover_gym.drive.commands.wheel_kinematics import WheelKinematics, wheel_velocities
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.rover_env import RoverEnv

#: Entries of a command: speed, curvature, sideways.
N_COMMANDS = 3

#: Applies actions to rovers `(n,)`, of which some are active, with or without the height scan. Returns observations,
#: rewards, and which episodes have ended or reached their time limit.
Step = Callable[[Observations, Mask, bool], tuple[Observations, Array, Mask, Mask]]


def command_space() -> "gym.spaces.Box[np.float32]":
    """The space of the commands of one rover."""
    return gym.spaces.Box(-1.0, 1.0, (N_COMMANDS,), np.float32)


@dataclass(frozen=True)
class CommandLimits:
    """The values of a command of 1, and the time constant of the wheel regulator.

    Attributes:
        speed: Speed, m/s.
        curvature: Curvature of the path, 1/m.
        sideways_deg: Direction of travel off the trunk's x axis, degrees.
        response: Time constant of the rover's speed, s; see `WheelRegulator`.
    """

    speed: float = 1.2
    curvature: float = 0.75
    sideways_deg: float = 35.0
    response: float = 0.1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(f"command.{name}", value, at_least=1e-3, at_most=180.0 if name == "sideways_deg" else 1e3)


class CommandController:
    """Turns commands `(n, 3)` in [-1, 1] into actions `(n, n_actions)` of `Rover-v0`.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
        limits: The values of a command of 1.
    """

    def __init__(self, rover: RoverEnv, limits: CommandLimits | None = None) -> None:
        self.limits = given_or_usual("limits", limits, CommandLimits)
        layout, model = rover.observation_layout, rover.model
        q, velocity = layout["q"].start, layout["velocity"].start
        self._pitch = q + 5
        weight = model.mass * math.hypot(*rover.gravity)
        turning = Turning.of(model, weight)
        self._kinematics = WheelKinematics(model)
        self._wheels = np.array(turning.wheels)
        self._steering = np.array([q + i for i in turning.steering.joints], dtype=np.intp)
        self._skids = turning.skids
        self._widening = WIDENING if turning.skids else 1.0
        self.steers_sideways = bool(turning.steering.joints) and min(turning.steering.entries) >= 0
        self._yaw_rate = velocity + YAW
        self._yaw_gain, self._scrub = np.array(turning.yaw_gain), np.array(turning.scrub)
        self._max_steering = rover.max_steering
        self._n_wheels = len(turning.wheels)
        self._n_actions = rover.task.n_actions
        self._load = weight / self._n_wheels
        self._regulator = WheelRegulator(rover, self.limits.response)

    def act(self, observations: npt.NDArray[Any], commands: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """The actions `(n, n_actions)` for observations `(n, size)`, scaled as the environment returns them."""
        seen = observations.astype(np.float64, copy=False)
        command = np.clip(commands.astype(np.float64, copy=False), -1.0, 1.0)
        speed = self.limits.speed * command[:, :1]
        curvature = self.limits.curvature * command[:, 1:2]
        sideways = math.radians(self.limits.sideways_deg) * command[:, 2:3]

        sine, cosine = sin_cos(sideways)
        ahead, left = wheel_velocities(self._wheels, cosine, sine, self._widening * curvature, curvature)
        set_points = self._kinematics.joint_angles(np.asarray(atan2(left, ahead)))
        set_points = np.clip(set_points, -self._max_steering, self._max_steering)
        # Slow down until the wheels reach their steering angles; otherwise they scrub and the path deviates.
        off = np.abs(set_points - seen[:, self._steering]).max(axis=1, keepdims=True, initial=0.0)
        speed = speed * np.maximum(0.2, 1.0 - 2.0 * off)
        wanted = speed * self._kinematics.rim_speeds(ahead, left, self._kinematics.wheel_angles(set_points))

        force = self._load * sin_cos(seen[:, self._pitch, None])[0]
        if self._skids:
            yaw_rate = speed * curvature
            missing = yaw_rate - seen[:, self._yaw_rate, None]
            force = force + self._yaw_gain * missing + self._scrub * np.clip(yaw_rate / SCRUB_RATE, -1.0, 1.0)
        actions = np.empty((len(seen), self._n_actions), dtype=np.float32)
        actions[:, : self._n_wheels] = self._regulator.entries(seen, wanted, force)
        if self._kinematics.steering.joints:
            actions[:, self._n_wheels :] = np.clip(set_points / self._max_steering, -1.0, 1.0)
        return actions

    def hold(
        self, seen: Observations, commands: npt.NDArray[Any], periods: int, moved: Mask, step: Step
    ) -> tuple[Observations, Array, Mask, Mask]:
        """Holds commands `(n, 3)` for some control periods or until a rover's episode ends.

        The height scan is taken once a command, in the last of its periods, and where an episode ends.

        Args:
            seen: `(n, size)` the last observations.
            commands: The commands.
            periods: How many.
            moved: `(n,)` the rovers that move.
            step: Takes a control period.

        Returns:
            The last observations, sums of the rewards `(n,)`, which episodes have ended, and which have reached their
            time limit.
        """
        active, rewards = moved.copy(), np.zeros(len(moved))
        terminated, truncated = np.zeros_like(moved), np.zeros_like(moved)
        for left in reversed(range(periods)):
            if not active.any():
                break
            actions = self.act(seen, commands)
            seen, earned, ended, timed_out = step(actions, active, left == 0)
            rewards[active] += earned[active]
            terminated |= ended & active
            truncated |= timed_out & active
            active &= ~(terminated | truncated)
        return seen, rewards, terminated, truncated
