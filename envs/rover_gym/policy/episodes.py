"""Whole episodes of a rover environment under a policy, and what they came to."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv


class Policy(Protocol):
    """Anything with stable-baselines3's `predict`."""

    def predict(
        self, observation: npt.NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """The action for an observation, and a state to hand in next time."""


@dataclass(frozen=True)
class Episode:
    """What one episode came to.

    Attributes:
        seed: Seed of the reset.
        success: Whether the goal was reached.
        end: Why it ended: the environment's termination, or "time" where it was truncated.
        distance: Way of the trunk's origin, m.
        distance_to_goal: What was left, m.
        time: Simulated time, s.
        energy: Work through the wheel motors, driving or braking, J.
        slip: Mean slip ratio.
        reward: Sum of the rewards.
        real_time_factor: Simulated time over the time that policy and environment took.
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
        policy: Chooses the actions.
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
