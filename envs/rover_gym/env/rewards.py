"""The reward terms of `Rover-v0`, one function per term.

The reward of a step is the sum of the terms. Each term is its weight times a quantity of that step; a negative weight
makes it a cost. `dt` is the control period in seconds. Quantities are numbers, or arrays with one entry per rover.

The quantities of one step are bounded, whatever the physics did: by `MOST_PROGRESS`, `MOST_WORK` and `MOST_TIME`, and
slip ratio and lean by `MOST_RATIO`. With the default weights the reward of a step never exceeds 90 in magnitude. Normal
driving stays within these bounds even over 10 s.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from rover_gym.env.quantities import Quantity

#: A truth value for one rover, an array `(n,)` for n.
Flag: TypeAlias = Any

#: Default weights. A 7 m drive on flat ground earns about 15: 7 for progress and 10 at the goal, less the costs.
WEIGHTS: Mapping[str, float] = MappingProxyType(
    {
        "progress": 1.0,
        "time": -0.05,
        "energy": -5e-5,
        "slip": -0.1,
        "tilt": -0.1,
        "torque_change": -0.02,
        "steering_change": -0.02,
        "success": 10.0,
        "failure": -10.0,
    }
)

#: Largest progress of one step either way, m.
MOST_PROGRESS = 30.0
#: Largest work of one step, J.
MOST_WORK = 4e5
#: Longest control period that counts, s.
MOST_TIME = 60.0
#: Largest slip ratio, and `1 - cos tilt` of a rover on its back.
MOST_RATIO = 2.0


def progress(weight: float, previous_distance: Quantity, distance: Quantity) -> Quantity:
    """`w (d_before - d_after)`: progress towards the goal, m, at most `MOST_PROGRESS` either way."""
    return weight * _within(previous_distance - distance, MOST_PROGRESS)


def time(weight: float, dt: float) -> float:
    """`w dt`: elapsed time, s, at most `MOST_TIME`."""
    return weight * min(dt, MOST_TIME)


def energy(weight: float, work: Quantity) -> Quantity:
    """`w sum_i |tau_i dphi_i|`: work of the six wheel motors, driving or braking, J, at most `MOST_WORK`.

    tau_i is the delivered torque, which the motor's torque-speed line may hold below the command.
    """
    return weight * _within(work, MOST_WORK)


def slip(weight: float, slip_ratio: Quantity, dt: float) -> Quantity:
    """`w s dt`: mean slip ratio of the wheels in contact, times the control period."""
    return weight * _within(slip_ratio, MOST_RATIO) * min(dt, MOST_TIME)


def tilt(weight: float, cos_tilt: Quantity, dt: float) -> Quantity:
    """`w (1 - cos tilt) dt`: the trunk's lean from the vertical, times the control period."""
    return weight * _within(1.0 - cos_tilt, MOST_RATIO) * min(dt, MOST_TIME)


def torque_change(weight: float, squared_change: Quantity) -> Quantity:
    """`w sum_i (a_i - a_i,before)^2 / 6` over the six wheel torques."""
    return weight * squared_change / 6.0


def steering_change(weight: float, squared_change: Quantity) -> Quantity:
    """`w sum_i (a_i - a_i,before)^2 / 6` over the six steering set-points."""
    return weight * squared_change / 6.0


def success(weight: float, reached: Flag) -> Quantity:
    """`w` on the step that reaches the goal."""
    return weight * reached + 0.0  # no negative zero


def failure(weight: float, failed: Flag) -> Quantity:
    """`w` on a step that ends the episode by roll-over, high-centring or a failed physics step."""
    return weight * failed + 0.0


def _within(quantity: Quantity, most: float) -> Quantity:
    """Clips a quantity to [-most, most]."""
    if isinstance(quantity, float):
        return min(max(quantity, -most), most)
    return np.clip(quantity, -most, most)
