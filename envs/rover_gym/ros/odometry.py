"""Wheel odometry: where a rover would be by its wheels and its level, as it goes astray on slip.

Each wheel at (x, y) on the trunk, y to the left, that rolls in the direction delta gives two equations for the velocity
(v_x, v_y, omega) of the trunk:

    (v_x - omega y) cos(delta) + (v_y + omega x) sin(delta) = rim speed
    (v_y + omega x) cos(delta) - (v_x - omega y) sin(delta) = 0         no sideways slip

They are solved by least squares. A rover that steers by skidding has sideways slip in every turn: v_y is 0, the second
equations are left out, and omega is divided by the widening that its commands have, see `Turning`. Roll and pitch are
those of a perfect level.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core.rotations import roll_pitch_yaw
from rover_gym.drive.commands.turning import WIDENING
from rover_gym.envs.start import Steering, drive_signs, wheel_centres

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
        velocity: v_x, v_y, m/s, and omega, rad/s, (3,), on the trunk.
    """

    def __init__(self, model: RoverModel) -> None:
        self._joints = model.wheel_joint_indices
        self._rim = model.wheel_radii * drive_signs(model)
        centres = wheel_centres(model)
        self._x, self._y = centres[:, 0], -centres[:, 1]
        steering = Steering.of(model)
        self._steered = np.array([i >= 0 for i in steering.entries])
        self._steering = np.array([steering.joints[i] if i >= 0 else 0 for i in steering.entries], np.intp)
        self._skids = not steering.joints
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
        turned: Array = q[self._joints] * self._rim
        before = self._turned
        self._turned = turned
        roll, pitch, _ = roll_pitch_yaw(attitude)
        if before is not None and period > 0.0:
            angles = np.where(self._steered, q[self._steering], 0.0)
            self.velocity = self._least_squares((turned - before) / period, angles)
            half = self._yaw + 0.5 * self.velocity[2] * period
            moved: Array = _attitude(roll, pitch, half)[:, :2] @ self.velocity[:2]
            self.place = self.place + period * moved
            self._yaw += float(self.velocity[2]) * period
        self.rotation = _attitude(roll, pitch, self._yaw)

    def _least_squares(self, speeds: Array, angles: Array) -> Array:
        if self._skids:
            rows = np.stack((np.ones_like(speeds), -self._y), axis=1)
            forward, turn = np.linalg.lstsq(rows, speeds, rcond=None)[0]
            return np.array([forward, 0.0, turn / WIDENING])
        c, s, x, y = np.cos(angles), np.sin(angles), self._x, self._y
        rows = np.concatenate((np.stack((c, s, x * s - y * c), axis=1), np.stack((-s, c, x * c + y * s), axis=1)))
        found = np.linalg.lstsq(rows, np.concatenate((speeds, np.zeros_like(speeds))), rcond=None)[0]
        return np.asarray(found, np.float64)


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
