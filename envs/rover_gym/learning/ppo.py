"""Trains a policy for Rover-v0 with stable-baselines3's PPO.

The run's folder receives the configuration, seed, versions and revision (`run.json`), the raw curve
(`curve.monitor.csv`, one line per episode), stable-baselines3's log (CSV and TensorBoard), the evaluations
(`evaluations.csv`), checkpoints, the policy and the one that did best in the evaluations.
"""

import json
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from rover_gym.learning.build import Stopwatch, build_env, normalised
from rover_gym.learning.callbacks import CheckpointCallback, CurriculumCallback, MetricsCallback, evaluation_line
from rover_gym.learning.export import export
from rover_gym.learning.training_config import PPOConfig, TrainingConfig, read_config
from rover_gym.learning.training_evaluation import EvaluationCallback, TrainingEvaluation
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

#: What a checkpoint's network, its inputs and the meaning of its outputs depend on. All else is taken over.
FIXED = (
    "environment.model",
    "environment.height_scan",
    "pool",
    "guided",
    "command",
    "ppo.net_arch",
    "ppo.log_std_init",
)


@dataclass(frozen=True)
class Checkpoint:
    """What `latest.json` says of a run's last checkpoint.

    Attributes:
        name: Name of its files, the number of decisions.
        hardest: Hardest difficulty of the curriculum; None without one.
    """

    name: str
    hardest: float | None

    @property
    def decisions(self) -> int:
        """Decisions of all environments so far."""
        return int(self.name)


def latest_checkpoint(folder: Path) -> Checkpoint:
    """The last checkpoint in a folder of checkpoints.

    Raises:
        OptionError: `latest.json` is damaged.
        OSError: There is none.
    """
    path = folder / "latest.json"
    text = path.read_bytes()
    try:
        latest: dict[str, Any] = json.loads(text)
        hardest = None if latest["hardest"] is None else float(latest["hardest"])
        is_named = re.fullmatch("[0-9]{9,15}", latest["name"]) is not None
    except (ValueError, LookupError, TypeError, RecursionError):
        is_named = False
    if not is_named:
        refuse(OptionError, "resume", str(path), "is not a checkpoint")
    return Checkpoint(latest["name"], hardest)


def check_resumable(before: TrainingConfig, now: TrainingConfig) -> None:
    """Refuses to go on with a configuration for which the checkpoint's network was not made.

    Args:
        before: The configuration that the checkpoint was trained with.
        now: The one to go on with.

    Raises:
        OptionError: A value that the network depends on differs; `field` names it.
    """
    known, given = dict(_leaves(asdict(before))), dict(_leaves(asdict(now)))
    for name in sorted(known.keys() | given.keys()):
        is_fixed = any(name == fixed or name.startswith(f"{fixed}.") for fixed in FIXED)
        if is_fixed and known.get(name) != given.get(name):
            reason = f"was {known.get(name)!r} in the training that is to go on, whose network depends on it"
            refuse(OptionError, name, given.get(name), reason)


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested mappings, by their dotted names; lists and tuples are alike."""
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", list(value) if isinstance(value, tuple) else value


PACKAGES = ("rover-gym", "numpy", "gymnasium", "stable-baselines3", "torch", "ray")


def provenance() -> dict[str, Any]:
    """The command, machine type, versions of Python and the packages, and revision of the sources."""
    return {
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "python": platform.python_version(),
        "machine": platform.machine(),
        "versions": {name: found for name in PACKAGES if (found := _version(name)) is not None},
        "revision": revision(),
    }


def revision() -> str | None:
    """The git revision of the sources, with "-dirty" after uncommitted changes; None if no repository holds them."""
    here = Path(__file__)
    git = ["git", "-C", str(here.parent)]
    try:
        # An installed package may lie in the folder of another repository, which does not track it.
        subprocess.run([*git, "ls-files", "--error-unmatch", here.name], check=True, capture_output=True)  # noqa: S603
        head = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True)  # noqa: S603
        changed = subprocess.run([*git, "status", "--porcelain"], check=True, capture_output=True, text=True)  # noqa: S603
    except (OSError, subprocess.CalledProcessError):
        return None
    return head.stdout.strip() + ("-dirty" if changed.stdout.strip() else "")


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


# Different seeds and resumed runs get different fields; all seeds stay below the evaluations' million.
SEED_STRIDE = 1000

#: The largest seed of a training.
LARGEST_TRAINING_SEED = 498


@dataclass(frozen=True)
class Reporting:
    """What a training says and shows while it runs; its result does not depend on it.

    Attributes:
        say: Takes each line of figures.
        progress: Whether a progress bar is shown.
        films: Number of fields of each evaluation that are also filmed; needs the extra `render`.
        on_evaluation: Called with each evaluation; an exception ends the training.
    """

    say: Callable[[str], None] = field(default=lambda _line: None)
    progress: bool = False
    films: int = 0
    on_evaluation: Callable[[TrainingEvaluation], None] = field(default=lambda _evaluation: None)


def train_ppo(
    settings: TrainingConfig,
    folder: Path,
    *,
    name: str,
    seed: int = 1,
    resume: bool = False,
    total_steps: int | None = None,
    reporting: Reporting | None = None,
) -> Path:
    """Trains a policy and writes it.

    Args:
        settings: The configuration.
        folder: The run's folder.
        name: The configuration's name, for `run.json`.
        seed: Seed of network, exploration and fields, from 0 to 498.
        resume: Whether to go on from the folder's latest checkpoint. Hyperparameters, curriculum, evaluation and
            environment of `settings` are taken over; a change of what the network depends on is refused.
        total_steps: Decisions in total; None for the configuration's.
        reporting: What is said and shown meanwhile.

    Returns:
        The folder of the policy.

    Raises:
        OptionError: The checkpoint is damaged or its network was made for another configuration; nothing has changed.
        OSError: The folder cannot be written, or there is no checkpoint to go on from.
    """
    shown = reporting or Reporting()
    total = settings.total_steps if total_steps is None else total_steps
    latest = _checkpoint(folder, settings) if resume else None
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "config.yaml").write_text(settings.to_yaml(), encoding="utf-8")
    origin = provenance()
    clock, cpu_clock = time.perf_counter(), time.process_time()

    # The networks are small: a second thread slows them down.
    torch.set_num_threads(1)
    part = 0 if latest is None else latest.decisions
    stream = SEED_STRIDE * seed + 500_000 * (part > 0) + part % 997
    curve = folder / (f"curve-{part}.monitor.csv" if part else "curve.monitor.csv")
    rovers = Stopwatch(build_env(settings, seed=stream, monitor=curve))
    try:
        model, envs = _model(settings, rovers, stream, folder / "checkpoints", latest)
        model.set_logger(configure(str(folder / (f"log-{part}" if part else "log")), ["csv", "tensorboard"]))

        facts = {"algorithm": "stable-baselines3 PPO", "config": name, "seed": seed}
        checkpoint, evaluation, others = _callbacks(settings, folder, latest, {**facts, **origin}, shown)
        callbacks = [*others, checkpoint, MetricsCallback(total, shown.say), evaluation]

        learn_clock = time.process_time()
        model.learn(
            max(0, total - model.num_timesteps) if latest is not None else total,
            callback=CallbackList(callbacks),
            reset_num_timesteps=latest is None,
            progress_bar=shown.progress,
        )

        learn_seconds = time.process_time() - learn_clock
        environment_seconds = rovers.cpu_seconds + evaluation.cpu_seconds
        checkpoint.write()
        source = {
            **facts,
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
        model.logger.close()
    finally:
        rovers.close()
    return folder / "policy"


def _checkpoint(folder: Path, settings: TrainingConfig) -> Checkpoint:
    """The latest checkpoint of a run's folder, checked against the configuration."""
    latest = latest_checkpoint(folder / "checkpoints")
    check_resumable(read_config(folder / "config.yaml"), settings)
    return latest


def _callbacks(
    settings: TrainingConfig, folder: Path, latest: Checkpoint | None, source: dict[str, Any], shown: Reporting
) -> tuple[CheckpointCallback, EvaluationCallback, list[BaseCallback]]:
    """What writes checkpoints, what evaluates, and what makes the task harder, where the configuration asks for it."""
    curriculum = None
    if settings.curriculum is not None:
        curriculum = CurriculumCallback(settings.curriculum, None if latest is None else latest.hardest)

    def report(found: TrainingEvaluation, is_best: bool) -> None:
        shown.say(evaluation_line(found, is_best))
        shown.on_evaluation(found)

    evaluation = EvaluationCallback(
        settings, folder, source, append=latest is not None, n_films=shown.films, report=report
    )
    checkpoint = CheckpointCallback(settings.checkpoint_every, folder / "checkpoints", curriculum)
    return checkpoint, evaluation, [] if curriculum is None else [curriculum]


def _model(
    settings: TrainingConfig, rovers: VecEnv, stream: int, checkpoints: Path, latest: Checkpoint | None
) -> tuple[PPO, VecNormalize]:
    """The learner and its normalised environments, from nothing or from a checkpoint."""
    if latest is None:
        envs = normalised(rovers, settings)
        architecture = {"net_arch": list(settings.ppo.net_arch), "log_std_init": settings.ppo.log_std_init}
        model = PPO("MlpPolicy", envs, seed=stream, policy_kwargs=architecture, **hyperparameters(settings.ppo))
    else:
        envs = VecNormalize.load(str(checkpoints / f"{latest.name}.pkl"), rovers)
        envs.gamma = settings.ppo.gamma
        model = PPO.load(checkpoints / f"{latest.name}.zip", env=envs, **hyperparameters(settings.ppo))
        model.set_random_seed(stream)
    return model, envs


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
