"""Fixtures of the environment's tests."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import pytest

from rover_gym import RoverEnv


@pytest.fixture
def env() -> Iterator[RoverEnv]:
    """A bare `Rover-v0`, reset with seed 0."""
    with gym.make("Rover-v0") as made:
        rover: Any = made.unwrapped
        rover.reset(seed=0)
        yield rover
