"""Every registered environment keeps the contracts of Gymnasium and of stable-baselines3, alone and as a vector."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from rover_gym.registration import ENVIRONMENTS
from rover_gym.vector import RoverVectorEnv

#: `RoverGrains-v0` settles its grains for ten seconds; `test_grains.py` has its checks.
NAMES = [name for name in ENVIRONMENTS if name != "RoverGrains-v0"]
VECTORS = [name for name, known in ENVIRONMENTS.items() if known.vector_entry_point]
LIMIT = 7


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_checker_has_nothing_to_say(name: str) -> None:
    """Some environments are wrappers of another, which the checker does not expect."""
    env: Any = gym.make(name)
    while isinstance(env, TimeLimit | OrderEnforcing | PassiveEnvChecker):
        env = env.env
    check_env(env)


@pytest.mark.parametrize("name", NAMES)
def test_stable_baselines3s_checker_has_nothing_to_say(name: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(name), warn=True)


@pytest.mark.parametrize("name", NAMES)
def test_an_environment_is_made_again_from_its_spec(name: str) -> None:
    env = gym.make(name, max_episode_steps=LIMIT)
    assert env.spec is not None
    again = gym.make(env.spec)
    assert str(again) == str(env)
    one, other = env.reset(seed=1), again.reset(seed=1)
    assert data_equivalence(one, other, exact=True)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", VECTORS)
def test_the_vector_of_the_core_is_a_sync_vector_bit_for_bit(name: str, mode: str) -> None:
    ours: Any = gym.make_vec(name, 3, max_episode_steps=LIMIT, autoreset_mode=mode, threads=2)
    assert type(ours.unwrapped) is RoverVectorEnv
    kwargs = {"autoreset_mode": ours.metadata["autoreset_mode"]}
    theirs: Any = gym.make_vec(name, 3, vectorization_mode="sync", vector_kwargs=kwargs, max_episode_steps=LIMIT)
    assert ours.single_observation_space == theirs.single_observation_space
    assert ours.single_action_space == theirs.single_action_space
    assert data_equivalence(ours.reset(seed=5), theirs.reset(seed=5), exact=True)
    draws = np.random.default_rng(0)
    ended = 0
    for _ in range(2 * LIMIT + 3):
        action = draws.uniform(-1.0, 1.0, ours.action_space.shape).astype(np.float32)
        one, other = ours.step(action), theirs.step(action)
        assert data_equivalence(one[:4], other[:4], exact=True)
        for key, value in other[4].items():
            assert data_equivalence(one[4].get(key), value, exact=True), key
        ended += int((one[2] | one[3]).sum())
    assert ended >= 6


@pytest.mark.parametrize("name", NAMES)
def test_the_time_limit_is_the_registered_one(name: str) -> None:
    limit = ENVIRONMENTS[name].max_episode_steps
    assert gym.spec(name).max_episode_steps == limit
    if name in VECTORS:
        envs: Any = gym.make_vec(name, 1)
        repeat = getattr(envs, "repeat", 1)
        assert envs.unwrapped.batch.max_episode_steps == limit * repeat
