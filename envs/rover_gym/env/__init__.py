"""The environment `Rover-v0`: its card and arguments, its task, and its control period."""

from rover_gym.env.arguments import ARGUMENTS, Argument, RoverArguments
from rover_gym.env.env_snapshot import EnvSnapshot
from rover_gym.env.grains_env import BedDraw, GrainsEnvSnapshot, RoverGrainsEnv
from rover_gym.env.observation import ObservationField, ObservationLayout
from rover_gym.env.pushes import PushOptions, RandomPushes
from rover_gym.env.reward_terms import RewardTerm
from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import Domain, HeightScan, Rocks, Start, drive_signs, wheel_centres
from rover_gym.env.task import Task

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
