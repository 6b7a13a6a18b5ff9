"""Trains on the actions and observations of Rover-v0 themselves, with stable-baselines3's PPO or SAC.

python training/examples/raw_actions.py --algorithm PPO --task rocks --seed 1
"""

from pathlib import Path
from typing import Any

import torch
import typer
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from rover_gym.drive import drive_all, summarise
from rover_gym.envs.vector.sb3 import RoverVecEnv
from rover_gym.learn.raw_policy import ALGORITHMS, RawPolicy

TASKS: dict[str, dict[str, Any]] = {
    "plane": {},
    "rocks": {"terrain": "rocks", "difficulty": 0.5, "height_scan": True},
}
#: Coarser physics than in evaluations, which run at the defaults.
COARSE: dict[str, Any] = {"time_step": 0.02, "solver_options": {"tolerance": 1e-4, "max_iterations": 20}}
#: Rovers, and decisions of all together, by task.
SIZES = {"PPO": (64, {"plane": 500_000, "rocks": 1_000_000}), "SAC": (16, {"plane": 50_000, "rocks": 100_000})}
HYPERPARAMETERS: dict[str, dict[str, Any]] = {
    "PPO": {
        "n_steps": 64,
        "batch_size": 1024,
        "n_epochs": 6,
        "learning_rate": lambda remaining: 2e-4 + 8e-4 * remaining,
        "policy_kwargs": {"net_arch": [64, 64], "log_std_init": -1.0},
    },
    "SAC": {
        "learning_rate": 1e-3,
        "buffer_size": 300_000,
        "learning_starts": 5_000,
        "tau": 0.02,
        "gradient_steps": 4,  # for 16 decisions
        "policy_kwargs": {"net_arch": [128, 128]},
    },
}


def train(
    algorithm: str = "PPO",
    task: str = "plane",
    seed: int = 1,
    steps: int | None = None,
    episodes: int = 200,
    output: Path = Path("runs/raw"),
) -> None:
    """Train, save the policy, and drive it over fields that no training draws."""
    torch.set_num_threads(1)  # the networks are small
    environment = {"control_frequency": 5.0, **TASKS[task]}  # an action lasts 0.2 s
    n, totals = SIZES[algorithm]
    rovers = RoverVecEnv(n, threads=1, max_episode_steps=150, **environment, **COARSE)
    rovers.seed(1000 * seed)
    envs = VecNormalize(VecMonitor(rovers), clip_obs=5.0, gamma=0.97)
    given = {"seed": seed, "gamma": 0.97, "device": "cpu", **HYPERPARAMETERS[algorithm]}
    model = ALGORITHMS[algorithm]("MlpPolicy", envs, **given)
    model.learn(totals[task] if steps is None else steps)
    policy = RawPolicy(model, envs, environment)
    policy.save(output)
    fields = range(1_000_000, 1_000_000 + episodes)
    summary = summarise(algorithm, drive_all(lambda _env: policy, fields, arguments=environment))
    typer.echo(f"{summary.successes} of {episodes} goals, {summary.energy_per_metre.value:.0f} J/m; {output}")


if __name__ == "__main__":
    typer.run(train)
