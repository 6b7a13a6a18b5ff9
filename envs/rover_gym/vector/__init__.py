"""Many rovers at once, stepped by the compiled core.

`RoverVectorEnv` is for Gymnasium; `rover_gym.vector.sb3`, which imports stable-baselines3, has the same for that.
"""

from rover_gym.vector.batch import BatchRover, RoverBatch
from rover_gym.vector.throughput import VectorSpeed, measure_speed
from rover_gym.vector.vector_env import RoverVectorEnv

__all__ = [
    "BatchRover",
    "RoverBatch",
    "RoverVectorEnv",
    "VectorSpeed",
    "measure_speed",
]
