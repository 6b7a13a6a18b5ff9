"""Callbacks of a training: curriculum, checkpoints and the figures that it prints."""

import json
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.training_config import CurriculumConfig
from rover_gym.learning.training_evaluation import TrainingEvaluation


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


#: Lines of a whole training, without those of evaluations.
LINES = 20


class MetricsCallback(BaseCallback):
    """Says return and success of the latest 100 episodes, twenty times in a training.

    Args:
        total_steps: Decisions at the training's end.
        say: Takes a line.
    """

    def __init__(self, total_steps: int, say: Callable[[str], None]) -> None:
        super().__init__()
        self._total = total_steps
        self._say = say
        self._next = 0.0

    def _on_training_start(self) -> None:
        self._begun, self._before = time.perf_counter(), self.num_timesteps
        self._next = self.num_timesteps + self._total / LINES

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if self.num_timesteps < self._next:
            return
        self._next += self._total / LINES
        rate = (self.num_timesteps - self._before) / max(time.perf_counter() - self._begun, 1e-9)
        episodes, ends = self.model.ep_info_buffer, self.model.ep_success_buffer
        figures = "no episode has ended"
        if episodes and ends:
            returns = np.mean([episode["r"] for episode in episodes])
            figures = f"return {returns:.2f}, success {np.mean(ends):.0%} over the last {len(ends)} episodes"
        self._say(f"{self.num_timesteps} of {self._total} decisions: {figures}, {rate:.0f} decisions/s")


def evaluation_line(evaluation: TrainingEvaluation, is_best: bool) -> str:
    """An evaluation during a training in one line."""
    return (
        f"{evaluation.decisions} decisions: evaluation over {evaluation.episodes} fields: "
        f"success {evaluation.success:.1%} ({100.0 * evaluation.low:.1f} to {evaluation.high:.1%}), "
        f"{evaluation.energy_per_metre:.0f} J/m{', the best so far' if is_best else ''}"
    )
