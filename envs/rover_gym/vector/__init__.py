"""Vectorised environments, stepped by the compiled core.

`RoverVectorEnv` is for Gymnasium. `rover_gym.vector.sb3`, which imports stable-baselines3, has its equivalent for that
library.
"""

from rover_gym.env.batch import BatchSnapshot, RoverBatch
from rover_gym.vector.pushed_vector import RandomPushesVector
from rover_gym.vector.sensed_vector import (
    RoverCourseVectorEnv,
    RoverGrainsVectorEnv,
    SensorVectorObservation,
    make_course_vector,
    make_grains_vector,
    make_rover_vector,
)
from rover_gym.vector.throughput import ExploringSpeed, VectorSpeed, measure_exploring, measure_speed
from rover_gym.vector.vector_env import RoverVectorEnv

__all__ = [
    "BatchSnapshot",
    "ExploringSpeed",
    "RandomPushesVector",
    "RoverBatch",
    "RoverCourseVectorEnv",
    "RoverGrainsVectorEnv",
    "RoverVectorEnv",
    "SensorVectorObservation",
    "VectorSpeed",
    "make_course_vector",
    "make_grains_vector",
    "make_rover_vector",
    "measure_exploring",
    "measure_speed",
]
