"""Vectorised environments, stepped by the compiled core.

`RoverVectorEnv` is for Gymnasium. `rover_gym.envs.vector.sb3` has its equivalent for stable-baselines3, which
it imports.
"""

from rover_gym.envs.batch import BatchSnapshot, RoverBatch
from rover_gym.envs.vector.pushed_vector import RandomPushesVector
from rover_gym.envs.vector.sensed_vector import (
    RoverCourseVectorEnv,
    RoverGrainsVectorEnv,
    SensorVectorObservation,
    make_course_vector,
    make_grains_vector,
    make_rover_vector,
)
from rover_gym.envs.vector.throughput import ExploringSpeed, VectorSpeed, measure_exploring, measure_speed
from rover_gym.envs.vector.vector_env import RoverVectorEnv

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
