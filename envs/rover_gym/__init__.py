"""rover-gym: a nonsmooth simulator of a six-wheel Mars rover, with Gymnasium environments.

The package consists of the subpackages below. Each one may import those above it, never those below it:

    mechanics      the compiled core: models, grounds, simulations, the contact solver
    validation     argument checks, with errors that name the field
    extras         optional packages
    files          files written whole or not at all
    rotations      rotations as matrices, vectors, quaternions
    polytopes      convex hulls of a few points, boxes around shapes
    derivatives    products with the derivatives of trajectories, also in PyTorch and JAX
    ground         what a terrain is made of
    maps           grounds from files, and made by a seed
    models         models from and to URDF and MJCF files
    rendering      images of a rover: frames and video
    record         trajectories in HDF5
    identification  parameters of a recorded run, with their uncertainty
    grains         grains: beds of balls in space and of disks in the plane
    sand           wheels on sand: soils, a test bed for one wheel, fits
    env            `Rover-v0`: its card, arguments and control period
    sensors        encoders, inertial unit, cameras and scanners as observations
    vector         batches of rovers, for Gymnasium and for stable-baselines3
    policy         the baseline, trained policies and their evaluation
    planning       driving by planning in the simulator
    economy        the cheapest model that a scene permits
    planar         the planar systems: a ball, a two-wheel rover
    runs           saved runs of every kind
    reproduction   the experiments of the 2010 report
    replay         saved runs for the browser, VRML and glTF
    figures        figures of saved runs
    learning       training with stable-baselines3
    registration   the environments' names for Gymnasium
    exports        runs, policies and simulations for other programs
    live           a rover that is driven in the browser
    cli            the command `rover`
"""

from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import (
    BusyError,
    CommandError,
    HeightField,
    InternalError,
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
    Terrain,
    TerrainError,
    TriangleMesh,
    Union,
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
    "HeightField",
    "InternalError",
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
    "Terrain",
    "TerrainError",
    "TriangleMesh",
    "Union",
    "__version__",
    "accuracy_options",
    "solve_friction_contact",
]
