"""What a policy for any rover sees of it, in the rover's own measure.

Lengths are relative to the rover's reach, heights to its wheel radius, and wheels are averaged at six places: those at
the front, in the middle and at the rear of each side. So rovers with other wheels have the same entries.
"""

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.core import Plane, RoverModel, exp
from rover_gym.drive.commands.command import CommandController
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import drive_signs, wheel_centres

Array = npt.NDArray[np.float64]

#: Entries are clipped to this.
LARGEST = 5.0

#: Places of wheels, three on each side, and what is observed of the wheels at each: contact, load, traction, rim speed,
#: steering.
PLACES, OF_A_WHEEL = 6, 5

#: Number of entries, and those that tell where the goal is.
N_FEATURES = 29 + PLACES * OF_A_WHEEL
GOAL = slice(11, 16)


class Planner(Protocol):
    """A planner for the rover: `ScanPolicy`, whose attributes these are."""

    reach: float
    radius: float
    clearance: float
    cruise_speed: float
    controller: CommandController


class RoverView:
    """Features of a rover, from its observations.

    Args:
        rover: The environment, read once for layout and rover constants.
        planner: A planner for the rover.

    Attributes:
        level: Height of the ground below the trunk's origin where the rover stands on a plane, m; negative.
    """

    def __init__(self, rover: RoverEnv, planner: Planner) -> None:
        layout, model = rover.observation_layout, rover.model
        self._layout, self._goal_scale, self._reach = layout, layout.scale[layout["goal"]], planner.reach
        self._speeds = np.array([planner.cruise_speed] * 3 + [1.0] * 3)
        self.level = -float(model.resting_pose(Plane(), (0.0, 0.0), 0.0)[1])
        self._rover = _measures(rover, planner, self.level)
        self._wheels = _Wheels(rover, planner.cruise_speed)

    def __call__(self, rows: Array, slope: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """`(n, N_FEATURES)`, for observations `(n, size)` and slopes of the ground plane `(n, 2)`."""
        layout, n = self._layout, len(rows)
        q, velocity = layout["q"].start, layout["velocity"].start
        goal = rows[:, layout["goal"]] * self._goal_scale
        distance = np.sqrt((goal**2).sum(axis=1))
        away = distance / self._reach
        parts = [
            rows[:, [q + 3, q + 5]] * 2.0,
            slope * 3.0,
            rows[:, velocity : velocity + 6] / self._speeds,
            rows[:, layout["stuck"]],
            goal / np.maximum(distance, 1e-3)[:, None],
            np.stack((np.minimum(away / 10.0, 3.0), exp(-away), exp(-0.2 * away)), axis=1),
            np.broadcast_to(self._rover, (n, len(self._rover))),
            self._wheels(rows),
        ]
        return np.concatenate(parts, axis=1).clip(-LARGEST, LARGEST).astype(np.float32)

    def at_places(self, of_wheels: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """`(..., PLACES)` means over the wheels at each place, of values `(..., n_wheels)`; 0 where there is none."""
        return self._wheels.at_places(of_wheels)


def _measures(rover: RoverEnv, plan: Planner, level: float) -> Array:
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
    """What is observed of the wheels, as means over those at each place."""

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
        """`(n, PLACES * OF_A_WHEEL)`."""
        of_wheels = (
            rows[:, self._contact],
            0.5 * rows[:, self._load].clip(0.0, 6.0),
            0.5 * rows[:, self._traction].clip(-6.0, 6.0),
            (self._rim * rows[:, self._rates]).clip(-3.0, 3.0),
            self._steered * rows[:, self._joints],
        )
        return np.concatenate([self.at_places(values) for values in of_wheels], axis=1)

    def at_places(self, of_wheels: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        # Sums wheel by wheel: the same bits for any number of rovers.
        means: npt.NDArray[np.floating] = (of_wheels[..., None, :] * self._share).sum(axis=-1)
        return means
