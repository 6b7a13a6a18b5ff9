"""A training's figures, line by line."""

import time
from collections.abc import Callable

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from rover_gym.learning.training_evaluation import TrainingEvaluation

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
