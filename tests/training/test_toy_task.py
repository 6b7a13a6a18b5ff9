"""A small task is really learned: from nothing, drive to a goal two metres ahead."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import torch
from stable_baselines3 import PPO

from rover_gym.learning.build import build_env, normalised
from rover_gym.learning.export import export
from rover_gym.learning.training_config import parse_config
from rover_gym.policy import PolicyCard, TrainedPolicy, drive_all, summarise

TOY = parse_config(
    {
        "environment": {
            "terrain": "plane",
            "goal_distance": 2.0,
            "goal_bearing_deg": [-30.0, 30.0],
            "control_frequency": 10.0,
            "time_step": 0.02,
            "solver_options": {"tolerance": 1e-4, "max_iterations": 20},
        },
        "total_steps": 12_288,
        "num_envs": 32,
        "max_episode_steps": 60,
        "repeat": 3,
        "guided": False,
    }
)


@pytest.mark.takes_long("the smoke training of PPO")
def test_driving_to_a_near_goal_is_learned(tmp_path: Path) -> None:
    torch.set_num_threads(1)
    envs = normalised(build_env(TOY, seed=11), TOY)
    model = PPO(
        "MlpPolicy",
        envs,
        n_steps=32,
        batch_size=256,
        n_epochs=8,
        learning_rate=1e-3,
        gamma=0.95,
        policy_kwargs={"net_arch": [32, 32], "log_std_init": -0.5},
        seed=11,
        device="cpu",
    )
    model.learn(TOY.total_steps)
    export(model, envs, TOY, tmp_path, {"seed": 11})

    arguments = {"goal_distance": 2.0, "goal_bearing_deg": (-30.0, 30.0)}
    card = PolicyCard.read(tmp_path / "policy.json")
    seeds = range(1_000_000, 1_000_040)
    untrained, trained = (
        summarise("", drive_all(make, seeds, arguments=arguments, max_episode_steps=120))
        for make in (lambda env: TrainedPolicy.untrained(env, card), lambda env: TrainedPolicy.load(env, tmp_path))
    )
    assert untrained.success.value == 0.0  # it stands still
    assert trained.success.value >= 0.9
    # Straight to the edge of the goal's circle: 1.5 m, at 1.2 m/s at most.
    assert 1.25 <= trained.time.value <= 4.0
    assert np.isfinite(trained.energy_per_metre.value)
