"""`RoverCommand-v0`: the card beside the spaces, its arguments, and what is refused."""

import inspect
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from rover_gym import CommandError, OptionError, TerrainError
from rover_gym.env import ARGUMENTS
from rover_gym.policy import CommandLimits, DriveByCommand, RoverCommandEnv, RoverCommandVectorEnv


def test_the_card_is_the_signature() -> None:
    card = inspect.getdoc(RoverCommandEnv) or ""
    own = {name: p for name, p in inspect.signature(RoverCommandEnv).parameters.items() if name not in ARGUMENTS}
    text = card.split("## Arguments\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    assert {row[0]: row[1] for row in rows[2:]} == {
        name: f"{p.default:g}" if isinstance(p.default, float) else str(p.default) for name, p in own.items()
    }
    vector = inspect.signature(RoverCommandVectorEnv).parameters
    assert {name: vector[name].default for name in own} == {name: p.default for name, p in own.items()}
    assert {name: own[name].default for name in vars(CommandLimits())} == vars(CommandLimits())


def test_it_is_the_wrapper_around_the_rover() -> None:
    arguments: dict[str, Any] = {"terrain": "rocks", "difficulty": 0.3, "height_scan": (8, 4, 0.2)}
    ours = gym.make("RoverCommand-v0", repeat=3, guided=True, pool=2, speed=0.8, **arguments)
    theirs = DriveByCommand(gym.make("Rover-v0", **arguments), repeat=3, guided=True, pool=2, speed=0.8)
    assert ours.observation_space == theirs.observation_space
    assert ours.reset(seed=3)[0].tobytes() == theirs.reset(seed=3)[0].tobytes()
    for _ in range(5):
        action = np.array([0.2, -0.3, 0.1], np.float32)
        one, other = ours.step(action), theirs.step(action)
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_an_episode_ends_after_a_minute_of_commands() -> None:
    envs: Any = gym.make_vec("RoverCommand-v0", 2, goal_distance=50.0, threads=1, time_step=0.025)
    envs.reset(seed=0)
    for k in range(200):
        *_, truncated, infos = envs.step(np.zeros((2, 3), np.float32))
        assert truncated.all() == (k == 199)
    assert infos["time"][0] == pytest.approx(60.0)


def test_statistics_of_episodes_are_recorded_around_it() -> None:
    envs: Any = RecordEpisodeStatistics(
        gym.make_vec("RoverCommand-v0", 2, max_episode_steps=3, autoreset_mode="SameStep")
    )
    envs.reset(seed=0)
    for _ in range(3):
        *_, infos = envs.step(np.ones((2, 3), np.float32))
    assert infos["episode"]["l"].tolist() == [3, 3]
    assert infos["final_obs"][0].shape == envs.single_observation_space.shape


def test_an_episode_that_cannot_begin_is_refused_by_the_next_command(monkeypatch: pytest.MonkeyPatch) -> None:
    envs: Any = gym.make_vec("RoverCommand-v0", 2, max_episode_steps=1, autoreset_mode="SameStep")
    envs.reset(seed=0)

    def refuse(*_: Any, **__: Any) -> Any:
        raise TerrainError("no room")

    command = np.zeros((2, 3), np.float32)
    with monkeypatch.context() as patch:
        patch.setattr(envs.unwrapped, "reset", refuse)
        *_, truncated, infos = envs.step(command)
        assert truncated.all()
        assert "final_obs" in infos
        time = envs.unwrapped.batch.info(0)["time"]
        with pytest.raises(TerrainError):
            envs.step(command)
        assert envs.unwrapped.batch.info(0)["time"] == time
    assert not envs.step(command)[3].any()  # the step that begins the episodes
    assert envs.step(command)[3].all()


def test_a_bad_command_changes_nothing() -> None:
    env = gym.make("RoverCommand-v0")
    env.reset(seed=0)
    with pytest.raises(CommandError):
        env.step(np.array([0.0, np.nan, 0.0], np.float32))
    with pytest.raises(OptionError, match="autoreset_mode"):
        gym.make_vec("RoverCommand-v0", 2, autoreset_mode="Disabled")
