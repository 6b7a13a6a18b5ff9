"""Actions outside [-1, 1]: one rule for all environments."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from refusals import refused

from rover_gym import RoverEnv
from rover_gym.core import CommandError
from rover_gym.envs.vector.sb3 import RoverVecEnv

BEYOND = np.linspace(-1.5, 1.5, 12, dtype=np.float32)
OUTSIDE = int((np.abs(BEYOND) > 1.0).sum())


def test_an_action_of_a_rescaled_box_at_its_own_bound_is_taken():
    """Rounding made 1.0000001 of the upper bound, and the rover refused it."""
    env = gym.wrappers.RescaleAction(gym.make("Rover-v0"), np.float32(0.1), np.float32(0.9))
    env.reset(seed=0)
    assert np.isfinite(env.step(env.action_space.high)[1])


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_a_finite_action_is_clipped_and_counted(terrain):
    env, other = RoverEnv(terrain=terrain), RoverEnv(terrain=terrain)
    assert env.reset(seed=3)[1]["clipped_actions"] == 0
    other.reset(seed=3)
    given, plain = env.step(BEYOND), other.step(np.clip(BEYOND, -1.0, 1.0))
    np.testing.assert_array_equal(given[0], plain[0])
    assert given[1:4] == plain[1:4]
    assert (given[4]["clipped_actions"], plain[4]["clipped_actions"]) == (OUTSIDE, 0)
    assert env.step(np.zeros(12, np.float32))[4]["clipped_actions"] == 0
    env.step(BEYOND)
    assert env.reset(seed=4)[1]["clipped_actions"] == 0


def test_functions_of_the_reward_get_the_clipped_action():
    seen = []

    def largest(_before, action, _after, info):
        seen.append((float(np.abs(action).max()), info["clipped_actions"]))
        return 0.0

    env = RoverEnv(reward_terms={"largest": largest})
    env.reset(seed=0)
    env.step(BEYOND)
    assert seen == [(1.0, OUTSIDE)]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_action_that_is_not_finite_is_refused(value):
    action = BEYOND.copy()
    action[4] = value
    env = RoverEnv()
    env.reset(seed=0)
    with refused(CommandError, "action[4]", "must be finite"):
        env.step(action)
    vector = gym.make_vec("Rover-v0", num_envs=2)
    vector.reset(seed=0)
    with refused(CommandError, "action[1, 4]", "must be finite"):
        vector.step(np.stack([BEYOND, action]))


def test_vectors_clip_and_count_as_single_environments_do():
    native = gym.make_vec("Rover-v0", num_envs=3)
    sync = SyncVectorEnv([lambda: gym.make("Rover-v0")] * 3)
    actions = np.stack([BEYOND, np.zeros(12, np.float32), 2.0 * np.ones(12, np.float32)])
    native.reset(seed=1)
    sync.reset(seed=1)
    ours, theirs = native.step(actions), sync.step(actions)
    for one, other in zip(ours[:4], theirs[:4], strict=True):
        np.testing.assert_array_equal(one, other)
    for infos in (ours[4], theirs[4]):
        assert infos["clipped_actions"].tolist() == [OUTSIDE, 0, 12]
        assert infos["_clipped_actions"].all()
    learner = RoverVecEnv(2)
    learner.reset()
    learner.step(actions[:2])


def test_commands_are_counted_by_the_same_key():
    command = np.array([1.5, 0.2, -1.0000001], np.float32)
    env = gym.make("RoverCommand-v0")
    env.reset(seed=0)
    assert env.step(command)[4]["clipped_actions"] == 2
    vector = gym.make_vec("RoverCommand-v0", num_envs=2)
    vector.reset(seed=0)
    assert vector.step(np.stack([command, 0.0 * command]))[4]["clipped_actions"].tolist() == [2, 0]
