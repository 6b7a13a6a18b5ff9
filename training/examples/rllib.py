"""Trains Rover-v0 by commands with Ray RLlib's PPO, each env runner with several rovers in one vector of the core.

    python training/examples/rllib.py --workers 2                       # a Ray of its own on this machine
    python training/examples/rllib.py --address auto --workers 32       # the cluster that this machine belongs to

Needs the extra `rllib`, which pins its own Gymnasium: use a separate virtual environment (`make train-rllib`).
"""

from typing import Any

import gymnasium as gym
import ray
import typer
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, EPISODE_RETURN_MEAN
from ray.tune.registry import register_env

import rover_gym  # noqa: F401 - registers the environments


def make_rovers(config: dict[str, Any]) -> gym.Env[Any, Any] | gym.vector.VectorEnv[Any, Any, Any]:
    """Makes an env runner's rovers: RLlib gives `num_envs` where `gym_env_vectorize_mode` is "vector_entry_point"."""
    n = config.pop("num_envs", None)
    return gym.make("RoverCommand-v0", **config) if n is None else gym.make_vec("RoverCommand-v0", n, **config)


def configuration(workers: int, envs: int, batch: int, environment: dict[str, Any], seed: int) -> PPOConfig:
    """PPO over env runners that each step `envs` rovers in one vector."""
    vectors = {"num_envs_per_env_runner": envs, "gym_env_vectorize_mode": "vector_entry_point"}
    rates = {"lr": 1e-3, "gamma": 0.97, "lambda_": 0.95, "minibatch_size": 512, "num_epochs": 6}
    config = PPOConfig().environment("Rover", env_config=environment).framework("torch").debugging(seed=seed)
    config = config.env_runners(num_env_runners=workers, num_cpus_per_env_runner=1, **vectors)
    return config.learners(num_learners=0).training(train_batch_size_per_learner=batch, **rates)


def train(
    workers: int = 2, envs: int = 8, iterations: int = 20, batch: int = 2048, seed: int = 1, address: str | None = None
) -> None:
    """Train, and print the return and the decisions a second while sampling."""
    ray.init(address=address, log_to_driver=False)
    register_env("Rover", make_rovers)
    algorithm = configuration(workers, envs, batch, {"threads": 1}, seed).build_algo()
    for iteration in range(iterations):
        result = algorithm.train()
        found, seconds = result[ENV_RUNNER_RESULTS], float(result["timers"]["env_runner_sampling_timer"])
        rate = found["num_env_steps_sampled"] / seconds
        typer.echo(f"{iteration}: return {found.get(EPISODE_RETURN_MEAN)}, {rate:.0f} decisions/s while sampling")
    algorithm.stop()
    ray.shutdown()


if __name__ == "__main__":
    typer.run(train)
