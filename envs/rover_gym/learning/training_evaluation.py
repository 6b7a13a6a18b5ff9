"""Evaluations during a training: their table, the best policy so far, and films."""

import csv
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.export import card_of, network_of
from rover_gym.learning.training_config import TrainingConfig, environment_arguments
from rover_gym.mechanics import OptionError
from rover_gym.policy.comparison import film_episode
from rover_gym.policy.evaluation import PolicySummary, drive_all, summarise
from rover_gym.policy.policy_card import Network, PolicyCard, PolicyError
from rover_gym.policy.trained_policy import TrainedPolicy
from rover_gym.validation import refuse


@dataclass(frozen=True)
class TrainingEvaluation:
    """One evaluation during a training, a line of `evaluations.csv`.

    Attributes:
        decisions: Decisions of all environments so far.
        episodes: Number of episodes.
        successes: Number of episodes that reached the goal.
        success: Success rate.
        low: Lower end of its 95% interval, Wilson's.
        high: Upper end.
        energy_per_metre: Work of the wheel motors over path length, J/m.
        cpu_seconds: CPU time of this evaluation, s.
    """

    decisions: int
    episodes: int
    successes: int
    success: float
    low: float
    high: float
    energy_per_metre: float
    cpu_seconds: float

    def is_better_than(self, other: "TrainingEvaluation") -> bool:
        """Whether this policy succeeded more often or, as often, with less energy."""
        return (self.success, -self.energy_per_metre) > (other.success, -other.energy_per_metre)


def read_evaluations(path: Path) -> list[TrainingEvaluation]:
    """Reads `evaluations.csv`.

    Raises:
        OptionError: The file is damaged.
        OSError: It cannot be read.
    """
    kinds: dict[str, Any] = {field.name: int if field.type is int else float for field in fields(TrainingEvaluation)}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return [TrainingEvaluation(**{name: kind(row[name]) for name, kind in kinds.items()}) for row in rows]
    except (ValueError, LookupError, TypeError) as error:
        refuse(OptionError, "evaluations", str(path), f"is damaged ({error})")


class EvaluationCallback(BaseCallback):
    """Drives the policy without exploration, as `rover evaluate` does, on the same fields every time.

    Each evaluation is a line of `evaluations.csv`, and success with its interval stands in the log. The best policy so
    far is kept in the folder `best`, in the form of the run's `policy`.

    Args:
        config: The configuration.
        folder: The run's folder.
        source: Provenance for the card of the best policy.
        append: Whether to go on with the table and the best policy of this folder.
        n_films: Number of fields, the first ones, on which each evaluation is also filmed, into the folder `films`.
        report: Called with each evaluation and whether it is the best so far.

    Attributes:
        cpu_seconds: CPU time so far, with the films', s.
        best: The best evaluation so far; None before the first.
    """

    def __init__(
        self,
        config: TrainingConfig,
        folder: Path,
        source: Mapping[str, Any],
        *,
        append: bool = False,
        n_films: int = 0,
        report: Callable[[TrainingEvaluation, bool], None] = lambda _evaluation, _is_best: None,
    ) -> None:
        super().__init__()
        self.cpu_seconds = 0.0
        self._config = config
        self._path = folder / "evaluations.csv"
        self._best_folder = folder / "best"
        self._films = folder / "films"
        self._source = source
        self._append = append
        self._n_films = n_films
        self._report = report
        self._next = config.evaluation.every
        #: What the figures of an evaluation depend on, besides the policy.
        self._fields = json.loads(
            json.dumps(
                {
                    "environment": config.evaluated_environment,
                    "seeds": [config.evaluation.seed, config.evaluation.episodes],
                }
            )
        )
        self.best = self._kept_best() if append else None

    def _on_training_start(self) -> None:
        self._next = self.num_timesteps + self._config.evaluation.every
        if not (self._append and self._path.exists()):
            self._write([field.name for field in fields(TrainingEvaluation)], "w")

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
        arguments = environment_arguments(self._config.evaluated_environment)
        seeds = range(settings.seed, settings.seed + settings.episodes)

        def driver(env: Any) -> TrainedPolicy:
            return TrainedPolicy(env, network, card)

        drives = drive_all(
            driver, seeds, arguments=arguments, num_envs=self._config.num_envs, threads=self._config.threads
        )
        evaluation = self._log(summarise("", drives), time.process_time() - start)
        is_best = self.best is None or evaluation.is_better_than(self.best)
        if is_best:
            self.best = evaluation
            self._keep_best(network, evaluation)
        for seed in seeds[: self._n_films]:
            film_episode(self._films / f"{self.num_timesteps:09d}-seed{seed}.mp4", driver, arguments, seed)
        self.cpu_seconds += time.process_time() - start
        self._report(evaluation, is_best)

    def _log(self, summary: PolicySummary, seconds: float) -> TrainingEvaluation:
        """Writes an evaluation into table and log."""
        low, high = summary.success.interval
        energy = summary.energy_per_metre.value
        for name, value in (("success", summary.success.value), ("low", low), ("high", high), ("energy", energy)):
            self.logger.record(f"evaluation/{name}", value)
        self.logger.dump(self.num_timesteps)
        evaluation = TrainingEvaluation(
            self.num_timesteps, summary.episodes, summary.successes, summary.success.value, low, high, energy, seconds
        )
        self._write([f"{value:.4g}" if isinstance(value, float) else value for value in astuple(evaluation)], "a")
        return evaluation

    def _keep_best(self, network: Network, evaluation: TrainingEvaluation) -> None:
        self._best_folder.mkdir(parents=True, exist_ok=True)
        source = {**self._source, "decisions": evaluation.decisions, "evaluation": asdict(evaluation) | self._fields}
        network.save(self._best_folder / "policy.npz")
        card_of(self._config, source).save(self._best_folder / "policy.json")

    def _kept_best(self) -> TrainingEvaluation | None:
        """The evaluation of the folder's best policy; None if there is none that drove the same fields."""
        try:
            known = dict(PolicyCard.read(self._best_folder / "policy.json").source["evaluation"])
            drove = {name: known.pop(name) for name in self._fields}
            return TrainingEvaluation(**known) if drove == self._fields else None
        except (PolicyError, OSError, LookupError, TypeError, ValueError):
            return None

    def _write(self, row: list[Any], mode: str) -> None:
        with self._path.open(mode, encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(row)
