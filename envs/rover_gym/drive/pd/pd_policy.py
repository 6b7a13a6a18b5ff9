"""The PD baseline, which drives by the observation alone with one turning centre and regulated wheel speeds.

It drives any rover: one whose wheels steer, all or some, and one that turns by skidding; see
`rover_gym.drive.commands.turning`.

The rover turns about a centre at `(x_c, -1/kappa)` in the trunk's (x, z), where `kappa` is the curvature, positive to
the left. `x_c` is the x of the wheels without steering, or the middle of the wheelbase if all or none steer. A wheel at
`(x, z)` then needs

    steering  tan(delta) = kappa (x - x_c) / (1 + kappa z)
    speed     v_i = v sqrt((1 + kappa z)^2 + (kappa (x - x_c))^2)

where `v` is the speed of the point `(x_c, 0)`. Without steering, the two sides run at different speeds and the wheels
skid. The rover then turns less than with rolling wheels, about a centre farther out, so the commanded curvature is
multiplied by `WIDENING` (Mandow et al. 2007). Each wheel also gets the force `SCRUB` times its load against sideways
friction, and a force that controls the yaw rate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import atan2, sin_cos
from rover_gym.drive.commands.driven import Actions, Gains, ObservingPolicy, State, driven_rover, given_or_usual
from rover_gym.drive.commands.regulator import YAW, Regulator, WheelRegulator
from rover_gym.drive.commands.turning import SCRUB_RATE, WIDENING, Turning
from rover_gym.envs.observation import Array, Mask

_Row = Sequence[float]


@dataclass(frozen=True)
class PDGains(Gains):
    """The policy's gains.

    Attributes:
        speed: Speed on a straight path, m/s.
        lateral_acceleration: Largest lateral acceleration, which limits the speed in turns, m/s2.
        braking: Deceleration on the approach to the goal, m/s2.
        final_speed: Speed at the goal, m/s.
        response: Time constant of the rover's speed, s; see `WheelRegulator`.
        reverse_cost: Factor on the length of a path driven backward.
        switch_cost: Path length that a change of direction at `speed` counts as, m.
    """

    speed: float = 1.2
    lateral_acceleration: float = 0.5
    braking: float = 0.4
    final_speed: float = 0.3
    response: float = 0.1
    reverse_cost: float = 1.3
    switch_cost: float = 1.0


class PDPolicy(ObservingPolicy):
    """Drives `Rover-v0` to its goal; stateless, with the `predict` of `ObservingPolicy`.

    The policy compares four paths and takes the cheapest: forward or backward, with a left or right turn at the largest
    curvature, then straight. On this path it follows the circle through the goal (pure pursuit), within the largest
    curvature.

    Args:
        env: A `Rover-v0`, wrapped or not, or a vector of them. It is read once, for layout and rover constants.
        gains: The gains.
        regulator: Converts rim speeds to torques; a `WheelRegulator` by default.
    """

    def __init__(self, env: Any, gains: PDGains | None = None, regulator: Regulator | None = None) -> None:
        rover = driven_rover(env, type(self).__name__)
        super().__init__(rover)
        self.gains = given_or_usual("gains", gains, PDGains)
        layout, model = rover.observation_layout, rover.model
        self._scale = layout.scale
        self._roll = layout["q"].start + 3
        self._pitch = layout["q"].start + 5
        self._forward_speed = layout["velocity"].start
        self._yaw_rate = layout["velocity"].start + YAW
        self._goal = layout["goal"].start

        self._weight = model.mass * math.hypot(*rover.gravity)
        self._turning = Turning.of(model, self._weight)
        self._steering = [layout["q"].start + i for i in self._turning.steering.joints]
        self._steered_wheels = self._turning.steering.wheels
        self._n_wheels = len(model.wheel_names)
        self._n_actions = rover.task.n_actions
        self._max_steering = rover.max_steering
        self._regulator = WheelRegulator(rover, self.gains.response) if regulator is None else regulator
        self.max_curvature = self._turning.max_curvature(self._max_steering)

    def act(self, rows: Array, state: State, _starts: Mask, _deterministic: bool) -> tuple[Actions, State]:
        """Actions and the unchanged state: the policy has none."""
        drives = [self._drive(row) for row in (rows * self._scale).tolist()]
        shape = (len(rows), self._n_wheels)
        wanted, force = (np.array([drive[k] for drive in drives]).reshape(shape) for k in (0, 1))
        actions = np.empty((len(rows), self._n_actions), dtype=np.float32)
        actions[:, : self._n_wheels] = self._regulator.entries(rows, wanted, force)
        if self._steered_wheels:
            angles = np.array([drive[2] for drive in drives]).reshape(len(rows), -1)
            actions[:, self._n_wheels :] = np.clip(angles / self._max_steering, -1.0, 1.0)
        return actions, state

    def steering_angles(self, curvature: float) -> list[float]:
        """The angle of each steering joint, rad, at which all axles meet in the turning centre of a curvature, 1/m.

        A joint that steers several wheels takes the mean of their angles.
        """
        wheels = self._turning.wheels
        angles = [atan2(curvature * x, 1.0 + curvature * z) for x, z in wheels]
        return [sum(angles[i] for i in own) / len(own) for own in self._steered_wheels]

    def _drive(self, row: _Row) -> tuple[list[float], list[float], list[float]]:
        """Rim speeds, m/s, feedforward forces, N, and steering angles, rad, for one observation in SI units."""
        gains = self.gains
        speed_now = row[self._forward_speed]
        ahead, right = row[self._goal], row[self._goal + 1]
        direction, curvature = self._way(ahead - self._turning.x_c, -right, speed_now)
        angles = self.steering_angles(curvature)

        distance = math.hypot(ahead, right)
        speed = min(
            gains.speed,
            math.sqrt(gains.lateral_acceleration / max(abs(curvature), 1e-9)),
            math.sqrt(gains.final_speed * gains.final_speed + 2.0 * gains.braking * distance),
        )
        # Slow down until the wheels reach their steering angles; otherwise they scrub and the path deviates.
        off = max((abs(angle - row[i]) for angle, i in zip(angles, self._steering, strict=True)), default=0.0)
        speed *= direction * max(0.2, 1.0 - 2.0 * off)

        turning = self._turning
        hold = self._weight * sin_cos(row[self._pitch])[0] / self._n_wheels  # holds the rover on the slope
        if not turning.skids:
            wanted = [speed * math.hypot(1.0 + curvature * z, curvature * x) for x, z in turning.wheels]
            return wanted, [hold] * self._n_wheels, angles
        yaw_rate = speed * curvature
        missing, scrub = yaw_rate - row[self._yaw_rate], min(1.0, max(-1.0, yaw_rate / SCRUB_RATE))
        wanted = [speed * (1.0 + WIDENING * curvature * z) for _, z in turning.wheels]
        pushes = zip(turning.yaw_gain, turning.scrub, strict=True)
        return wanted, [hold + gain * missing + most * scrub for gain, most in pushes], angles

    def _way(self, ahead: float, left: float, speed_now: float) -> tuple[float, float]:
        """Direction (1 forward, -1 backward) and curvature of the cheapest path."""
        radius = 1.0 / self.max_curvature
        best, best_cost = (1.0, 0.0), math.inf
        for direction in (1.0, -1.0):
            factor = 1.0 if direction > 0.0 else self.gains.reverse_cost
            switch = self.gains.switch_cost * max(0.0, -direction * speed_now) / self.gains.speed
            for side in (1.0, -1.0):
                length = _turn_and_straight(direction * ahead, side * left, radius)
                cost = factor * length + switch
                if cost < best_cost:
                    best, best_cost = (direction, side), cost
        direction, side = best
        if side * left > 0.0 and direction * ahead > 0.0:
            pursuit = 2.0 * side * left / (ahead * ahead + left * left)
            return direction, side * min(pursuit, self.max_curvature)
        return direction, side * self.max_curvature


def _turn_and_straight(ahead: float, left: float, radius: float) -> float:
    """Length of a left turn followed by a straight line to the goal; inf if the goal lies inside the turning circle."""
    # `reach` is the distance of the goal from the turning centre, which is (0, radius) in (ahead, left).
    x, y = ahead, left - radius
    reach = math.hypot(x, y)
    if reach < radius:
        return math.inf
    straight = math.sqrt(reach * reach - radius * radius)
    # Angle of the goal about the centre, from the start at -90 degrees, minus that of the tangent.
    turn = (atan2(y, x) + 0.5 * math.pi - atan2(straight, radius)) % math.tau
    if turn > math.tau - 1e-6:  # a goal straight ahead, within round-off
        turn = 0.0
    return radius * turn + straight
