"""The wheel regulator: the torque of each wheel for the rim speed that it should have.

Two inertias act on a rim. While the wheel rolls, its torque moves its share of the rover; when it is in the air or
slips, only the wheel itself, a tenth of that share or less. A gain for the rolling wheel makes the other one swing from
one torque to its opposite. So the force at the rim, torque over radius, is that of the rolling wheel, kept within what
moves the wheel alone to its speed. Counted in the direction of the missing rim speed,

    F = clip(F_roll, F_low, T + k (e + s))

    F_roll = feedforward + (m / n) e / response     the rover's mass over its wheels; response: a time constant
    F_low  = T + k (e - s)                          at most T e / s where e < s
    k = I / (r^2 dt)                                the wheel's spin inertia at the rim over the control period
    e >= 0                                          the missing rim speed, wanted less present
    T                                               traction, zero for a wheel without contact
    s = SLACK min(1, load / mean load)

A wheel under the traction T has the wanted rim speed after one period if s is zero, as it is in the air. On the ground
it may miss that by s, and in between the softer gain rules. Where a rock stops the rover, the traction follows the
torque, so that each period pushes harder than the last until the wheels turn or the motors are at their limit. Close to
the wanted speed such a push fades with e.

The wheels of a rover that skids slip sideways whenever it turns, and share its load by chance. Their force is
`feedforward + min(k, m / n / response) e`, not cut off.

The observed traction is that of the last physics step, in which a wheel may just have struck a rock. It is taken for
that of the period only as far as the torque of the period before could have balanced it with a rim that changed its
speed by LEAP.
"""

import math
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import drive_signs

Array = npt.NDArray[np.float64]

#: Rim speed by which a wheel under its mean load may miss the wanted one, m/s.
SLACK = 0.5

#: Largest change of a rim's speed in a control period that explains an observed traction, m/s.
LEAP = 1.5

#: A slack below this divides as this, m/s.
TINY = 1e-9


class Regulator(Protocol):
    """Turns wanted rim speeds into torques."""

    def entries(self, seen: npt.NDArray[Any], wanted: Array, feedforward: Array) -> Array:
        """The wheels' entries of the actions, as `WheelRegulator.entries` gives them."""


class WheelRegulator:
    """Turns wanted rim speeds into torques.

    Args:
        rover: The environment, read once for the layout and the rover's constants.
        response: Time constant of the rover's speed, s; a shorter one than the control period counts as this.
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
        previous = layout["previous_action"].start
        self._previous = slice(previous, previous + n)

    def entries(self, seen: npt.NDArray[Any], wanted: Array, feedforward: Array) -> Array:
        """The wheels' entries of the actions `(n, n_wheels)`, in [-1, 1].

        Args:
            seen: Observations `(n, size)`, scaled as the environment returns them.
            wanted: Rim speeds `(n, n_wheels)`, m/s, positive forward.
            feedforward: Forces `(n, n_wheels)` or `(n, 1)` that a rolling wheel needs at its wanted speed, N.
        """
        missing = wanted - self._rim_per_entry * seen[:, self._rates]
        rolling = feedforward + self._roll_gain * missing
        if self._skids:
            skidding: Array = np.clip(self._entry_per_force * rolling, -1.0, 1.0)
            return skidding
        k = self._spin_gain
        applied = seen[:, self._previous] / self._entry_per_force
        traction = self._force_scale * seen[:, self._traction] * (seen[:, self._contact] > 0.5)
        traction = np.clip(traction, applied - LEAP * k, applied + LEAP * k)
        slack = SLACK * np.clip(seen[:, self._load], 0.0, 1.0)

        direction = np.where(missing < 0.0, -1.0, 1.0)
        e, T = direction * missing, direction * traction
        low = T + k * (e - slack)
        low = np.where(e < slack, np.minimum(low, T * e / np.maximum(slack, TINY)), low)
        force = direction * np.clip(direction * rolling, low, T + k * (e + slack))
        entries: Array = np.clip(self._entry_per_force * force, -1.0, 1.0)
        return entries
