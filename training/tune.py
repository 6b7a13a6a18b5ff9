"""Searches hyperparameters of a training with Optuna: one recipe, to be changed to one's own question.

    python training/tune.py plane --trials 20 --steps 40000 --output runs/tune-plane

A trial trains with values drawn for what `drawn` lists, all else as in the configuration. Its value is the mean success
over its evaluations, eight of them over 100 fields: this favours what learns early and stays. Trials whose evaluations
fall behind the median of the others are stopped. All trials have the same seed, so the best one is partly luck: train
its configuration with other seeds (`rover train OUTPUT/best.yaml --seeds 2 3 4`).

The study is kept in OUTPUT/study.log; a second call goes on with it.
"""

import csv
import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import optuna
import typer
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.learning.configurations import find_configuration
from rover_gym.learning.ppo import LARGEST_TRAINING_SEED, Reporting, train_ppo
from rover_gym.learning.training_config import TrainingConfig, read_config
from rover_gym.learning.training_evaluation import TrainingEvaluation

EVALUATIONS = 8


def drawn(settings: TrainingConfig, trial: optuna.trial.BaseTrial) -> TrainingConfig:
    """The configuration of a trial."""
    learning_rate = trial.suggest_float("learning_rate", 1e-4, 3e-3, log=True)
    n_steps = trial.suggest_categorical("n_steps", [32, 64, 128])
    ppo = replace(
        settings.ppo,
        learning_rate=learning_rate,
        final_learning_rate=0.1 * learning_rate,
        n_steps=n_steps,
        # The number of minibatches is drawn, so that each has the same size.
        batch_size=n_steps * settings.num_envs // trial.suggest_categorical("n_batches", [2, 4, 8]),
        n_epochs=trial.suggest_int("n_epochs", 3, 12),
        gamma=1.0 - trial.suggest_float("one_minus_gamma", 0.003, 0.1, log=True),
        gae_lambda=trial.suggest_float("gae_lambda", 0.8, 0.99),
        ent_coef=trial.suggest_float("ent_coef", 1e-5, 1e-2, log=True),
        log_std_init=trial.suggest_float("log_std_init", -2.0, 0.0),
    )
    return replace(settings, ppo=ppo)


def value_of(trial: optuna.Trial, settings: TrainingConfig, output: Path, name: str, seed: int) -> float:
    """Trains one trial: its mean success over the evaluations."""
    found: list[float] = []

    def on_evaluation(evaluation: TrainingEvaluation) -> None:
        found.append(evaluation.success)
        trial.report(math.fsum(found) / len(found), step=len(found))
        if trial.should_prune():
            raise optuna.TrialPruned

    folder = output / f"trial-{trial.number}"
    train_ppo(drawn(settings, trial), folder, name=name, seed=seed, reporting=Reporting(on_evaluation=on_evaluation))
    return math.fsum(found) / len(found)


@plain_errors
def tune(
    config: Annotated[str, typer.Argument(help="A configuration of the package, 'plane' or 'rocks', or a YAML file.")],
    trials: Annotated[int, typer.Option(min=1, help="Further trials.")] = 20,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions of a trial, instead of the file's.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_TRAINING_SEED, help="Of every trial.")] = 1,
    episodes: Annotated[int, typer.Option(min=1, help="Fields of an evaluation.")] = 100,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of study and runs.")] = Path("runs/tune"),
) -> None:
    """Search, and write the best configuration and a table of the trials."""
    path = find_configuration(config)
    settings = read_config(path)
    total = settings.total_steps if steps is None else steps
    evaluation = replace(settings.evaluation, every=max(1, total // EVALUATIONS), episodes=episodes)
    tried = replace(settings, total_steps=total, evaluation=evaluation)
    output.mkdir(parents=True, exist_ok=True)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(
        study_name=path.stem,
        storage=JournalStorage(JournalFileBackend(str(output / "study.log"))),
        load_if_exists=True,
        direction="maximize",
        sampler=optuna.samplers.TPESampler(seed=seed + len(list(output.glob("trial-*")))),
        pruner=optuna.pruners.MedianPruner(n_startup_trials=5, n_warmup_steps=2),
    )

    def say(_study: optuna.Study, trial: optuna.trial.FrozenTrial) -> None:
        value = "" if trial.value is None else f" {trial.value:.1%}"
        typer.echo(f"trial {trial.number}: {trial.state.name.lower()}{value}")

    objective = partial(value_of, settings=tried, output=output, name=path.name, seed=seed)
    study.optimize(objective, n_trials=trials, callbacks=[say])
    best = replace(drawn(settings, study.best_trial), total_steps=total)  # with the evaluations of the file
    (output / "best.yaml").write_text(best.to_yaml(), encoding="utf-8")
    with (output / "trials.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("trial", "state", "value", *study.best_trial.params))
        for trial in study.trials:
            values = (trial.params.get(name) for name in study.best_trial.params)
            writer.writerow((trial.number, trial.state.name.lower(), trial.value, *values))
    typer.echo(f"best: trial {study.best_trial.number}, mean success {study.best_value:.1%}, {study.best_params}")
    say_path("written", output / "best.yaml")
    say_path("written", output / "trials.csv")


if __name__ == "__main__":
    typer.run(tune)
