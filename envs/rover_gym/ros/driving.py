"""From the commands of ROS to the wheels of a rover."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from rover_gym.core import CommandError
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.wheel_kinematics import WheelKinematics

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rover_gym.core import RoverModel, Simulation
    from rover_gym.drive.commands.wheel_kinematics import WheelCommands


@dataclass(frozen=True)
class TwistCommand:
    """A velocity of the rover, in the frame of its trunk, as `WheelKinematics` takes it.

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
        speeds: Of wheels, rad/s, positive forward; the other wheels are held at rest.
        torques: Of wheels, N m, positive forward; the other wheels roll freely.
        angles: Of joints that steer, rad, positive to the left; the others are held straight.
    """

    speeds: Mapping[str, float] = field(default_factory=dict)
    torques: Mapping[str, float] = field(default_factory=dict)
    angles: Mapping[str, float] = field(default_factory=dict)


Command: TypeAlias = TwistCommand | JointCommand


class Driving:
    """Commands the wheels of a simulation: their speeds by servos, or their torques.

    Args:
        model: The rover.
    """

    def __init__(self, model: RoverModel) -> None:
        self._kinematics = WheelKinematics(model)
        #: The commands of a twist, which is sent again in every control period.
        self._commands = lru_cache(maxsize=1)(self._commands_of)
        self._wheels = [model.dof_names[i] for i in model.wheel_joint_indices]
        self._steering = [model.dof_names[i] for i in self._kinematics.steering.joints]
        described = model.to_dict()["wheels"]
        self._limits = np.array([wheel.get("steering_limit") or 0.0 for wheel in described])

    def check(self, command: Command) -> None:
        """Refuses a command that the rover cannot follow.

        Raises:
            CommandError: A number is not finite, a joint does not take it, or there are speeds and torques.
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
        if command.speeds and command.torques:
            refuse(CommandError, "torques", dict(command.torques), "must not be given together with speeds")

    def send(self, simulation: Simulation, command: Command) -> None:
        """Commands a simulation of the rover; the command has been checked."""
        if isinstance(command, TwistCommand):
            commands = self._commands(command)
            simulation.set_wheel_speeds(commands.speeds, commands.set_points)
            return
        joints = np.array([[command.angles.get(name, 0.0) for name in self._steering]])
        angles = self._kinematics.wheel_angles(joints)[0].clip(-self._limits, self._limits)
        given = command.torques or command.speeds
        values = [given.get(name, 0.0) for name in self._wheels]
        if command.torques:
            simulation.set_commands(values, angles)
        else:
            simulation.set_wheel_speeds(values, angles)

    def _commands_of(self, twist: TwistCommand) -> WheelCommands:
        return self._kinematics.commands(twist.forward, twist.turn, twist.left)


def _finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        refuse(CommandError, name, value, "must be finite")
