"""Registers the environments of this package with Gymnasium."""

import gymnasium as gym

#: Steps until truncation: 60 s at the default control frequency of 20 Hz.
MAX_EPISODE_STEPS = 1200


def register_environments() -> None:
    """Makes `Rover-v0` known to `gymnasium.make`; a second call changes nothing."""
    if "Rover-v0" not in gym.registry:
        gym.register(
            id="Rover-v0",
            entry_point="rover_gym.env:RoverEnv",
            max_episode_steps=MAX_EPISODE_STEPS,
        )
