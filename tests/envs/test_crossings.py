"""A step calls the compiled core once."""

from typing import Any

import numpy as np
import pytest

from rover_gym import OptionError
from rover_gym.envs import RoverEnv
from rover_gym.envs.batch import RoverBatch
from rover_gym.envs.vector import RoverVectorEnv


class Counted:
    """Episodes that list what is asked of them."""

    def __init__(self, batch: RoverBatch) -> None:
        self._inner = batch.episodes
        self.asked: list[str] = []
        batch.episodes = self  # type: ignore[assignment] # in the place of what it wraps

    def __getattr__(self, name: str) -> Any:
        self.asked.append(name)
        return getattr(self._inner, name)


def test_a_step_of_an_environment_is_one_call() -> None:
    env = RoverEnv()
    env.reset(seed=1)
    calls = Counted(env.batch)
    for _ in range(3):
        env.step(np.zeros(12, np.float32))
    assert calls.asked == ["step"] * 3


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_step_of_a_vector_is_one_call_while_no_episode_begins(mode: str) -> None:
    envs = RoverVectorEnv(2, max_episode_steps=5, autoreset_mode=mode)
    envs.reset(seed=1)
    actions = np.zeros((2, 12), np.float32)
    envs.step(actions)
    calls = Counted(envs.batch)
    for _ in range(3):
        envs.step(actions)
    assert calls.asked == ["step"] * 3
    *_, truncated, infos = envs.step(actions)
    assert truncated.all()
    assert (infos["termination"] == "").all()


@pytest.mark.parametrize("info", [1, -1, "some", 0.0])
def test_infos_of_no_rover_are_refused_before_the_rover_moves(info: Any) -> None:
    env = RoverEnv()
    env.reset(seed=1)
    with pytest.raises(OptionError, match="index: must be"):
        env.batch.episodes.step(np.zeros((1, 12)), info=info)
    assert env.simulation.time == 0.0
