"""Trains on the actions and observations of Rover-v0 themselves, from nothing, with stable-baselines3's PPO or SAC.

    python training/train_raw.py --config training/configs/raw_ppo.yaml --task rocks --seed 1

The run's folder receives the configuration, versions and revision (`run.json`), one line per episode
(`curve.monitor.csv`), the evaluations (`evaluations.csv`), the model (`model.zip`, `normalisation.pkl`) and the final
evaluation over fields that no training draws (`evaluation.json`).
"""

import csv
import json
import shutil
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import torch
import typer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.learning.provenance import provenance
from rover_gym.learning.raw_config import ALGORITHMS, RawConfig, read_raw_config
from rover_gym.learning.raw_policy import RawPolicy
from rover_gym.learning.stopwatch import Stopwatch
from rover_gym.learning.training_config import HELD_BACK, environment_arguments
from rover_gym.policy.evaluation import PolicySummary, drive_all, summarise
from rover_gym.vector.sb3 import RoverVecEnv

# Different seeds get different fields; all seeds stay below the evaluations' million.
SEED_STRIDE = 1000

# First seed of the fields on which the learning curve is measured; the final evaluation begins at `HELD_BACK`.
CURVE_SEED = 2_000_000


@plain_errors
def train(
    config: Annotated[Path, typer.Option(exists=True, dir_okay=False, help="YAML file; see training/configs/raw_*.")],
    task: Annotated[str, typer.Option(help="One of the file's tasks.")] = "plane",
    seed: Annotated[int, typer.Option(min=0, max=998, help="Seed of network, exploration and fields.")] = 1,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/raw/NAME-TASK-seedN if not given.")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions in total, instead of the file's.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Fields of the final evaluation.")] = 200,
) -> None:
    """Train a policy on raw actions and evaluate it."""
    settings = read_raw_config(config)
    arguments = environment_arguments(settings.environment_of(task))
    folder = output or Path("runs") / "raw" / f"{config.stem}-{task}-seed{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(config, folder / "config.yaml")

    # The networks are small: a second thread slows them down.
    torch.set_num_threads(1)
    rovers = RoverVecEnv(
        settings.num_envs, threads=settings.threads, max_episode_steps=settings.max_episode_steps, **arguments
    )
    rovers.seed(SEED_STRIDE * seed)
    watch = Stopwatch(rovers)
    episodes_of = VecMonitor(watch, str(folder / "curve.monitor.csv"), info_keywords=("is_success", "termination"))
    hyperparameters = dict(settings.hyperparameters)
    envs = VecNormalize(
        episodes_of,
        norm_obs=settings.normalise_observations,
        norm_reward=settings.normalise_rewards,
        clip_obs=settings.clip_observations,
        gamma=hyperparameters.get("gamma", 0.99),
    )
    if settings.final_learning_rate is not None:
        first, last = hyperparameters["learning_rate"], settings.final_learning_rate
        hyperparameters["learning_rate"] = lambda remaining: last + (first - last) * remaining
    model = ALGORITHMS[settings.algorithm](
        "MlpPolicy",
        envs,
        seed=SEED_STRIDE * seed,
        device="cpu",
        policy_kwargs=dict(settings.policy_kwargs),
        **hyperparameters,
    )
    policy = RawPolicy(model, envs, environment_arguments(settings.evaluated_environment_of(task)))
    evaluation = Evaluation(policy, settings, task, folder / "evaluations.csv")
    start, cpu_start = time.perf_counter(), time.process_time()
    model.learn(settings.tasks[task].total_steps if steps is None else steps, callback=evaluation)
    evaluation.evaluate()
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu_start

    model.save(folder / "model.zip")
    envs.save(str(folder / "normalisation.pkl"))
    report = {
        "algorithm": f"stable-baselines3 {settings.algorithm}",
        "config": config.name,
        "task": task,
        "seed": seed,
        "decisions": model.num_timesteps,
        "wall_seconds": round(wall, 1),
        "cpu_seconds": round(cpu, 1),
        "environment_cpu_seconds": round(watch.cpu_seconds, 1),
        "evaluation_cpu_seconds": round(evaluation.cpu_seconds, 1),
        **provenance(),
    }
    (folder / "run.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    summary = drive(policy, settings, HELD_BACK, episodes)
    (folder / "evaluation.json").write_text(json.dumps(asdict(summary), indent=2) + "\n", encoding="utf-8")
    typer.echo(told(model.num_timesteps, summary))
    envs.close()
    say_path("policy", folder)


class Evaluation(BaseCallback):
    """Drives the policy without exploration, at the environment's own physics, on the same fields every time.

    Attributes:
        cpu_seconds: CPU time so far, s.
    """

    COLUMNS = ("decisions", "episodes", "successes", "success", "low", "high", "energy_per_metre", "wall_seconds")

    def __init__(self, policy: RawPolicy, settings: RawConfig, task: str, path: Path) -> None:
        super().__init__()
        self.cpu_seconds = 0.0
        self._policy, self._settings, self._path = policy, settings, path
        self._every = self._next = settings.tasks[task].evaluate_every
        self._start = time.perf_counter()
        self._write(self.COLUMNS, "w")

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._next += self._every
            self.evaluate()

    def _on_step(self) -> bool:
        return True

    def evaluate(self) -> None:
        """Adds a line to `evaluations.csv` and prints it."""
        start = time.process_time()
        summary = drive(self._policy, self._settings, CURVE_SEED, self._settings.evaluation_episodes)
        self.cpu_seconds += time.process_time() - start
        figures = (summary.success.value, *summary.success.interval, summary.energy_per_metre.value)
        written = (f"{value:.4g}" for value in (*figures, time.perf_counter() - self._start))
        row = (self.num_timesteps, summary.episodes, summary.successes, *written)
        self._write(row, "a")
        typer.echo(told(self.num_timesteps, summary))

    def _write(self, row: tuple[object, ...], mode: str) -> None:
        with self._path.open(mode, encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(row)


def drive(policy: RawPolicy, settings: RawConfig, seed: int, episodes: int) -> PolicySummary:
    """Drives fields from a seed on, at most 60 s each."""
    drives = drive_all(
        lambda _env: policy,
        range(seed, seed + episodes),
        arguments=policy.environment,
        num_envs=50,
        threads=settings.threads,
    )
    return summarise(settings.algorithm, drives)


def told(decisions: int, summary: PolicySummary) -> str:
    """One line of results."""
    low, high = summary.success.interval
    success = f"{summary.successes} of {summary.episodes} ({100 * low:.1f} to {100 * high:.1f}%)"
    return f"{decisions} decisions: {success}, {summary.time.value:.1f} s, {summary.energy_per_metre.value:.0f} J/m"


if __name__ == "__main__":
    typer.run(train)
