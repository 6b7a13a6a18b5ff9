"""The weights of the reward's terms.

The reward of a step is the sum of the terms. Each term is its weight times a quantity of that step; a negative weight
makes it a cost. The card of `RoverEnv` lists the quantities, and the core computes them.
"""

from collections.abc import Mapping
from types import MappingProxyType

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
