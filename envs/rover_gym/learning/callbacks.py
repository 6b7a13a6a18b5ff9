"""Callbacks of a training: curriculum, evaluation and checkpoints."""

import csv
import json
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.export import card_of, network_of
from rover_gym.learning.training_config import CurriculumConfig, TrainingConfig, environment_arguments
from rover_gym.policy.evaluation import drive_all, summarise
from rover_gym.policy.trained_policy import TrainedPolicy


class CurriculumCallback(BaseCallback):
    """Raises the difficulty of the next fields when enough episodes succeed.

    Args:
        curriculum: The settings of the curriculum.
        hardest: Initial hardest difficulty; None for the curriculum's start.
    """

    def __init__(self, curriculum: CurriculumConfig, hardest: float | None = None) -> None:
        super().__init__()
        self.curriculum = curriculum
        self.hardest = curriculum.start if hardest is None else hardest
        self._recent: deque[bool] = deque()

    def _on_training_start(self) -> None:
        self._apply()

    def _on_step(self) -> bool:
        self._recent.extend(bool(info["is_success"]) for info in self.locals["infos"] if "episode" in info)
        return True

    def _on_rollout_end(self) -> None:
        enough = len(self._recent) >= self.curriculum.episodes
        if enough and np.mean(self._recent) >= self.curriculum.success and self.hardest < self.curriculum.end:
            self.hardest = min(self.curriculum.end, self.hardest + self.curriculum.step)
            self._apply()
        if enough:
            self._recent.clear()
        self.logger.record("curriculum/hardest", self.hardest)

    def _apply(self) -> None:
        easiest = max(0.0, self.hardest - self.curriculum.width)
        self.training_env.env_method("set_difficulty", (easiest, self.hardest))


class EvaluationCallback(BaseCallback):
    """Drives the policy without exploration, as `training/evaluate.py` does, on the same fields every time.

    Each evaluation is a line of `evaluations.csv`, and success with its interval stands in the log.

    Args:
        config: The configuration.
        path: The CSV file.
        append: Whether to go on with this file.

    Attributes:
        cpu_seconds: CPU time so far, s.
    """

    COLUMNS = ("decisions", "episodes", "successes", "success", "low", "high", "energy_per_metre", "cpu_seconds")

    def __init__(self, config: TrainingConfig, path: Path, *, append: bool = False) -> None:
        super().__init__()
        self.cpu_seconds = 0.0
        self._config = config
        self._path = path
        self._append = append
        self._next = config.evaluation.every

    def _on_training_start(self) -> None:
        self._next = self.num_timesteps + self._config.evaluation.every
        if not (self._append and self._path.exists()):
            self._write(self.COLUMNS, "w")

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._evaluate()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self._evaluate()

    def _evaluate(self) -> None:
        self._next += self._config.evaluation.every
        start = time.process_time()
        normalisation = self.model.get_vec_normalize_env()
        assert isinstance(normalisation, VecNormalize)  # noqa: S101 - as the trainer builds it
        assert isinstance(self.model, OnPolicyAlgorithm)  # noqa: S101 - PPO
        network, card = network_of(self.model, normalisation), card_of(self._config, {})
        settings = self._config.evaluation
        drives = drive_all(
            lambda env: TrainedPolicy(env, network, card),
            range(settings.seed, settings.seed + settings.episodes),
            arguments=environment_arguments(self._config.evaluated_environment),
            num_envs=self._config.num_envs,
            threads=self._config.threads,
        )
        summary = summarise("", drives)
        seconds = time.process_time() - start
        self.cpu_seconds += seconds
        low, high = summary.success.interval
        energy = summary.energy_per_metre.value
        for name, value in (("success", summary.success.value), ("low", low), ("high", high), ("energy", energy)):
            self.logger.record(f"evaluation/{name}", value)
        self.logger.dump(self.num_timesteps)
        figures = (f"{value:.4g}" for value in (summary.success.value, low, high, energy, seconds))
        self._write((self.num_timesteps, summary.episodes, summary.successes, *figures), "a")

    def _write(self, row: Sequence[object], mode: str) -> None:
        with self._path.open(mode, encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(row)


class CheckpointCallback(BaseCallback):
    """Writes checkpoints from which a training can resume.

    Args:
        every: Steps of all environments between two checkpoints.
        folder: Folder of `latest.json` and the checkpoints' files.
        curriculum: The curriculum, whose state is part of a checkpoint.
    """

    def __init__(self, every: int, folder: Path, curriculum: CurriculumCallback | None = None) -> None:
        super().__init__()
        self._every = every
        self._folder = folder
        self._curriculum = curriculum
        self._next = every

    def _on_training_start(self) -> None:
        self._next = self.num_timesteps + self._every

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if self.num_timesteps >= self._next:
            self._next += self._every
            self.write()

    def write(self) -> None:
        """Writes a checkpoint now; `latest.json`, written last, names it."""
        self._folder.mkdir(parents=True, exist_ok=True)
        name = f"{self.num_timesteps:09d}"
        self.model.save(self._folder / f"{name}.zip")
        normalisation = self.model.get_vec_normalize_env()
        if isinstance(normalisation, VecNormalize):
            normalisation.save(str(self._folder / f"{name}.pkl"))
        state = {"name": name, "hardest": None if self._curriculum is None else self._curriculum.hardest}
        (self._folder / "latest.json").write_text(json.dumps(state) + "\n", encoding="utf-8")
