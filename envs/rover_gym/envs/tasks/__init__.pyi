from .arcs_env import RoverArcsEnv as RoverArcsEnv, RoverArcsVectorEnv as RoverArcsVectorEnv
from .command_env import (
    CommandVectorEnv as CommandVectorEnv,
    DriveByCommand as DriveByCommand,
    RoverCommandEnv as RoverCommandEnv,
    RoverCommandVectorEnv as RoverCommandVectorEnv,
)
from .goal_env import (
    GoalObservation as GoalObservation,
    RoverGoalEnv as RoverGoalEnv,
    RoverGoalVectorEnv as RoverGoalVectorEnv,
)
from .trap_env import RoverTrapEnv as RoverTrapEnv, RoverTrapVectorEnv as RoverTrapVectorEnv, TrapBatch as TrapBatch
