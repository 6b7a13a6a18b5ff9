"""Wheel regulator: the torque of each wheel for a wanted rim speed.

The inertia at a rim has two values. While the wheel rolls, its torque moves its share of the rover. In the air or
slipping it moves only the wheel, a tenth of that share or less, and the gain for the rolling wheel would make it
oscillate. The force at the rim, torque over radius, is therefore that of the rolling wheel, limited to the force that
brings the wheel alone to its speed. In the direction of the missing rim speed,

    F = clip(F_roll, F_low, T + k (e + s))

    F_roll = feedforward + (m / n) e / response     the rover's mass over its wheels; response: a time constant
    F_low  = T + k (e - s)                          at most T e / s where e < s
    k = I / (r^2 dt)                                the wheel's spin inertia at the rim over the control period
    e >= 0                                          the missing rim speed, wanted less present
    T                                               traction, zero for a wheel without contact
    s = SLACK min(1, load / mean load) (1 - spin)
    spin: from 0 to 1, by the difference of the speeds of rim and ground, see SPINNING

A wheel under the traction T has the wanted rim speed after one period if s is zero, as it is in the air and where it
spins on the ground. The traction of a spinning wheel does not follow its torque: F_roll and T e / s would throw its rim
from too fast to too slow in every period. A rolling wheel may differ by s, and within s the softer gain applies. If a
rock stops the rover, the traction follows the torque, so the push grows every period until the wheels turn or the
motors reach their limit. Close to the wanted speed the push decreases with e.

The wheels of a skid-steered rover slip sideways in every turn, and their loads vary randomly. Their force is
`feedforward + min(k, m / n / response) e`, without limit.

The observed traction is that of the last physics step, in which a wheel may just have hit a rock. It is limited to the
value that the previous torque could have balanced with a change of the rim speed by RIM_SPEED_CHANGE.
"""

import math
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.start import drive_signs, wheel_centres

Array = npt.NDArray[np.float64]

#: Rim speed by which a wheel under its mean load may miss the wanted one, m/s.
SLACK = 0.5

#: Largest change of a rim's speed in a control period that explains an observed traction, m/s.
RIM_SPEED_CHANGE = 1.5

#: Differences of the speeds of rim and ground, m/s, up to which a wheel rolls, and from which on it spins. With them,
#: on 60 fields of difficulties 1 and 1.5 each, the baseline reached 48 and 24 goals, without them 48 and 22.
SPINNING = (0.25, 0.5)

#: Index of the yaw rate in the observed velocity.
YAW = 4

#: Smallest slack as a divisor, m/s.
TINY = 1e-9


class Regulator(Protocol):
    """Turns wanted rim speeds into torques."""

    def entries(self, seen: npt.NDArray[Any], wanted: Array, feedforward: Array) -> Array:
        """The wheels' entries of the actions, as `WheelRegulator.entries` gives them."""


class WheelRegulator:
    """Turns wanted rim speeds into torques.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
        response: Time constant of the rover's speed, s; at least the control period.
    """

    def __init__(self, rover: RoverEnv, response: float) -> None:
        layout, model = rover.observation_layout, rover.model
        n = len(model.wheel_names)
        joints = model.wheel_joint_indices
        spin = model.mass_matrix(np.zeros(model.nq), coordinates="state").diagonal()[joints]
        self._skids = not rover.task.steering.joints
        self._spin_gain = spin / model.wheel_radii**2 / rover.dt
        roll_gain = model.mass / n / max(response, rover.dt)
        self._roll_gain = np.minimum(roll_gain, self._spin_gain) if self._skids else roll_gain
        self._entry_per_force = model.wheel_radii / model.wheel_torque_limits
        self._rates = layout["velocity"].start + np.asarray(joints, np.intp)
        self._rim_per_entry = model.wheel_radii * drive_signs(model) * layout.scale[self._rates]
        self._contact, self._load = layout["wheel_contact"], layout["normal_force"]
        rolling = layout["tangential_force"]
        self._traction = slice(rolling.start, rolling.stop, 2)
        self._force_scale = model.mass * math.hypot(*rover.gravity) / n
        self._velocity, self._scale = layout["velocity"].start, layout.scale
        centres = wheel_centres(model)
        self._ahead, self._right = centres[:, 0], centres[:, 1]
        previous = layout["previous_action"].start
        self._previous = slice(previous, previous + n)

    def entries(self, seen: npt.NDArray[Any], wanted: Array, feedforward: Array) -> Array:
        """The wheels' entries of the actions `(n, n_wheels)`, in [-1, 1].

        Args:
            seen: Observations `(n, size)`, scaled as the environment returns them.
            wanted: Rim speeds `(n, n_wheels)`, m/s, positive forward.
            feedforward: Forces `(n, n_wheels)` or `(n, 1)` that a rolling wheel needs at its wanted speed, N.
        """
        rim = self._rim_per_entry * seen[:, self._rates]
        missing = wanted - rim
        rolling = feedforward + self._roll_gain * missing
        if self._skids:
            skidding: Array = np.clip(self._entry_per_force * rolling, -1.0, 1.0)
            return skidding
        k = self._spin_gain
        applied = seen[:, self._previous] / self._entry_per_force
        traction = self._force_scale * seen[:, self._traction] * (seen[:, self._contact] > 0.5)
        traction = np.clip(traction, applied - RIM_SPEED_CHANGE * k, applied + RIM_SPEED_CHANGE * k)
        slack = SLACK * np.clip(seen[:, self._load], 0.0, 1.0) * (1.0 - self._spin(seen, rim))

        direction = np.where(missing < 0.0, -1.0, 1.0)
        e, T = direction * missing, direction * traction
        low = T + k * (e - slack)
        low = np.where(e < slack, np.minimum(low, T * e / np.maximum(slack, TINY)), low)
        force = direction * np.clip(direction * rolling, low, T + k * (e + slack))
        entries: Array = np.clip(self._entry_per_force * force, -1.0, 1.0)
        return entries

    def _spin(self, seen: npt.NDArray[Any], rim: Array) -> Array:
        """How much each wheel spins, (n, n_wheels), from 0 to 1, by the speeds of its rim and of its centre."""
        first = self._velocity
        ahead, up, right, yaw = (
            self._scale[first + k] * seen[:, first + k, None].astype(np.float64) for k in (0, 1, 2, YAW)
        )
        along, across = ahead + yaw * self._right, right - yaw * self._ahead
        apart = np.abs(np.abs(rim) - np.sqrt(along * along + up * up + across * across))
        low, high = SPINNING
        spin: Array = np.clip((apart - low) / (high - low), 0.0, 1.0)
        return spin
