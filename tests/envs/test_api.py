"""The environment keeps Gymnasium's contract, and stable-baselines3's."""

import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import rover_gym
from rover_gym import RoverEnv


@pytest.mark.parametrize("name", ["Rover-v0", "rover_gym:Rover-v0"])
def test_gymnasiums_checker_has_nothing_to_say(name: str) -> None:
    # Warnings are errors in this suite, so a warning of the checker fails the test too.
    check_env(gym.make(name).unwrapped)


def test_stable_baselines3s_checker_has_nothing_to_say() -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make("Rover-v0").unwrapped, warn=True)


def test_gymnasium_finds_the_environment_by_module_name() -> None:
    program = "import gymnasium as gym; print(gym.make('rover_gym:Rover-v0').spec.id)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "Rover-v0"


def test_registering_twice_changes_nothing() -> None:
    rover_gym.registration.register_environments()


def test_step_before_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        RoverEnv().step(np.zeros(12, np.float32))


def test_what_comes_back_is_plain(env: RoverEnv) -> None:
    def plain(value: Any) -> bool:
        if isinstance(value, dict):
            return all(isinstance(key, str) and plain(entry) for key, entry in value.items())
        return type(value) in {bool, int, float, str}

    _, reset_info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert observation.dtype == np.float32
    assert type(reward) is float
    assert type(terminated) is bool
    assert type(truncated) is bool
    assert plain(info)
    assert plain(reset_info)
    assert info.keys() == reset_info.keys()
    assert info["reward_terms"].keys() == reset_info["reward_terms"].keys()


def test_arrays_are_fresh(env: RoverEnv) -> None:
    first, _ = env.reset(seed=1)
    action = np.full(12, 0.5, np.float32)
    second, *_ = env.step(action)
    kept = second.copy()
    assert first.base is None
    assert second.base is None
    assert not np.shares_memory(first, second)
    # Neither the action that was given nor the observation that was returned is still in use.
    snapshot = env.snapshot()
    third, *_ = env.step(action)
    np.testing.assert_array_equal(second, kept)
    env.restore(snapshot)
    action_again = action.copy()
    action[:], second[:], third_kept = 0.0, np.nan, third.copy()
    again, *_ = env.step(action_again)
    np.testing.assert_array_equal(again, third_kept)


def test_vector_environment_equals_single_ones() -> None:
    vector = gym.make_vec("Rover-v0", num_envs=2, vectorization_mode="sync")
    singles = [gym.make("Rover-v0") for _ in range(2)]
    observations, _ = vector.reset(seed=[3, 4])
    for i, single in enumerate(singles):
        np.testing.assert_array_equal(single.reset(seed=3 + i)[0], observations[i])
    vector.action_space.seed(0)
    for _ in range(5):
        actions = vector.action_space.sample()
        observations, rewards, *_ = vector.step(actions)
        for i, single in enumerate(singles):
            observation, reward, *_ = single.step(actions[i])
            np.testing.assert_array_equal(observation, observations[i])
            assert reward == rewards[i]
    vector.close()
