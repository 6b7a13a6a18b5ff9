"""`rover train`: configurations by name, several seeds, the best policy, figures on standard output, films."""

import json
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from commands import error_of, output_of, rover
from typer.testing import Result

from rover_gym import PDPolicy

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import yaml

from rover_gym.learning.several_seeds import seed_estimate, student_quantile
from rover_gym.learning.training_config import FOLDER, SHIPPED_CONFIGURATIONS, parse_config, read_config
from rover_gym.learning.training_evaluation import TrainingEvaluation, read_evaluations
from rover_gym.policy import PolicyCard, TrainedPolicy, drive_all
from rover_gym.policy.comparison import ENDING, film_episode

TINY: dict[str, Any] = {
    "environment": {"terrain": "plane", "goal_distance": 1.2, "control_frequency": 10, "time_step": 0.02},
    "total_steps": 512,
    "num_envs": 8,
    "max_episode_steps": 40,
    "ppo": {"n_steps": 32, "batch_size": 64, "n_epochs": 1, "net_arch": [8]},
    "evaluation": {"every": 256, "episodes": 3},
    "checkpoint_every": 256,
}


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("config") / "tiny.yaml"
    path.write_text(yaml.safe_dump(TINY), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def seeds(config: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """Two seeds, and what the command said."""
    folder = tmp_path_factory.mktemp("runs")
    return folder, rover("train", config, "--seeds", 3, 5, "--output", folder, "--no-progress")


def test_several_seeds_end_with_their_mean_and_interval(seeds: tuple[Path, Result]) -> None:
    folder, result = seeds
    assert result.exit_code == 0, result.output
    assert {path.name for path in folder.iterdir()} == {"tiny-seed3", "tiny-seed5", "tiny-seeds.md", "tiny-seeds.json"}
    report = json.loads((folder / "tiny-seeds.json").read_text(encoding="utf-8"))
    assert [found["seed"] for found in report["seeds"]] == [3, 5]
    energies = []
    for found in report["seeds"]:
        last = read_evaluations(folder / found["run"] / "evaluations.csv")[-1]
        assert found["last"]["success"] == last.success
        energies.append(last.energy_per_metre)
    mean = report["means"]["energy_per_metre"]
    # Two values: the deviation is their distance / sqrt(2), and t of one degree of freedom 12.706.
    half = 12.7062 * abs(energies[0] - energies[1]) / 2.0
    assert mean["value"] == pytest.approx(sum(energies) / 2.0)
    assert mean["interval"] == pytest.approx([mean["value"] - half, mean["value"] + half], rel=1e-4)
    assert "| mean of 2 seeds |" in (folder / "tiny-seeds.md").read_text(encoding="utf-8")
    shown = result.stdout.splitlines()
    assert any(line.startswith((" mean of 2 seeds", "mean of 2 seeds")) for line in shown)
    assert "|" not in result.stdout  # a table, not Markdown


def test_the_figures_stand_on_standard_output(seeds: tuple[Path, Result]) -> None:
    folder, result = seeds
    lines = result.stdout.splitlines()
    for last in (read_evaluations(folder / f"tiny-seed{seed}" / "evaluations.csv")[-1] for seed in (3, 5)):
        (line,) = [
            line for line in lines if line.startswith("512 decisions: ") and f"{last.energy_per_metre:.0f} J/m" in line
        ]
        assert f"success {last.success:.1%}" in line
    assert sum(line.startswith("256 of 512 decisions: ") for line in lines) == 2


def test_the_best_policy_is_the_one_of_the_best_evaluation(seeds: tuple[Path, Result]) -> None:
    run = seeds[0] / "tiny-seed3"
    evaluations = read_evaluations(run / "evaluations.csv")
    assert len(evaluations) == 2
    best = max(evaluations, key=lambda found: (found.success, -found.energy_per_metre))
    source = PolicyCard.read(run / "best" / "policy.json").source
    assert source["decisions"] == source["evaluation"]["decisions"] == best.decisions
    assert source["seed"] == 3
    drives = drive_all(
        lambda env: TrainedPolicy.load(env, run / "best"),
        range(2_000_000, 2_000_003),
        arguments={"terrain": "plane", "goal_distance": 1.2},
    )
    energy = sum(drive.energy for drive in drives) / sum(drive.distance for drive in drives)
    assert energy == pytest.approx(best.energy_per_metre, rel=1e-3)


def an_evaluation(success: float, energy: float) -> TrainingEvaluation:
    return TrainingEvaluation(1, 100, round(100 * success), success, 0.0, 1.0, energy, 1.0)


@pytest.mark.parametrize(
    ("one", "other", "is_better"),
    [
        (an_evaluation(0.9, 500.0), an_evaluation(0.8, 100.0), True),
        (an_evaluation(0.8, 90.0), an_evaluation(0.8, 100.0), True),
        (an_evaluation(0.8, 100.0), an_evaluation(0.8, 100.0), False),
        (an_evaluation(0.7, 90.0), an_evaluation(0.8, 100.0), False),
        (an_evaluation(0.8, math.nan), an_evaluation(0.8, 100.0), False),
    ],
)
def test_better_is_more_success_and_then_less_energy(
    one: TrainingEvaluation, other: TrainingEvaluation, is_better: bool
) -> None:
    assert one.is_better_than(other) == is_better


def test_a_training_that_goes_on_keeps_the_best_policy(config: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    arguments = ("train", config, "--output", run, "--no-progress")
    assert rover(*arguments, "--steps", 256).exit_code == 0
    path = run / "best" / "policy.json"
    card = json.loads(path.read_text(encoding="utf-8"))
    card["source"]["evaluation"] |= {"success": 1.5}  # which nothing beats
    path.write_text(json.dumps(card), encoding="utf-8")
    result = rover(*arguments, "--resume")
    assert result.exit_code == 0, result.output
    assert json.loads(path.read_text(encoding="utf-8")) == card
    assert "best so far" not in result.stdout
    # Other fields: their figures cannot be compared, so the next evaluation is the best.
    changed = tmp_path / "changed.yaml"
    changed.write_text(yaml.safe_dump(TINY | {"evaluation": {"every": 256, "episodes": 2}}), encoding="utf-8")
    output_of("train", changed, "--output", run, "--no-progress", "--resume", "--steps", 768)
    assert PolicyCard.read(path).source["decisions"] == 768


@pytest.mark.takes_long("trains two seeds, one of them in two parts")
def test_a_second_call_with_resume_finishes_the_seeds_that_are_missing(config: Path, tmp_path: Path) -> None:
    arguments = ("train", config, "--output", tmp_path, "--no-progress", "--steps", 256)
    assert rover(*arguments, "--seeds", 1, "--seeds", 2).exit_code == 0
    output_of(*arguments, "--resume", "--seeds", 1, 2, 4)
    reports = [json.loads((tmp_path / f"tiny-seed{seed}" / "run.json").read_text("utf-8")) for seed in (1, 2, 4)]
    assert [report["resumed_from"] for report in reports] == [256, 256, 0]
    assert [report["decisions"] for report in reports] == [256, 256, 256]


@pytest.mark.parametrize("name", [name for name in SHIPPED_CONFIGURATIONS if name != "anywhere"])
def test_a_configuration_of_the_package_is_shown_as_it_is_read(name: str) -> None:
    result = rover("train", name, "--show")
    assert result.exit_code == 0
    assert parse_config(yaml.safe_load(result.stdout)) == read_config(FOLDER / f"{name}.yaml")


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    error = error_of("train", "rocks", "--output", tmp_path / "run")
    assert error == "error: stable_baselines3 is not installed: pip install 'rover-gym[train]'\n"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("moon",), "error: CONFIG: must be a YAML file or one of anywhere, plane, rocks"),
        (("plane", "--seeds", "499"), "498"),
    ],
)
def test_wrong_arguments_are_named(
    arguments: tuple[str, ...], message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    result = rover("train", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not list(tmp_path.iterdir())


def test_each_evaluation_films_its_first_fields(config: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for package in ("vtkmodules", "imageio_ffmpeg"):
        pytest.importorskip(package, reason="the extra render is not installed")
    films: list[tuple[str, int]] = []

    def film(path: Path, _make: object, arguments: Mapping[str, Any], seed: int) -> None:
        assert arguments == {"terrain": "plane", "goal_distance": 1.2}
        films.append((path.relative_to(tmp_path).as_posix(), seed))

    monkeypatch.setattr("rover_gym.learning.training_evaluation.film_episode", film)
    output_of("train", config, "--output", tmp_path / "run", "--no-progress", "--films", 2)
    assert films == [
        (f"run/films/{decisions:09d}-seed{seed}.mp4", seed)
        for decisions in (256, 512)
        for seed in (2_000_000, 2_000_001)
    ]


def test_an_episode_is_filmed_to_its_end(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules", reason="the extra render is not installed")
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra render is not installed")
    path = tmp_path / "films" / "episode.mp4"
    episode = film_episode(path, PDPolicy, {"goal_distance": 1.2, "control_frequency": 5.0}, 2_000_000)
    assert episode.success
    frames, _seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == round(episode.time * 5.0) + 1 + ENDING


@pytest.mark.parametrize(
    ("freedom", "quantile"), [(1, 12.7062047), (2, 4.3026527), (3, 3.1824463), (10, 2.2281389), (101, 1.9837310)]
)
def test_students_quantile_is_the_tables(freedom: int, quantile: float) -> None:
    # Abramowitz and Stegun 1964, table 26.10, has the first four with three decimals.
    assert student_quantile(freedom) == pytest.approx(quantile, rel=1e-7)


def test_an_interval_over_seeds_needs_two() -> None:
    assert seed_estimate([0.5]).value == 0.5
    assert math.isnan(seed_estimate([0.5]).interval[0])
    assert math.isnan(seed_estimate([]).value)


def test_optuna_searches_and_writes_the_best(tune: Callable[..., Result], config: Path, tmp_path: Path) -> None:
    arguments = (config, "--trials", 1, "--steps", 256, "--episodes", 2, "--output", tmp_path)
    assert tune(*arguments).exit_code == 0
    result = tune(*arguments)  # goes on
    assert result.exit_code == 0, result.output
    assert "best: trial" in result.output
    assert sorted(folder.name for folder in tmp_path.glob("trial-*")) == ["trial-0", "trial-1"]
    rates = [read_config(folder / "config.yaml").ppo.learning_rate for folder in sorted(tmp_path.glob("trial-*"))]
    written = read_config(tmp_path / "best.yaml")
    assert written.ppo.learning_rate in rates
    assert written.evaluation == read_config(config).evaluation
    assert rates[0] != rates[1]
