"""Films of policies: episodes in one mp4, with the time and the outcome."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.task import MAX_EPISODE_STEPS
from rover_gym.policy.episodes import Episode, Policy, run_episode
from rover_gym.record.outcomes import outcome_words
from rover_gym.rendering.captions import captioned
from rover_gym.rendering.video import VideoWriter

ENDING = 20  # frames for which the outcome stands, 1 s


class EpisodeFilm:
    """Films episodes one after the other, each with its time and, at its end, its outcome; a context manager.

    Args:
        path: The file, `.mp4`; its folder is made.
        fps: Frames per second.
        title: What drives where, in the first line of every frame.

    Raises:
        OptionError: The file name has another extension.
        MissingExtraError: The extra `render` is not installed.
    """

    def __init__(self, path: str | Path, fps: float, title: str) -> None:
        self._writer, self._title = VideoWriter(path, fps), title
        self._last: npt.NDArray[np.uint8] | None = None

    def show(self, rover: RoverEnv, seed: int, time: float) -> None:
        """Adds the environment's current picture, at a time, s."""
        if (frame := rover.render()) is not None:
            self._last = frame
            self._writer.append(captioned(frame, (f"{self._title}, seed {seed}", f"{time:.2f} s")))

    def end(self, episode: Episode) -> None:
        """Holds the last picture with the outcome."""
        if self._last is not None:
            outcome = f"{outcome_words(episode.end)} after {episode.time:.2f} s"
            frame = captioned(self._last, (f"{self._title}, seed {episode.seed}", outcome))
            for _ in range(ENDING):
                self._writer.append(frame)
            self._last = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()


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
        with EpisodeFilm(path, env.metadata["render_fps"], path.stem) as film:

            def on_step(rover: RoverEnv, info: Mapping[str, Any]) -> None:
                film.show(rover, seed, info["time"])

            episode = run_episode(env, make_policy(env), seed, on_step=on_step)
            film.end(episode)
            return episode
    finally:
        env.close()
