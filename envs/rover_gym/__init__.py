"""A nonsmooth simulator of a six-wheel Mars rover, and Gymnasium environments on it.

Importing the package registers `Rover-v0` with Gymnasium.
"""

from rover_gym import registration as _registration
from rover_gym._core import (
    CommandError,
    ModelError,
    OptionError,
    Plane,
    ProblemError,
    RoverGymError,
    RoverModel,
    Simulation,
    Snapshot,
    StateError,
    StepError,
    TerrainError,
    __version__,
    solve_friction_contact,
)
from rover_gym.env import RoverEnv
from rover_gym.policy import PDPolicy

__all__ = [
    "CommandError",
    "ModelError",
    "OptionError",
    "PDPolicy",
    "Plane",
    "ProblemError",
    "RoverEnv",
    "RoverGymError",
    "RoverModel",
    "Simulation",
    "Snapshot",
    "StateError",
    "StepError",
    "TerrainError",
    "__version__",
    "solve_friction_contact",
]

_registration.register()
