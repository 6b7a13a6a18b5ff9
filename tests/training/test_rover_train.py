"""`rover train`: configurations by name, several seeds, beginning with a network, and what is refused."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import error_of, output_of, rover

from rover_gym import PDPolicy
from rover_gym.drive import ArcNetwork
from rover_gym.drive.comparison import ENDING, film_episode
from rover_gym.drive.forecast.network_files import FOLDER

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import yaml

TINY: dict[str, Any] = {
    "scenes": {"plane": {"environment": {"terrain": "plane", "goal_distance": 2.0}}},
    "rovers": 4,
    "group": 2,
    "imitation": {"rounds": 1, "decisions": 30, "epochs": 1, "batch_size": 16},
    "ppo": None,
    "evaluation": {"scenes": {"near": {"terrain": "plane", "goal_distance": 2.0}}, "fields": 2},
}


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump(TINY), encoding="utf-8")
    return path


def with_ppo(folder: Path, **options: Any) -> Path:
    """A configuration of PPO alone."""
    ppo = {"decisions": 32, "n_steps": 4, "batch_size": 16, "n_epochs": 1, **options}
    path = folder / "ppo.yaml"
    path.write_text(yaml.safe_dump({**TINY, "imitation": {"rounds": 0}, "ppo": ppo}), encoding="utf-8")
    return path


@pytest.mark.nightly("tests/training/test_rover_train.py::test_a_run_is_never_overwritten_and_its_figures_are_events")
def test_several_seeds_end_with_a_table(config: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    result = rover("train", config, "--seeds", 3, 5, "--output", runs, "--workers", 1)
    assert result.exit_code == 0, result.output
    assert {path.name for path in runs.iterdir()} == {"tiny-seed3", "tiny-seed5"}
    lines = [line.split() for line in result.stdout.splitlines()]
    rows = {line[0]: line for line in lines if line and line[0] in ("3", "5", "mean")}
    assert rows.keys() == {"3", "5", "mean"}
    assert float(rows["mean"][2]) == pytest.approx(0.5 * (float(rows["3"][2]) + float(rows["5"][2])), abs=0.005)
    told = json.loads(rover("train", config, "--output", tmp_path / "one", "--workers", 1, "--json").stdout)
    assert told["seeds"][0]["seed"] == 1
    assert told["seeds"][0]["stage"] == "imitation"


@pytest.mark.nightly("tests/training/test_arc_training.py::test_a_training_writes_a_network_and_goes_on")
def test_a_training_begins_with_a_network(config: Path, tmp_path: Path) -> None:
    """PPO alone, whose actor is held at first: the network stays the shipped one."""
    changed = with_ppo(tmp_path, every=16, warm_up=10_000)
    output_of("train", changed, "--from", "anywhere", "--output", tmp_path / "held", "--workers", 1)
    shipped = ArcNetwork.read(FOLDER / "anywhere" / "arcs.npz")
    held = ArcNetwork.read(tmp_path / "held" / "arcs.npz")
    for name, values in shipped.arrays.items():
        np.testing.assert_array_equal(values, held.arrays[name])
    with_ppo(tmp_path, every=16, warm_up=0)
    output_of("train", changed, "--from", tmp_path / "held", "--output", tmp_path / "free", "--workers", 1)
    free = ArcNetwork.read(tmp_path / "free" / "arcs.npz")
    assert not np.array_equal(shipped.arrays["dense_2"], free.arrays["dense_2"])
    assert "--from" in error_of("train", config, "--from", tmp_path, "--output", tmp_path / "none")


@pytest.mark.parametrize("name", ["anywhere", "rocks"])
def test_a_configuration_of_the_package_is_shown(name: str) -> None:
    assert "scenes:" in rover("train", name, "--show").stdout


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    error = error_of("train", "rocks", "--output", tmp_path / "run")
    assert error == "error: stable-baselines3 is not installed: pip install 'rover-gym[train]'\n"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("moon",), "error: CONFIG: must be a YAML file or one of anywhere, longer, rocks"),
        (("rocks", "--seeds", "499"), "498"),
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


@pytest.mark.nightly("tests/cli/test_drive.py::test_episodes_are_filmed")
def test_an_episode_is_filmed_to_its_end(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules", reason="the extra render is not installed")
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra render is not installed")
    path = tmp_path / "films" / "episode.mp4"
    episode = film_episode(path, PDPolicy, {"goal_distance": 1.2, "control_frequency": 5.0}, 2_000_000)
    assert episode.success
    frames, _seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == round(episode.time * 5.0) + 1 + ENDING


def test_a_run_is_never_overwritten_and_its_figures_are_events(config: Path, tmp_path: Path) -> None:
    """A second training into the same folder replaced the network of the first, and TensorBoard had nothing to show."""
    folder = tmp_path / "run"
    output_of("train", config, "--output", folder, "--workers", 1)
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    events = accumulator.EventAccumulator(str(folder / "tensorboard"))
    events.Reload()
    assert {"imitation/loss", "imitation/agreement", "evaluation/near"} <= set(events.Tags()["scalars"])
    before = (folder / "arcs.npz").read_bytes()
    error = error_of("train", config, "--output", folder, "--workers", 1, "--seed", 2)
    assert "--resume" in error
    assert (folder / "arcs.npz").read_bytes() == before


def test_a_run_without_a_round_cannot_be_resumed_and_the_error_says_what_to_do(config: Path, tmp_path: Path) -> None:
    """A training that was interrupted in its first round was answered with "is not there" and a file of ours."""
    error = error_of("train", config, "--output", tmp_path / "run", "--workers", 1, "--resume")
    assert error == f"error: --resume: no round has ended there: train without resuming, got '{tmp_path / 'run'}'\n"


def test_a_long_training_says_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two evaluations, for minutes, a training printed nothing."""
    monkeypatch.setattr("rover_gym.learn.arc_recipe.SILENCE", 0.0)
    changed = with_ppo(tmp_path, every=1000)
    said = output_of("train", changed, "--from", "anywhere", "--output", tmp_path / "run", "--workers", 1)
    assert "16 of 32 decisions, 50%" in said
