"""Registers the environments of this package with Gymnasium."""

from collections.abc import Mapping

import gymnasium as gym

from rover_gym.env.task import MAX_EPISODE_STEPS

#: One class, by name and arguments.
ENVIRONMENTS: Mapping[str, Mapping[str, str]] = {"Rover-v0": {}, "RoverRocks-v0": {"terrain": "sphere_field"}}


def register_environments() -> None:
    """Makes the environments known to `gymnasium.make`; a second call changes nothing."""
    for name, arguments in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                id=name,
                entry_point="rover_gym.env:RoverEnv",
                vector_entry_point="rover_gym.vector:RoverVectorEnv",
                max_episode_steps=MAX_EPISODE_STEPS,
                kwargs=dict(arguments),
            )
