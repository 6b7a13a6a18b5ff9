from .arcs_env import RoverArcsEnv, RoverArcsVectorEnv
from .command_env import CommandVectorEnv, DriveByCommand, RoverCommandEnv, RoverCommandVectorEnv
from .goal_env import GoalObservation, RoverGoalEnv, RoverGoalVectorEnv
from .trap_env import RoverTrapEnv, RoverTrapVectorEnv, TrapBatch

__all__ = [
    "CommandVectorEnv",
    "DriveByCommand",
    "GoalObservation",
    "RoverArcsEnv",
    "RoverArcsVectorEnv",
    "RoverCommandEnv",
    "RoverCommandVectorEnv",
    "RoverGoalEnv",
    "RoverGoalVectorEnv",
    "RoverTrapEnv",
    "RoverTrapVectorEnv",
    "TrapBatch",
]
