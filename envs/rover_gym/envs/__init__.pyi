from .arguments import ARGUMENTS, Argument, RoverArguments
from .env_snapshot import EnvSnapshot
from .grains_env import BedDraw, GrainsEnvSnapshot, RoverGrainsEnv
from .observation import ObservationField, ObservationLayout
from .pushes import PushOptions, RandomPushes
from .reward_terms import RewardTerm
from .rover_env import RoverEnv
from .start import Domain, HeightScan, Rocks, Start, drive_signs, wheel_centres
from .task import Task

__all__ = [
    "ARGUMENTS",
    "Argument",
    "BedDraw",
    "Domain",
    "EnvSnapshot",
    "GrainsEnvSnapshot",
    "HeightScan",
    "ObservationField",
    "ObservationLayout",
    "PushOptions",
    "RandomPushes",
    "RewardTerm",
    "Rocks",
    "RoverArguments",
    "RoverEnv",
    "RoverGrainsEnv",
    "Start",
    "Task",
    "drive_signs",
    "wheel_centres",
]
