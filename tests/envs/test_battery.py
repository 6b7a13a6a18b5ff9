"""A battery that the wheel motors draw on: charge in observation and info, and the end when it is empty."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import PDPolicy, RoverEnv
from rover_gym.policy import drive_all, summarise
from rover_gym.vector import RoverVectorEnv

FORWARD = np.array([0.3] * 6 + [0.0] * 6, np.float32)


def test_the_charge_falls_by_the_work_of_the_motors_until_none_is_left() -> None:
    env, plain = RoverEnv(battery=400.0), RoverEnv()
    observation, info = env.reset(seed=0)
    plain.reset(seed=0)
    layout = env.observation_layout
    assert info["charge"] == 400.0
    assert layout.split(observation)["charge"][0] == 1.0
    for _ in range(100):
        observation, _, terminated, _, info = env.step(FORWARD)
        *_, other = plain.step(FORWARD)
        assert info["energy"] == other["energy"], "the battery changes nothing before it is empty"
        assert info["charge"] == max(0.0, 400.0 - info["energy"])
        assert layout.split(observation)["charge"][0] == pytest.approx(info["charge"] / 400.0)
        assert terminated == (info["energy"] >= 400.0)
        if terminated:
            break
    assert info["termination"] == "battery_empty"
    assert not info["success"]
    assert info["reward_terms"]["failure"] == -10.0
    assert info["charge"] == 0.0


def test_a_goal_reached_with_the_last_joule_counts() -> None:
    for battery, end in ((1.0, "battery_empty"), (1e6, "goal")):
        env = RoverEnv(battery=battery, goal_distance=0.55, goal_bearing_deg=0.0)
        env.reset(seed=0)
        info: dict[str, Any] = {"termination": ""}
        while not info["termination"]:
            *_, info = env.step(FORWARD)
        assert info["termination"] == end
    env = RoverEnv(battery=1.0, goal_distance=0.4, goal_bearing_deg=0.0)
    env.reset(seed=0)
    *_, info = env.step(np.array([1.0] * 6 + [0.0] * 6, np.float32))
    assert info["energy"] >= 1.0
    assert info["termination"] == "goal"


def test_without_a_battery_nothing_is_told_of_one() -> None:
    env = RoverEnv()
    assert "charge" not in env.observation_layout
    assert "charge" not in env.reset(seed=0)[1]


def test_a_vector_ends_as_single_rovers_do() -> None:
    envs: Any = gym.make_vec("RoverBattery-v0", 2, battery=300.0)
    assert type(envs) is RoverVectorEnv
    envs.reset(seed=0)
    alone = gym.make("RoverBattery-v0", battery=300.0)
    alone.reset(seed=1)
    for _ in range(100):
        *_, infos = envs.step(np.stack([FORWARD, FORWARD]))
        *_, terminated, _, info = alone.step(FORWARD)
        assert infos["charge"][1] == info["charge"]
        assert infos["termination"][1] == info["termination"]
        if terminated:
            break
    assert info["termination"] == "battery_empty"


def test_evaluations_count_empty_batteries() -> None:
    drives = drive_all(PDPolicy, [0, 1, 2], arguments={"battery": 100.0})
    summary = summarise("pd", drives)
    assert summary.ends["battery_empty"] == 3
    assert sum(summary.ends.values()) == summary.episodes
    assert "battery_empty" not in summarise("pd", drive_all(PDPolicy, [0], arguments={})).ends
