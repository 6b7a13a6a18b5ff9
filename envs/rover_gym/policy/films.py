"""Films of policies: one episode, one mp4."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym

from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.task import MAX_EPISODE_STEPS
from rover_gym.policy.episodes import Episode, Policy, run_episode
from rover_gym.rendering.video import VideoWriter


def film_episode(path: Path, make_policy: Callable[[Any], Policy], arguments: Mapping[str, Any], seed: int) -> Episode:
    """Drives one episode of at most 60 s and films it.

    Args:
        path: The file, `.mp4`; its folder is made.
        make_policy: Makes the policy from an environment.
        arguments: Arguments of `RoverEnv`.
        seed: Seed of the reset.

    Raises:
        MissingExtraError: The extra `render` is not installed.
        RoverGymError: An argument is out of range.
    """
    rendering: dict[str, Any] = {"render_mode": "rgb_array", "render_options": {"antialiasing": True}}
    limit = round(MAX_EPISODE_STEPS * 0.05 * arguments.get("control_frequency", 20.0))
    env = gym.make("Rover-v0", max_episode_steps=limit, **arguments, **rendering)
    try:
        with VideoWriter(path, env.metadata["render_fps"]) as film:

            def on_step(rover: RoverEnv, _info: Mapping[str, Any]) -> None:
                if (frame := rover.render()) is not None:
                    film.append(frame)

            return run_episode(env, make_policy(env), seed, on_step=on_step)
    finally:
        env.close()
