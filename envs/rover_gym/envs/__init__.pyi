from .arguments import ARGUMENTS as ARGUMENTS, Argument as Argument, RoverArguments as RoverArguments
from .distributions import Choice as Choice, LogUniform as LogUniform, Normal as Normal
from .domain import Domain as Domain
from .env_snapshot import EnvSnapshot as EnvSnapshot
from .grains_env import BedDraw as BedDraw, GrainsEnvSnapshot as GrainsEnvSnapshot, RoverGrainsEnv as RoverGrainsEnv
from .observation import ObservationField as ObservationField, ObservationLayout as ObservationLayout
from .pushes import PushOptions as PushOptions, RandomPushes as RandomPushes
from .reward_terms import RewardTerm as RewardTerm
from .rover_env import RoverEnv as RoverEnv
from .start import (
    HeightScan as HeightScan,
    Rocks as Rocks,
    Start as Start,
    drive_signs as drive_signs,
    wheel_centres as wheel_centres,
)
from .task import Task as Task
