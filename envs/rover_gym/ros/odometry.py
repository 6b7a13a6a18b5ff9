"""Wheel odometry: where a rover would be by its wheels and its level, as it goes astray on slip.

Speeds and angles of the wheels give the velocity of the trunk by `WheelKinematics.twist`. Roll and pitch are those of a
perfect level.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core.rotations import roll_pitch_yaw
from rover_gym.drive.commands.wheel_kinematics import WheelKinematics
from rover_gym.envs.start import drive_signs

if TYPE_CHECKING:
    from rover_gym.core import RoverModel

Array = npt.NDArray[np.float64]


class WheelOdometry:
    """Integrates the turns of the wheels.

    Args:
        model: The rover.

    Attributes:
        place: (3,) in the frame `odom`, m.
        rotation: (3, 3) from `base_link` to `odom`.
        velocity: v_x, v_y, m/s, and omega, rad/s, (3,), of `base_link`.
    """

    def __init__(self, model: RoverModel) -> None:
        self._kinematics = WheelKinematics(model)
        self._wheels = model.wheel_joint_indices
        self._signs = drive_signs(model)
        self._steering = list(self._kinematics.steering.joints)
        self._turned: Array | None = None
        self.place: Array = np.zeros(3)
        self.velocity: Array = np.zeros(3)
        self.rotation = np.eye(3)
        self._yaw = 0.0

    def advance(self, q: Array, attitude: Array, period: float) -> None:
        """Adds what the wheels have turned since the last call.

        Args:
            q: Coordinates (nq,), as `Simulation.q`.
            attitude: (3, 3) from `base_link` to `map`; its roll and pitch are measured.
            period: Time since the last call, s.
        """
        turned: Array = q[self._wheels] * self._signs
        before = self._turned
        self._turned = turned
        roll, pitch, _ = roll_pitch_yaw(attitude)
        if before is not None and period > 0.0:
            forward, left, turn = self._kinematics.twist((turned - before) / period, q[self._steering])
            self.velocity = np.array([forward, left - turn * self._kinematics.x_c, turn])
            half = self._yaw + 0.5 * turn * period
            moved: Array = _attitude(roll, pitch, half)[:, :2] @ self.velocity[:2]
            self.place = self.place + period * moved
            self._yaw += float(turn) * period
        self.rotation = _attitude(roll, pitch, self._yaw)


def _attitude(roll: float, pitch: float, yaw: float) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
