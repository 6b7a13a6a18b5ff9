"""Searches hyperparameters of a training with Optuna: one recipe, to be changed to one's own question.

python training/examples/tune.py plane --trials 20 --steps 40000

A trial's value is its mean success over eight evaluations, which favours what learns early and stays. The best of
several is partly luck: train its configuration with other seeds (`rover train OUTPUT/best.yaml --seeds 2 3 4`).
"""

from dataclasses import replace
from pathlib import Path

import optuna
import typer
from optuna.storages.journal import JournalFileBackend

from rover_gym.learning.ppo import Reporting, train_ppo
from rover_gym.learning.training_config import TrainingConfig, find_configuration, read_config
from rover_gym.learning.training_evaluation import TrainingEvaluation


def drawn(settings: TrainingConfig, trial: optuna.trial.BaseTrial) -> TrainingConfig:
    """The configuration of a trial."""
    learning_rate = trial.suggest_float("learning_rate", 1e-4, 3e-3, log=True)
    ppo = replace(
        settings.ppo,
        learning_rate=learning_rate,
        final_learning_rate=0.1 * learning_rate,
        n_epochs=trial.suggest_int("n_epochs", 3, 12),
        gamma=1.0 - trial.suggest_float("one_minus_gamma", 0.003, 0.1, log=True),
        log_std_init=trial.suggest_float("log_std_init", -2.0, 0.0),
    )
    return replace(settings, ppo=ppo)


def tune(
    config: str, trials: int = 20, steps: int = 40_000, episodes: int = 100, output: Path = Path("runs/tune")
) -> None:
    """Search, and write the best configuration; a second call goes on with the study."""
    path = find_configuration(config)
    settings = read_config(path)
    evaluation = replace(settings.evaluation, every=max(1, steps // 8), episodes=episodes)
    tried = replace(settings, total_steps=steps, evaluation=evaluation)

    def value(trial: optuna.Trial) -> float:
        found: list[float] = []

        def on_evaluation(result: TrainingEvaluation) -> None:
            found.append(result.success)
            trial.report(sum(found) / len(found), step=len(found))
            if trial.should_prune():
                raise optuna.TrialPruned

        folder, reporting = output / f"trial-{trial.number}", Reporting(on_evaluation=on_evaluation)
        train_ppo(drawn(tried, trial), folder, name=path.name, seed=1, reporting=reporting)
        return sum(found) / len(found)

    output.mkdir(parents=True, exist_ok=True)
    storage = optuna.storages.JournalStorage(JournalFileBackend(str(output / "study.log")))
    study = optuna.create_study(study_name=path.stem, storage=storage, load_if_exists=True, direction="maximize")
    study.optimize(value, n_trials=trials)
    best = replace(drawn(settings, study.best_trial), total_steps=steps)
    (output / "best.yaml").write_text(best.to_yaml(), encoding="utf-8")
    typer.echo(f"best: trial {study.best_trial.number}, mean success {study.best_value:.1%}, {output / 'best.yaml'}")


if __name__ == "__main__":
    typer.run(tune)
