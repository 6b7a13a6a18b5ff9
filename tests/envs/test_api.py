"""What `Rover-v0` hands out and takes, beyond what `test_card.py` checks for every environment."""

import copy
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import rover_gym
from rover_gym import RoverEnv


def test_gymnasium_finds_the_environment_by_module_name() -> None:
    program = "import gymnasium as gym; print(gym.make('rover_gym:Rover-v0').spec.id)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "Rover-v0"


def test_registering_twice_changes_nothing() -> None:
    rover_gym.envs.registration.register_environments()


def test_step_and_snapshot_before_reset_are_refused() -> None:
    with pytest.raises(ResetNeeded):
        RoverEnv().step(np.zeros(12, np.float32))
    with pytest.raises(ResetNeeded):
        RoverEnv().snapshot()


def test_copy_before_reset_works() -> None:
    one, other = copy.deepcopy(RoverEnv()).reset(seed=1), RoverEnv().reset(seed=1)
    assert one[0].tobytes() == other[0].tobytes()
    assert one[1] == other[1]


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
