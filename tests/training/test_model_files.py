"""A model of stable-baselines3 drives by its file, and any environment of this package is recorded."""

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from commands import error_of, output_of
from refusals import refused

from rover_gym import OptionError
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.record import read_run
from rover_gym.show.replay import RecordEpisodes

learners = pytest.importorskip("stable_baselines3", reason="the extra train is not installed")
BRIEF = ("--time-limit", "0.6", "--json")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained model on commands."""
    path = tmp_path_factory.mktemp("model") / "model.zip"
    learners.PPO("MlpPolicy", gym.make("RoverCommand-v0", repeat=4), n_steps=8, batch_size=8, device="cpu").save(path)
    return path


def test_a_model_of_stable_baselines_drives_and_is_evaluated(model: Path, tmp_path: Path) -> None:
    """`rover drive` and `rover evaluate` knew only the package's own policies."""
    command = ("--environment", "RoverCommand-v0", "--argument", "repeat=4")
    told = json.loads(output_of("drive", "--policy", model, *command, *BRIEF, "--output", tmp_path / "drive"))
    assert told["environment"] == "RoverCommand-v0"
    assert told["arguments"]["repeat"] == 4
    assert told["episodes"][0]["time"] == pytest.approx(0.6)
    run = read_run(tmp_path / "drive" / "episode-0.h5")
    assert run.n_frames == 13, "each control period is a row, not each command"
    given = ("--episodes", 2, "--argument", "goal_distance=0.6", "--json", "--output", tmp_path / "evaluation")
    (row,) = json.loads(output_of("evaluate", model, *command, *given))["rows"]
    assert row["episodes"] == 2
    error = error_of("drive", "--policy", model, "--output", tmp_path / "none")
    assert "(82,)" in error
    assert "(91,)" in error


def test_a_file_that_is_no_model_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "model.zip").write_bytes(b"nothing")
    for policy in ("model.zip", "there-is-none.zip"):
        assert "stable-baselines3" in error_of("drive", "--policy", tmp_path / policy, "--output", tmp_path / "run")
    assert "RoverCommand-v0" in error_of("drive", "--environment", "Rover-v9", "--output", tmp_path / "run")
    assert "NAME=VALUE" in error_of("drive", "--argument", "repeat", "--output", tmp_path / "run")


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_any_environment_is_recorded(name: str, tmp_path: Path) -> None:
    """Only `rover drive` recorded, and `Rover-v0` and its like alone."""
    env: Any = RecordEpisodes(gym.make(name, max_episode_steps=2), tmp_path / "run", sensors=("laser",))
    env.action_space.seed(0)
    seeds = (3, 4)
    for seed in seeds:
        env.reset(seed=seed)
        ended = False
        while not ended:
            *_, terminated, truncated, info = env.step(env.action_space.sample())
            ended = terminated or truncated
    env.close()
    for k, seed in enumerate(seeds):
        run = read_run(tmp_path / "run" / f"episode-{k}.h5")
        assert run.trajectory.attributes["seed"] == seed
        assert run.trajectory.attributes["outcome"] in ("time", info["termination"])
        assert "laser" in run.trajectory.data
    assert run.time[-1] == pytest.approx(info["time"])
    np.testing.assert_array_equal(run.trajectory.data["q"][-1], env.unwrapped.simulation.q)
    with refused(OptionError, "folder", "another"):
        RecordEpisodes(gym.make(name), tmp_path / "run")


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with refused(OptionError, "env", "rover_gym"):
        RecordEpisodes(gym.make("CartPole-v1"), tmp_path)
    with refused(OptionError, "sensors.radar", "laser"):
        RecordEpisodes(gym.make("Rover-v0"), tmp_path, sensors=("radar",))


def test_the_page_of_a_recorded_environment_is_written(tmp_path: Path) -> None:
    env: Any = RecordEpisodes(gym.make("RoverCommand-v0", max_episode_steps=2), tmp_path)
    env.reset(seed=0)
    for _ in range(2):
        env.step(np.array([1.0, 0.3, 0.0], np.float32))
    env.close()
    run = tmp_path / "episode-0.h5"
    output_of("replay", run, "--html", tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 100_000
    output_of("plot", run, "--output", tmp_path / "plots")
    output_of("export", "mcap", run, "--output", tmp_path / "log.mcap")
