"""Trains Rover-v0 with Ray RLlib's PPO over the env runners of a Ray cluster and reports steps per second.

    python training/train_rllib.py --workers 2                       # a Ray of its own on this machine
    python training/train_rllib.py --address auto --workers 32       # the cluster that this machine belongs to

Needs the extra `rllib`, which pins its own Gymnasium: use a separate virtual environment (`make train-rllib`).
"""

import json
import os
import time
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import ray
import typer
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, EPISODE_RETURN_MEAN
from ray.tune.registry import register_env

from rover_gym.policy import CommandVectorEnv, DriveByCommand
from rover_gym.vector import RoverVectorEnv

# Control periods per decision: 0.3 s, as in the configuration `plane`.
REPEAT = 6


def make_rovers(config: dict[str, Any]) -> gym.Env[Any, Any] | gym.vector.VectorEnv[Any, Any, Any]:
    """Makes an env runner's rovers, `num_envs` of them in one vector that a single thread steps; without it one rover.

    RLlib gives the number where its `gym_env_vectorize_mode` is "vector_entry_point".
    """
    arguments = dict(config)
    command = arguments.pop("command", {})
    n = arguments.pop("num_envs", None)
    if n is None:
        return DriveByCommand(gym.make("rover_gym:Rover-v0", **arguments), **command)
    return CommandVectorEnv(RoverVectorEnv(n, threads=1, **arguments), **command)


def train(
    workers: Annotated[list[int] | None, typer.Option(min=1, help="Env runners; several are tried in turn.")] = None,
    envs: Annotated[int, typer.Option(min=1, help="Rovers of each env runner.")] = 8,
    iterations: Annotated[int, typer.Option(min=1, help="Of PPO.")] = 20,
    batch: Annotated[int, typer.Option(min=128, help="Decisions an iteration.")] = 2048,
    rocks: Annotated[bool, typer.Option("--rocks", help="Among rocks, with a height scan.")] = False,
    address: Annotated[str | None, typer.Option(help="Of a running cluster; a local one if not given.")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of report and checkpoints.")] = Path(
        "runs/rllib"
    ),
) -> None:
    """Train and print the throughput."""
    # One thread per process: the networks are small.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # Ray's own default lets its workers wait for everything else on the machine.
    os.environ.setdefault("RAY_worker_niceness", "0")
    ray.init(address=address, num_cpus=None if address else max(3, os.cpu_count() or 1), log_to_driver=False)
    register_env("Rover", make_rovers)
    environment: dict[str, Any] = {"command": {"repeat": REPEAT}, "max_episode_steps": 600}
    if rocks:
        environment |= {"terrain": "rocks", "height_scan": (32, 16, 0.1)}
        environment["command"] |= {"guided": True, "pool": 2}

    rows = []
    for count in workers or [2]:
        folder = output.absolute() / f"workers-{count}"
        row = _train_once(count, envs, iterations, batch, environment, seed, folder)
        rows.append(row)
        typer.echo(
            f"{count} env runners: {row['decisions_per_second']:.0f} decisions, {row['steps_per_second']:.0f} steps of "
            f"the environment a second while sampling; mean return {row['return']}"
        )
    ray.shutdown()
    report = output / "throughput.json"
    report.write_text(json.dumps({"environment": environment, "envs": envs, "rows": rows}, indent=2) + "\n", "utf-8")
    typer.echo(f"written: {report}")


def configuration(workers: int, envs: int, batch: int, environment: dict[str, Any], seed: int) -> PPOConfig:
    """PPO over env runners that each step `envs` rovers in one vector."""
    return (
        PPOConfig()
        .environment("Rover", env_config=environment)
        .framework("torch")
        .env_runners(
            num_env_runners=workers,
            num_envs_per_env_runner=envs,
            num_cpus_per_env_runner=1,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .learners(num_learners=0)
        .training(
            lr=1e-3, gamma=0.97, lambda_=0.95, train_batch_size_per_learner=batch, minibatch_size=512, num_epochs=6
        )
        .debugging(seed=seed)
    )


def _train_once(
    workers: int, envs: int, iterations: int, batch: int, environment: dict[str, Any], seed: int, folder: Path
) -> dict[str, Any]:
    """One training with this many env runners; the first iteration, in which they start, is not timed."""
    config = configuration(workers, envs, batch, environment, seed)
    algorithm = config.build_algo()
    sampling = learning = 0.0
    returns: list[float] = []
    decisions = 0
    for iteration in range(iterations + 1):
        start = time.perf_counter()
        result = algorithm.train()
        wall = time.perf_counter() - start
        found = result[ENV_RUNNER_RESULTS]
        if iteration:
            sample_time = float(result["timers"]["env_runner_sampling_timer"])
            sampling += sample_time
            learning += wall - sample_time
            decisions += int(found["num_env_steps_sampled"])
        if EPISODE_RETURN_MEAN in found:
            returns.append(float(found[EPISODE_RETURN_MEAN]))
    folder.mkdir(parents=True, exist_ok=True)
    algorithm.save_to_path(str(folder / "checkpoint"))
    algorithm.stop()
    return {
        "workers": workers,
        "decisions": decisions,
        "decisions_per_second": decisions / sampling,
        "steps_per_second": REPEAT * decisions / sampling,
        "sampling_seconds": sampling,
        "other_seconds": learning,
        "return": returns[-1] if returns else None,
    }


if __name__ == "__main__":
    typer.run(train)
