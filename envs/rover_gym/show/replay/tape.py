"""Records an episode: the simulation, the environment's signals, and what the rover sees and intends."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.envs.reward_terms import WEIGHTS
from rover_gym.record.channels import Channel, RoverSampler, describe
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import OF_EPISODES
from rover_gym.show.replay.overlays import Overlays, live_overlays

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rover_gym.drive.commands.driven import Policy
    from rover_gym.envs.rover_env import RoverEnv


class Watched:
    """A policy, with what it carries from one prediction to the next.

    Attributes:
        policy: The policy; None where another program drives.
        state: What it carries; None before its first prediction of an episode.
    """

    def __init__(self, policy: Policy | None) -> None:
        self.policy, self.state = policy, None

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """The policy's action; its state is kept."""
        assert self.policy is not None  # noqa: S101 - only a policy is asked
        action, self.state = self.policy.predict(observation, state, episode_start)
        return action, self.state

    def begin(self) -> None:
        """Forgets the last episode."""
        self.state = None


class Tape:
    """The recording of one episode.

    Args:
        path: The file to write.
        rover: The environment after its reset.
        title: Title of the run.
        seed: Seed of the reset.
        arguments: Arguments of the environment.
        driver: Who drives.
        sensors: Names of sensors that are recorded, too.
    """

    def __init__(
        self,
        path: Path,
        rover: RoverEnv,
        title: str,
        seed: int,
        arguments: Mapping[str, Any],
        driver: Watched,
        sensors: Sequence[str] = (),
    ) -> None:
        self._sampler, self._driver, self._sensors = RoverSampler(rover.model), driver, sensors
        overlays = self._overlays(rover)
        channels = [
            *self._sampler.channels,
            *OF_EPISODES,
            Channel("reward_terms", "1", "terms of the step's reward", (len(WEIGHTS),), tuple(WEIGHTS)),
            *overlays.tracks(),
        ]
        scene = {**arguments, **asdict(rover.start), **_rocks(rover), "control_period": rover.dt}
        scene |= {"goal_tolerance": rover.goal_tolerance, **overlays.facts()}
        attributes = describe(rover.simulation, f"an episode of {title}", scene, seed=seed)
        self.recorder = Recorder(path, channels, attributes, terrain=rover.simulation.terrain)

    def _overlays(self, rover: RoverEnv) -> Overlays:
        return live_overlays(rover, self._driver.policy, self._driver.state, self._sensors)

    def append(self, rover: RoverEnv, info: Mapping[str, Any]) -> None:
        """Adds the environment's current state."""
        solver = info["solver"]
        row = {
            **self._sampler.row(rover.simulation, residual=solver["residual"], iterations=solver["iterations"]),
            "distance_to_goal": info["distance_to_goal"],
            "slip_ratio": info["slip_ratio"],
            "motor_energy": info["energy"],
            "reward_terms": [info["reward_terms"][name] for name in WEIGHTS],
            **self._overlays(rover).row(),
        }
        self.recorder.append(row)


def _rocks(rover: RoverEnv) -> dict[str, Any]:
    """Arguments of `SphereField.rocks`, for a scene's description."""
    return {} if rover.rocks is None else {"rocks": asdict(rover.rocks)}
