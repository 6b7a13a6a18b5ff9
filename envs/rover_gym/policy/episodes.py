"""Runs whole episodes of a rover environment under a policy and records their results."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv


class Policy(Protocol):
    """Any object with stable-baselines3's `predict`."""

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """Returns the action for an observation, and the state for the next call."""


@dataclass(frozen=True)
class Episode:
    """The result of one episode.

    Attributes:
        seed: Seed of the reset.
        success: Whether the goal was reached.
        end: Reason for the end: the environment's termination, or "time" if truncated.
        distance: Path length of the trunk's origin, m.
        distance_to_goal: Remaining distance to the goal, m.
        time: Simulated time, s.
        energy: Work of the wheel motors, driving or braking, J.
        slip: Mean slip ratio.
        reward: Sum of the rewards.
        real_time_factor: Simulated time over the wall time of policy and environment.
    """

    seed: int
    success: bool
    end: str
    distance: float
    distance_to_goal: float
    time: float
    energy: float
    slip: float
    reward: float
    real_time_factor: float


def run_episode(
    env: gym.Env[Any, Any],
    policy: Policy,
    seed: int,
    *,
    options: Mapping[str, Any] | None = None,
    on_step: Callable[[RoverEnv, Mapping[str, Any]], None] = lambda _env, _info: None,
) -> Episode:
    """Runs one episode to its end.

    Args:
        env: A rover environment with a time limit, wrapped or not.
        policy: The policy that chooses the actions.
        seed: Seed of the reset.
        options: Options of the reset.
        on_step: Called with the environment and `info` after the reset and after each step; not timed.
    """
    rover = env.unwrapped
    if not isinstance(rover, RoverEnv):
        raise TypeError(f"a rover environment is needed, not {rover!r}")
    observation, info = env.reset(seed=seed, options=None if options is None else dict(options))
    on_step(rover, info)
    position = rover.simulation.q[:3]
    distance = slip = reward = wall_time = 0.0
    steps = 0
    state = None
    terminated = truncated = False
    while not (terminated or truncated):
        start = time.perf_counter()
        action, state = policy.predict(observation, state)
        observation, step_reward, terminated, truncated, info = env.step(action)
        wall_time += time.perf_counter() - start
        on_step(rover, info)
        before, position = position, rover.simulation.q[:3]
        distance += float(np.linalg.norm(position - before))
        slip += info["slip_ratio"]
        reward += float(step_reward)
        steps += 1
    return Episode(
        seed=seed,
        success=info["success"],
        end=info["termination"] or "time",
        distance=distance,
        distance_to_goal=info["distance_to_goal"],
        time=info["time"],
        energy=info["energy"],
        slip=slip / steps,
        reward=reward,
        real_time_factor=info["time"] / wall_time,
    )
