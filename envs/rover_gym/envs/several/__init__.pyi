from .joined_batch import JoinedBatch as JoinedBatch, RoverPeriod as RoverPeriod
from .joined_scene import JoinedScene as JoinedScene, Team as Team
from .machine_view import MachineView as MachineView
from .making import parallel_env as parallel_env
