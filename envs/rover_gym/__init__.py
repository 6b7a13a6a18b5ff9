"""rover-gym: a nonsmooth simulator of a six-wheel Mars rover, with Gymnasium environments."""

from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import (
    BusyError,
    CommandError,
    ModelError,
    Motor,
    OptionError,
    Plane,
    ProblemError,
    RoverGymError,
    RoverModel,
    Simulation,
    Snapshot,
    SphereField,
    StateError,
    StepError,
    TerrainError,
    __version__,
    accuracy_options,
    solve_friction_contact,
)
from rover_gym.policy.pd_policy import PDPolicy
from rover_gym.registration import register_environments

register_environments()

__all__ = [
    "BusyError",
    "CommandError",
    "ModelError",
    "Motor",
    "OptionError",
    "PDPolicy",
    "Plane",
    "ProblemError",
    "RoverEnv",
    "RoverGymError",
    "RoverModel",
    "Simulation",
    "Snapshot",
    "SphereField",
    "StateError",
    "StepError",
    "TerrainError",
    "__version__",
    "accuracy_options",
    "solve_friction_contact",
]
