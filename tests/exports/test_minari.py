"""Minari data sets load, and their actions replay to the same observations bit for bit."""

import os
from functools import partial
from pathlib import Path
from typing import Any

import commands
import gymnasium as gym
import numpy as np
import pytest

from rover_gym import OptionError, PDPolicy
from rover_gym.envs.registration import ENVIRONMENTS

pytest.importorskip("minari")

import minari

from rover_gym.exports import write_dataset
from rover_gym.exports.minari_data import PLACE


def load(folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv(PLACE, str(folder))
    return minari.load_dataset(name)


def leaves(observations: Any) -> list[np.ndarray]:
    if isinstance(observations, dict):
        return [observations[name] for name in sorted(observations)]
    return [observations]


def seeds(data: Any) -> list[int]:
    return [int(facts["seed"]) for facts in data.storage.get_episode_metadata(data.episode_indices)]


def replayed(episode: Any, seed: int, env: gym.Env[Any, Any]) -> None:
    """Replays an episode's actions from its seed and compares everything, to the bit."""
    observation, _ = env.reset(seed=seed)
    for k, seen in enumerate(leaves(observation)):
        assert np.array_equal(leaves(episode.observations)[k][0], seen)
    for i, action in enumerate(episode.actions):
        observation, reward, terminated, truncated, _ = env.step(action)
        for k, seen in enumerate(leaves(observation)):
            assert np.array_equal(leaves(episode.observations)[k][i + 1], seen)
        assert reward == episode.rewards[i]
        assert (terminated, truncated) == (episode.terminations[i], episode.truncations[i])
    assert terminated or truncated


rover = partial(commands.rover, "dataset")


def test_a_policys_episodes_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ["--environment", "RoverRocks-v0", "--difficulty", "0.3", "--episodes", "2", "--seed", "7"]
    result = rover("rover/rocks-pd-v0", *options, "--output", tmp_path)
    assert result.exit_code == 0, result.output
    data = load(tmp_path, "rover/rocks-pd-v0", monkeypatch)
    assert data.total_episodes == 2
    assert seeds(data) == [7, 8]
    env = data.recover_environment()
    assert env.spec.kwargs["difficulty"] == 0.3
    for episode, seed in zip(data.iterate_episodes(), seeds(data), strict=True):
        assert len(episode.actions) > 20
        replayed(episode, seed, env)


@pytest.mark.parametrize("environment", ["RoverCommand-v0", "RoverGoal-v0", "RoverTrap-v0", "RoverBattery-v0"])
def test_random_actions_drive_any_environment(
    environment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = rover(
        "any-v1", "--environment", environment, "--policy", "random", "--episodes", "1", "--output", tmp_path
    )
    assert result.exit_code == 0, result.output
    data = load(tmp_path, "any-v1", monkeypatch)
    (episode,) = data.iterate_episodes()
    replayed(episode, *seeds(data), data.recover_environment())
    assert np.ptp(episode.actions, axis=0).min() > 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["a-v0", "--environment", "Rover-v9"], "--environment: must be one of Rover-v0, "),
        (["a-v0", "--environment", "RoverCommand-v0"], "--policy: must be 'random' for this environment"),
        (["a-v0", "--environment", "RoverGoal-v0"], "--policy: must be 'random' for this environment"),
        (["a-v0", "--policy", "nobody"], "--policy: must be 'pd', 'sand', 'scan', "),
        (["../a-v0"], "NAME: must be NAME-vN"),
        (["t/x-v0"], "NAME: must be NAME-vN"),  # Minari's own ValueError came
        (["tt/x-v007"], "NAME: must be NAME-vN"),
        (["a"], "NAME: must be NAME-vN"),
        (["a-v0", "--difficulty", "nan"], "--difficulty: must be finite"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(options: list[str], message: str, tmp_path: Path) -> None:
    result = rover(*options, "--episodes", "1", "--output", tmp_path)
    assert result.exit_code == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_data_set_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "a-v0").mkdir()
    with pytest.raises(OptionError, match="name: is already the name of a data set in"):
        write_dataset("a-v0", "Rover-v0", PDPolicy, [1], folder=tmp_path)


@pytest.mark.parametrize(
    ("seeds", "arguments", "message"),
    [
        ([], {}, "seeds: must be one"),
        ([1, 1], {}, "seeds: must be one"),
        ([0.5], {}, "seeds: must be a whole"),
        ([1], {"terrain": np.zeros(3)}, "arguments.terrain: must be a number"),
    ],
)
def test_bad_arguments_are_refused(seeds: list[Any], arguments: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=message):
        write_dataset("a-v0", "Rover-v0", PDPolicy, seeds, arguments=arguments, folder=tmp_path)
    assert not list(tmp_path.iterdir())
    assert PLACE not in os.environ


def test_an_interrupt_keeps_the_episodes_before_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(done: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_dataset("a-v0", "Rover-v0", PDPolicy, range(3), folder=tmp_path, progress=interrupt)
    assert load(tmp_path, "a-v0", monkeypatch).total_episodes == 1


def test_every_environment_is_offered() -> None:
    text = rover("--help").output
    assert all(name in text for name in ENVIRONMENTS)
