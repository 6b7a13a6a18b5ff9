"""The terms of the reward of `Rover-v0`, one function a term.

The reward of a step is the sum of the terms; each term is its weight times a quantity of that step,
with the weight's sign telling reward from cost. `dt` is the control period in seconds. Quantities
are numbers, or arrays with one entry a rover.

What one step counts is bounded, whatever the physics did: `MOST_PROGRESS`, `MOST_WORK`, `MOST_TIME`, slip ratios and
lean up to 2. With the default weights no step is worth more than 90 either way. What the rover does by itself in 10 s
is within these bounds.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from rover_gym.env.quantities import Quantity

#: A truth value for one rover, an array `(n,)` for n.
Flag: TypeAlias = Any

#: Default weights. With them a 7 m drive on flat ground earns about 15: 7 for the way, 10 at the goal.
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

#: Most that one step counts: metres gained on the goal, or lost.
MOST_PROGRESS = 30.0
#: Joules.
MOST_WORK = 4e5
#: Seconds.
MOST_TIME = 60.0
#: The largest slip ratio, and `1 - cos tilt` of a rover on its back.
MOST_RATIO = 2.0


def progress(weight: float, previous_distance: Quantity, distance: Quantity) -> Quantity:
    """`w (d_before - d_after)`: metres gained on the goal, at most `MOST_PROGRESS` either way."""
    return weight * _within(previous_distance - distance, MOST_PROGRESS)


def time(weight: float, dt: float) -> float:
    """`w dt`: seconds spent, at most `MOST_TIME`."""
    return weight * min(dt, MOST_TIME)


def energy(weight: float, work: Quantity) -> Quantity:
    """`w sum_i |tau_i dphi_i|`: joules through the six wheel motors, driving or braking, at most `MOST_WORK`.

    tau_i is the torque that the motor gave, which on its line is less than the command.
    """
    return weight * _within(work, MOST_WORK)


def slip(weight: float, slip_ratio: Quantity, dt: float) -> Quantity:
    """`w s dt`: mean slip ratio of the wheels in contact, for as long as it lasts."""
    return weight * _within(slip_ratio, MOST_RATIO) * min(dt, MOST_TIME)


def tilt(weight: float, cos_tilt: Quantity, dt: float) -> Quantity:
    """`w (1 - cos tilt) dt`: the trunk's lean from the vertical."""
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
    """`w` on a step that ends in a roll-over, a high-centring or a step that could not be taken."""
    return weight * failed + 0.0


def _within(quantity: Quantity, most: float) -> Quantity:
    """At most `most` either way."""
    if isinstance(quantity, float):
        return min(max(quantity, -most), most)
    return np.clip(quantity, -most, most)
