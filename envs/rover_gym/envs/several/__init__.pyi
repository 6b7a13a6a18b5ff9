from .joined_batch import JoinedBatch as JoinedBatch, RoverPeriod as RoverPeriod
from .joined_episode import JoinedEpisode as JoinedEpisode
from .joined_scene import JoinedScene as JoinedScene, Team as Team
from .machine_view import MachineView as MachineView
from .parallel_env import RoverParallelEnv as RoverParallelEnv, parallel_env as parallel_env
