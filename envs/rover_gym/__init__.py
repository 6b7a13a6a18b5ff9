"""rover-gym: a nonsmooth simulator of a six-wheel Mars rover, with Gymnasium environments.

The package stands in rooms. A room may use those above it in this list, never one below:

    mechanics      the compiled core: models, grounds, simulations, the contact solver
    validation     arguments, refused by name
    extras         optional packages
    rendering      what a rover looks like: frames and video
    env            `Rover-v0`: its card, its arguments, a control period
    vector         many rovers at once, for Gymnasium and for stable-baselines3
    policy         who drives: the baseline, trained policies, how far each gets
    planning       what a scene needs, and no more
    record         trajectories in HDF5
    planar         the planar systems: a ball, a two-wheel rover
    soil           granular soil
    reproduction   the report of 2010, run again
    replay         saved runs for the browser, VRML and glTF
    figures        figures of saved runs
    learning       training with stable-baselines3
    cli            the command `rover`
    registration   the environments' names for Gymnasium
"""

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
