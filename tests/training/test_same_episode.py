"""A batch of commanded rovers gives the episodes of single ones, bit for bit."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

from stable_baselines3.common.vec_env import VecMonitor

from rover_gym.drive import CommandController, CommandLimits, Features
from rover_gym.envs.tasks import CommandVectorEnv, DriveByCommand
from rover_gym.envs.vector.sb3 import RoverVecEnv
from rover_gym.learn.command_vec_env import CommandVecEnv

ROVERS, SEED, LIMIT, REPEAT = 3, 70, 100, 3
NOISY: dict[str, Any] = {"height_scan": (8, 6, 0.2), "friction": (0.5, 0.8), "observation_noise": 0.01}
GROUNDS: dict[str, dict[str, Any]] = {
    "plane": {"terrain": "plane", "goal_distance": (2.0, 4.0), "control_frequency": 10},
    "rocks": {"terrain": "rocks", "goal_distance": (2.0, 4.0), "difficulty": 1.0, **NOISY},
}


def pool_of(ground: str) -> int:
    return 2 if ground == "rocks" else 1


def stable_baselines3_vector(ground: str) -> CommandVecEnv:
    rovers = RoverVecEnv(ROVERS, threads=1, max_episode_steps=LIMIT, **GROUNDS[ground])
    rovers.seed(SEED)
    one = rovers.prototype
    controller = CommandController(one, CommandLimits(response=0.2))
    return CommandVecEnv(VecMonitor(rovers), Features(one, pool_of(ground)), controller, REPEAT)


def commands(i: int) -> Any:
    """The commands of rover i, the same in every run."""
    rng = np.random.default_rng(i)
    while True:
        yield np.array([0.8, 0.0, 0.0], np.float32) + rng.uniform(-0.2, 0.2, 3).astype(np.float32)


def alone(ground: str, i: int) -> list[tuple[bytes, float]]:
    """Features and reward of each decision of an episode of `DriveByCommand`."""
    made = gym.make("Rover-v0", max_episode_steps=LIMIT, **GROUNDS[ground])
    env = DriveByCommand(made, repeat=REPEAT, pool=pool_of(ground), response=0.2)
    features, _ = env.reset(seed=SEED + i)
    episode = [(features.tobytes(), 0.0)]
    for command in commands(i):
        features, reward, terminated, truncated, _ = env.step(command)
        episode.append((features.tobytes(), float(reward)))
        if terminated or truncated:
            return episode
    raise AssertionError


@pytest.mark.parametrize("ground", list(GROUNDS))
@pytest.mark.parametrize("kind", ["gymnasium", "stable-baselines3"])
def test_the_batch_gives_the_episodes_of_single_rovers(kind: str, ground: str) -> None:
    if kind == "gymnasium":
        rovers: Any = gym.make_vec("Rover-v0", ROVERS, threads=1, max_episode_steps=LIMIT, **GROUNDS[ground])
        envs: Any = CommandVectorEnv(rovers, repeat=REPEAT, pool=pool_of(ground), response=0.2)
        features = envs.reset(seed=SEED)[0]
    else:
        envs = stable_baselines3_vector(ground)
        features = envs.reset()
    expected = [alone(ground, i) for i in range(ROVERS)]
    given = [commands(i) for i in range(ROVERS)]
    for i, episode in enumerate(expected):
        assert features[i].tobytes() == episode[0][0]
    ended = [False] * ROVERS
    decision = 0
    while not all(ended):
        decision += 1
        actions = np.stack([next(rng) for rng in given])
        if kind == "gymnasium":
            features, rewards, terminated, truncated, _ = envs.step(actions)
            done = terminated | truncated
        else:
            features, rewards, done, infos = envs.step(actions)
        for i, episode in enumerate(expected):
            if ended[i]:
                continue
            ended[i] = decision == len(episode) - 1
            assert bool(done[i]) == ended[i]
            seen = infos[i]["terminal_observation"] if kind != "gymnasium" and ended[i] else features[i]
            assert seen.tobytes() == episode[decision][0]
            # Stable-Baselines3 has rewards in single precision.
            assert float(rewards[i]) == pytest.approx(episode[decision][1], rel=1e-5, abs=1e-5)
            if kind == "gymnasium":
                assert float(rewards[i]) == episode[decision][1]
