"""Records an episode: the simulation, the environment's signals, and what the rover sees and intends."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.reward_terms import WEIGHTS
from rover_gym.policy.scan_policy import PLAN_POINTS
from rover_gym.record.channels import Channel, RoverSampler, describe
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import OF_EPISODES
from rover_gym.replay.sights import PATH, distances, sensor_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from rover_gym.env.rover_env import RoverEnv
    from rover_gym.policy.named_policy import Policy


class Watched:
    """A policy that can be asked for the path which it follows, where it plans one.

    Attributes:
        arcs: (n, points, 2) what it chooses from, ahead and to the right of the trunk, m; None where it does not say.
        plans: Whether it plans a path.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy, self._state = policy, None
        self.plans = hasattr(policy, "plan")
        choices = getattr(policy, "choices", None)
        self.arcs: npt.NDArray[np.float64] | None = None if choices is None else choices()

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """As the policy's; keeps the state."""
        action, self._state = self._policy.predict(observation, state, episode_start)
        return action, self._state

    def begin(self) -> None:
        """Forgets the last episode."""
        self._state = None

    def path(self) -> npt.NDArray[np.float64]:
        """(points, 2) the path that it follows, m; nan where it has none."""
        found = self._policy.plan(self._state) if self.plans else None  # type: ignore[attr-defined]
        return np.full((PLAN_POINTS, 2), np.nan) if found is None else found


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
        channels = [
            *self._sampler.channels,
            *OF_EPISODES,
            Channel("reward_terms", "1", "terms of the step's reward", (len(WEIGHTS),), tuple(WEIGHTS)),
        ]
        for name in sensors:
            n = int(np.prod(sensor_of(name, rover.model).bounds(rover.model)[0].shape))
            channels.append(Channel(name, "m", f"distances that the {name} sensor measures", (n,)))
        if driver.plans:
            what = "planned path, ahead and to the right of the trunk"
            channels.append(Channel(PATH, "m", what, (2 * PLAN_POINTS,)))
        scene = {**arguments, **asdict(rover.start), **_rocks(rover), "control_period": rover.dt}
        scene["goal_tolerance"] = rover.goal_tolerance
        if driver.arcs is not None:
            scene["arcs"] = np.round(driver.arcs, 4).tolist()
        attributes = describe(rover.simulation, f"an episode of {title}", scene, seed=seed)
        self.recorder = Recorder(path, channels, attributes, terrain=rover.simulation.terrain)

    def append(self, rover: RoverEnv, info: Mapping[str, Any]) -> None:
        """Adds the environment's current state."""
        solver = info["solver"]
        row = {
            **self._sampler.row(rover.simulation, residual=solver["residual"], iterations=solver["iterations"]),
            "distance_to_goal": info["distance_to_goal"],
            "slip_ratio": info["slip_ratio"],
            "motor_energy": info["energy"],
            "reward_terms": [info["reward_terms"][name] for name in WEIGHTS],
            **{name: distances(name, rover.simulation) for name in self._sensors},
        }
        self.recorder.append(row | {PATH: self._driver.path().ravel()} if self._driver.plans else row)


def _rocks(rover: RoverEnv) -> dict[str, Any]:
    """Arguments of `SphereField.rocks`, for a scene's description."""
    return {} if rover.rocks is None else {"rocks": asdict(rover.rocks)}
