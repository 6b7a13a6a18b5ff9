"""Every trainer steps its rovers together in the core, without asking for it."""

import os

import gymnasium as gym
import pytest

import rover_gym  # noqa: F401 - registers the environments
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.vector import RoverVectorEnv


@pytest.mark.parametrize("name", [name for name, known in ENVIRONMENTS.items() if known.vector_entry_point])
def test_make_vec_makes_the_vector_of_the_core(name: str) -> None:
    envs = gym.make_vec(name, 64).unwrapped
    assert isinstance(envs, RoverVectorEnv)
    assert envs.batch.episodes.threads == len(os.sched_getaffinity(0))
    assert envs.prototype.simulation.settings["variant"] == "linearised"
