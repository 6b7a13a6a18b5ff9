"""The vector environment of stable-baselines3 keeps its contract, which is that of `DummyVecEnv`."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from equal_bits import bits
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from rover_gym import OptionError, PDPolicy, RoverEnv
from rover_gym.drive import CommandController, Features
from rover_gym.envs.vector.sb3 import RoverVecEnv
from rover_gym.learn.command_vec_env import CommandVecEnv

LIMIT = 12
SCENES: list[dict[str, Any]] = [
    {"goal_distance": (0.6, 1.0)},
    {"terrain": "rocks", "height_scan": (5, 3, 0.4), "difficulty": (0.0, 1.0), "observation_noise": 0.02},
]


def dummy(n: int, **arguments: Any) -> DummyVecEnv:
    return DummyVecEnv([lambda: gym.wrappers.TimeLimit(RoverEnv(**arguments), LIMIT)] * n)


def actions(n: int, steps: int = 30) -> Any:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (steps, n, 12)).astype(np.float32)


@pytest.mark.parametrize("arguments", SCENES, ids=["plane", "rocks"])
@pytest.mark.parametrize("threads", [1, 2])
def test_it_is_dummy_vec_env_bit_for_bit(arguments: dict[str, Any], threads: int) -> None:
    ours = RoverVecEnv(3, threads=threads, max_episode_steps=LIMIT, **arguments)
    theirs = dummy(3, **arguments)
    assert ours.seed(5) == theirs.seed(5) == [5, 6, 7]
    assert ours.reset().tobytes() == theirs.reset().tobytes()
    assert ours.reset_infos == theirs.reset_infos
    ends = set()
    for action in actions(3):
        one, other = ours.step(action), theirs.step(action)
        assert bits(one[:3]) == bits(other[:3])
        for done, info, expected in zip(one[2], one[3], other[3], strict=True):
            assert info["TimeLimit.truncated"] == expected["TimeLimit.truncated"]
            if done:
                assert bits(info) == bits(expected)
                ends.add(info["termination"] or "time")
            else:
                assert set(info) == {"TimeLimit.truncated"}
        assert ours.reset_infos == theirs.reset_infos
    assert "time" in ends


def test_terminal_observation_and_time_limit() -> None:
    env = RoverVecEnv(2, max_episode_steps=3)
    env.seed(0)
    env.set_options([{"goal": (0.1, 0.0)}, {"goal": (9.0, 0.0)}])
    env.reset()
    zero = np.zeros((2, 12), np.float32)
    observation, reward, dones, infos = env.step(zero)
    assert dones.tolist() == [True, False]
    assert infos[0]["TimeLimit.truncated"] is False
    assert infos[0]["is_success"] is True
    assert reward[0] > 9.0
    layout = env.prototype.observation_layout
    assert layout.split(infos[0]["terminal_observation"])["goal_distance"] == pytest.approx(0.1, abs=1e-5)
    assert layout.split(observation[0])["goal_distance"] >= 5.0, "the next episode has begun"
    env.step(zero)
    _, _, dones, infos = env.step(zero)
    assert dones.tolist() == [False, True]
    assert infos[1]["TimeLimit.truncated"] is True
    assert infos[1]["is_success"] is False


def test_seeds_and_options_are_used_once() -> None:
    env = RoverVecEnv(2, terrain="rocks")
    env.seed(3)
    env.set_options({"difficulty": 0.9})
    first = env.reset()
    assert env.get_attr("difficulty") == [0.9, 0.9]
    env.reset()
    assert env.get_attr("difficulty") == [0.5, 0.5]
    env.seed(3)
    env.set_options({"difficulty": 0.9})
    assert env.reset().tobytes() == first.tobytes()
    with pytest.raises(OptionError):
        env.set_options({"colour": 1})


def test_difficulty_by_env_method() -> None:
    env = RoverVecEnv(3, terrain="rocks", max_episode_steps=2)
    env.seed(0)
    env.reset()
    env.env_method("set_difficulty", 0.1, indices=[0, 2])
    env.env_method("set_difficulty", (0.6, 0.7), indices=1)
    for action in actions(3, steps=2):
        env.step(action)
    first, second, third = env.get_attr("difficulty")
    assert first == third == 0.1
    assert 0.6 <= second <= 0.7
    assert env.reset_infos[1]["difficulty"] == second
    for bad in (2.5, (0.9, 0.1), "hard"):
        with pytest.raises(OptionError) as caught:
            env.env_method("set_difficulty", bad)
        assert caught.value.field is not None
    with pytest.raises(OptionError):
        RoverVecEnv(1).env_method("set_difficulty", 0.5)


def test_attributes() -> None:
    env = RoverVecEnv(2)
    env.seed(0)
    env.reset()
    assert env.render_mode is None
    assert env.get_attr("goal_tolerance") == [0.5, 0.5], "what RoverEnv has is found too"
    assert env.env_is_wrapped(Monitor) == [False, False]
    assert env.has_attr("goal")
    assert not env.has_attr("colour")
    env.set_attr("colour", "red", indices=1)
    with pytest.raises(AttributeError):
        env.get_attr("colour")
    assert env.get_attr("colour", indices=1) == ["red"]
    with pytest.raises(AttributeError):
        env.set_attr("difficulty", 0.5)
    env.close()


def test_policies_of_the_package_drive_it() -> None:
    env = VecMonitor(RoverVecEnv(2, goal_distance=2.0), info_keywords=("is_success", "energy"))
    env.seed(0)
    policy: Any = PDPolicy(env)
    returns, lengths = evaluate_policy(policy, env, n_eval_episodes=2, return_episode_rewards=True)
    assert min(returns) > 10.0
    assert max(lengths) < 200


def test_ppo_learns_from_it_without_complaint() -> None:
    torch.set_num_threads(1)  # the networks are small: a second thread slows them down
    env = VecNormalize(VecMonitor(RoverVecEnv(4, max_episode_steps=8), info_keywords=("is_success",)))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(64)
    assert any(not np.array_equal(a, b.detach()) for a, b in zip(before, model.policy.parameters(), strict=True))
    assert len(model.ep_info_buffer) == 8
    assert all(np.isfinite(episode["r"]) and episode["l"] == 8 for episode in model.ep_info_buffer)
    assert all("is_success" in episode for episode in model.ep_info_buffer)


SCANNED: dict[str, Any] = {"terrain": "rocks", "height_scan": (6, 4, 0.3), "difficulty": 1.0}


class Opaque(VecMonitor):
    """Hides what it wraps, so that every step takes its scan."""

    @property
    def unwrapped(self) -> Any:
        """Nothing that a command would know."""
        return self


def test_training_takes_a_scan_once_a_command() -> None:
    rovers = [RoverVecEnv(2, threads=1, max_episode_steps=10, **SCANNED) for _ in range(2)]
    prototype = rovers[0].prototype
    features, controller = Features(prototype), CommandController(prototype)
    commands = np.array([[1.0, 0.2, 0.0], [0.8, -0.2, 0.0]], np.float32)
    rare = CommandVecEnv(VecMonitor(rovers[0]), features, controller, 3)
    often = CommandVecEnv(Opaque(rovers[1]), features, controller, 3)
    for venv in (rare, often):
        venv.seed(1)
    assert rare.reset().tobytes() == often.reset().tobytes()
    for _ in range(6):
        ours, theirs = rare.step(commands), often.step(commands)
        assert bits(ours[:3]) == bits(theirs[:3])
        for info, expected in zip(ours[3], theirs[3], strict=True):
            if "terminal_observation" in expected:
                assert info["terminal_observation"].tobytes() == expected["terminal_observation"].tobytes()
