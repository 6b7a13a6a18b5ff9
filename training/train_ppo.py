"""Trains a policy for Rover-v0 with stable-baselines3's PPO.

    python training/train_ppo.py --config training/configs/rocks.yaml --seed 1

The run's folder receives the configuration, seed, versions and revision, the raw curve (`curve.monitor.csv`, one line
per episode), stable-baselines3's log (CSV and TensorBoard), the evaluations (`evaluations.csv`), checkpoints and the
policy.

`--resume` goes on with the configuration that is given. Hyperparameters, curriculum, evaluation and environment are
taken over; a change of what the network depends on is refused (`rover_gym.learning.resuming`).
"""

import json
import re
import time
from pathlib import Path
from typing import Annotated, Any

import torch
import typer
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym import OptionError
from rover_gym.cli.console import plain_errors, say_path
from rover_gym.learning.build import build_env, normalised
from rover_gym.learning.callbacks import CheckpointCallback, CurriculumCallback, EvaluationCallback
from rover_gym.learning.export import export
from rover_gym.learning.provenance import provenance
from rover_gym.learning.resuming import check_resumable
from rover_gym.learning.stopwatch import Stopwatch
from rover_gym.learning.training_config import PPOConfig, read_config
from rover_gym.validation import refuse

# Different seeds and resumed runs get different fields; all seeds stay below the evaluations' million.
SEED_STRIDE = 1000


@plain_errors
def train(
    config: Annotated[Path, typer.Option(exists=True, dir_okay=False, help="YAML file; see training/configs.")],
    seed: Annotated[int, typer.Option(min=0, max=498, help="Seed of network, exploration and fields.")] = 1,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/train/NAME-seedN if not given.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the folder's latest checkpoint.")] = False,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions in total, instead of the file's.")] = None,
    progress: Annotated[bool, typer.Option(help="Show a progress bar.")] = True,
) -> None:
    """Train a policy and write it."""
    settings = read_config(config)
    total_steps = settings.total_steps if steps is None else steps
    folder = output or Path("runs") / "train" / f"{config.stem}-seed{seed}"
    checkpoints = folder / "checkpoints"
    latest = _latest(checkpoints / "latest.json") if resume else None
    if latest is not None:
        check_resumable(read_config(folder / "config.yaml"), settings)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "config.yaml").write_text(settings.to_yaml(), encoding="utf-8")
    origin = provenance()
    clock, cpu_clock = time.perf_counter(), time.process_time()

    # The networks are small: a second thread slows them down.
    torch.set_num_threads(1)
    part = 0 if latest is None else int(latest["name"])
    stream = SEED_STRIDE * seed + 500_000 * (part > 0) + part % 997
    curve = folder / (f"curve-{part}.monitor.csv" if part else "curve.monitor.csv")
    rovers = Stopwatch(build_env(settings, seed=stream, monitor=curve))
    if latest is None:
        envs = normalised(rovers, settings)
        architecture = {"net_arch": list(settings.ppo.net_arch), "log_std_init": settings.ppo.log_std_init}
        model = PPO("MlpPolicy", envs, seed=stream, policy_kwargs=architecture, **hyperparameters(settings.ppo))
    else:
        envs = VecNormalize.load(str(checkpoints / f"{latest['name']}.pkl"), rovers)
        envs.gamma = settings.ppo.gamma
        model = PPO.load(checkpoints / f"{latest['name']}.zip", env=envs, **hyperparameters(settings.ppo))
        model.set_random_seed(stream)
    model.set_logger(configure(str(folder / (f"log-{part}" if part else "log")), ["csv", "tensorboard"]))

    curriculum = None
    if settings.curriculum is not None:
        curriculum = CurriculumCallback(settings.curriculum, None if latest is None else latest["hardest"])
    checkpoint = CheckpointCallback(settings.checkpoint_every, checkpoints, curriculum)
    evaluation = EvaluationCallback(settings, folder / "evaluations.csv", append=latest is not None)
    callbacks: list[BaseCallback] = [*([] if curriculum is None else [curriculum]), checkpoint, evaluation]

    learn_clock = time.process_time()
    model.learn(
        max(0, total_steps - model.num_timesteps) if latest is not None else total_steps,
        callback=CallbackList(callbacks),
        reset_num_timesteps=latest is None,
        progress_bar=progress,
    )

    learn_seconds = time.process_time() - learn_clock
    environment_seconds = rovers.cpu_seconds + evaluation.cpu_seconds
    model.logger.close()
    checkpoint.write()
    source = {
        "algorithm": "stable-baselines3 PPO",
        "config": config.name,
        "seed": seed,
        "decisions": model.num_timesteps,
        "wall_seconds": round(time.perf_counter() - clock, 1),
        "cpu_seconds": round(time.process_time() - cpu_clock, 1),
        "environment_cpu_seconds": round(environment_seconds, 1),
        "evaluation_cpu_seconds": round(evaluation.cpu_seconds, 1),
        "learner_cpu_seconds": round(learn_seconds - environment_seconds, 1),
        "environment_share": round(environment_seconds / max(learn_seconds, 1e-9), 3),
        "resumed_from": part,
        **origin,
    }
    (folder / "run.json").write_text(json.dumps(source, indent=2) + "\n", encoding="utf-8")
    export(model, envs, settings, folder / "policy", source)
    rovers.close()
    say_path("policy", folder / "policy")


def _latest(path: Path) -> dict[str, Any]:
    """Metadata of a run's last checkpoint.

    Raises:
        OptionError: The file is damaged.
        OSError: The run has no checkpoint.
    """
    text = path.read_bytes()
    try:
        latest: dict[str, Any] = json.loads(text)
        found = re.fullmatch("[0-9]{9,15}", latest["name"]) and "hardest" in latest
    except (ValueError, LookupError, TypeError, RecursionError):
        found = False
    if not found:
        refuse(OptionError, "resume", str(path), "names no checkpoint")
    return latest


def hyperparameters(ppo: PPOConfig) -> dict[str, Any]:
    """Keyword arguments of stable-baselines3's PPO, without those of its network."""
    first, last = ppo.learning_rate, ppo.final_learning_rate
    return {
        "learning_rate": lambda remaining: last + (first - last) * remaining,
        "n_steps": ppo.n_steps,
        "batch_size": ppo.batch_size,
        "n_epochs": ppo.n_epochs,
        "gamma": ppo.gamma,
        "gae_lambda": ppo.gae_lambda,
        "clip_range": ppo.clip_range,
        "ent_coef": ppo.ent_coef,
        "vf_coef": ppo.vf_coef,
        "max_grad_norm": ppo.max_grad_norm,
        "device": "cpu",
    }


if __name__ == "__main__":
    typer.run(train)
