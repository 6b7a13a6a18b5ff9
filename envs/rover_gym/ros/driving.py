"""From the commands of ROS to the actions of a rover."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import CommandError
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.command import CommandController, CommandLimits
from rover_gym.drive.commands.regulator import WheelRegulator
from rover_gym.drive.commands.turning import Turning
from rover_gym.envs.start import Steering

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rover_gym.envs.rover_env import RoverEnv

Array = npt.NDArray[np.float64]

#: Values of a command of 1 for the controller: speed, m/s, and curvature, 1/m, beyond what any rover does.
LARGEST_SPEED, LARGEST_CURVATURE = 100.0, 1e3
#: Speed at which a rover that skids turns on the spot, m/s.
ON_THE_SPOT = 1e-3
#: Time constant of wheels under a command of their speed, s.
RESPONSE = 0.1
#: A rover that skids turns faster or slower than its wheels say: its command is corrected by this fraction of the
#: missing yaw rate in a second, up to the largest correction, rad/s.
YAW_CORRECTION, LARGEST_CORRECTION = 2.0, 2.0


@dataclass(frozen=True)
class TwistCommand:
    """A velocity of the trunk, in its frame.

    Attributes:
        forward: m/s.
        left: m/s.
        turn: rad/s, positive to the left.
    """

    forward: float = 0.0
    left: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class JointCommand:
    """Commands of joints by their names.

    Attributes:
        speeds: Of wheels, rad/s, positive forward.
        torques: Of wheels, N m, positive forward.
        angles: Of joints that steer, rad, positive to the left.
    """

    speeds: Mapping[str, float] = field(default_factory=dict)
    torques: Mapping[str, float] = field(default_factory=dict)
    angles: Mapping[str, float] = field(default_factory=dict)


Command: TypeAlias = TwistCommand | JointCommand


class Driving:
    """Turns commands into the actions of an environment.

    A rover that steers by its wheels keeps to the curvature that its steering can do, and does not turn on the spot.
    One whose wheels all steer also moves to its side.

    Args:
        env: The environment, which has been reset.

    Attributes:
        correction: What a rover that skids adds to the yaw rate of its command, rad/s.
    """

    def __init__(self, env: RoverEnv) -> None:
        model = env.model
        limits = CommandLimits(speed=LARGEST_SPEED, curvature=LARGEST_CURVATURE, sideways_deg=90.0)
        self._env, self._controller = env, CommandController(env, limits)
        self._regulator = WheelRegulator(env, RESPONSE)
        turning = Turning.of(model, model.mass * math.hypot(*env.gravity))
        self._skids, self.correction = turning.skids, 0.0
        self._sharpest = LARGEST_CURVATURE if turning.skids else turning.max_curvature(env.max_steering)
        self._wheels = [model.dof_names[i] for i in model.wheel_joint_indices]
        self._steering = [model.dof_names[i] for i in Steering.of(model).joints]
        self._radii, self._torque_limits = model.wheel_radii, model.wheel_torque_limits

    def check(self, command: Command) -> None:
        """Refuses a command that the rover cannot follow.

        Raises:
            CommandError: A number is not finite, or a joint is no wheel or does not steer.
        """
        if isinstance(command, TwistCommand):
            for name, value in vars(command).items():
                _finite(name, value)
            return
        for part, known in (("speeds", self._wheels), ("torques", self._wheels), ("angles", self._steering)):
            for name, value in getattr(command, part).items():
                if name not in known:
                    refuse(CommandError, "name", name, f"takes no {part}: known are {', '.join(known) or 'none'}")
                _finite(name, value)

    def action(self, command: Command) -> npt.NDArray[np.float32]:
        """The action for a command that has been checked."""
        seen = self._env.complete_observation()[None]
        if isinstance(command, TwistCommand):
            arc: npt.NDArray[np.float32] = self._controller.act(seen, self._arc(command)[None])[0]
            return arc
        action = np.zeros(self._env.action_space.shape or (), np.float32)
        n = len(self._wheels)
        if command.speeds:
            rims = np.array([[command.speeds.get(name, 0.0) for name in self._wheels]]) * self._radii
            action[:n] = self._regulator.entries(seen, rims, np.zeros((1, 1)))[0]
        for i, name in enumerate(self._wheels):
            if name in command.torques:
                action[i] = command.torques[name] / self._torque_limits[i]
        for i, name in enumerate(self._steering):
            action[n + i] = command.angles.get(name, 0.0) / self._env.max_steering
        limited: npt.NDArray[np.float32] = action.clip(-1.0, 1.0)
        return limited

    def _arc(self, command: TwistCommand) -> Array:
        """Speed, curvature and direction of a twist, over their largest values."""
        forward, left = command.forward, command.left if self._controller.steers_sideways else 0.0
        speed = math.copysign(math.hypot(forward, left), forward)
        sideways = math.atan2(math.copysign(left, left * speed), abs(forward)) if left else 0.0
        turn = command.turn + self._corrected(command.turn) if self._skids else command.turn
        if self._skids and abs(speed) < ON_THE_SPOT:
            speed = math.copysign(ON_THE_SPOT, speed) if turn else 0.0
        curvature = turn / speed if speed else 0.0
        curvature = min(max(curvature, -self._sharpest), self._sharpest)
        return np.array([speed / LARGEST_SPEED, curvature / LARGEST_CURVATURE, sideways / (0.5 * math.pi)])

    def _corrected(self, turn: float) -> float:
        """Integrates the yaw rate that is missing, and returns the correction; none where no turn is wanted."""
        missing = turn - float(self._env.simulation.v[4])
        added = self.correction + YAW_CORRECTION * self._env.dt * missing if turn else 0.0
        self.correction = min(max(added, -LARGEST_CORRECTION), LARGEST_CORRECTION)
        return self.correction


def _finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        refuse(CommandError, name, value, "must be finite")
