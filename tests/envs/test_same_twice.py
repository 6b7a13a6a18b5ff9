"""Same seed, same bits; a snapshot, a pickle and a copy continue as the original does."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from rover_gym import RoverEnv, StateError

OPTIONS: dict[str, Any] = {"slope_deg": (0.0, 10.0)}


def rollout(env: gym.Env[Any, Any], n_steps: int, seed: int = 7) -> list[Any]:
    """Observations, rewards, ends and infos under random actions, across a reset."""
    rng = np.random.default_rng(seed)
    seen: list[Any] = []
    for i in range(n_steps):
        seen.append(env.step(rng.uniform(-1.0, 1.0, 12).astype(np.float32)))
        if i == n_steps // 2:
            seen.append(env.reset())
    return seen


def assert_equal_bits(a: list[Any], b: list[Any]) -> None:
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_same_seed_same_bits() -> None:
    runs = []
    for _ in range(2):
        env = gym.make("Rover-v0", **OPTIONS)
        runs.append([env.reset(seed=11), *rollout(env, 40)])
    assert_equal_bits(*runs)


def test_reset_leaves_nothing_behind(env: RoverEnv) -> None:
    first = [env.reset(seed=11), *rollout(env, 10)]
    rollout(env, 13, seed=8)
    assert_equal_bits(first, [env.reset(seed=11), *rollout(env, 10)])


def test_other_seed_other_start(env: RoverEnv) -> None:
    assert not np.array_equal(env.reset(seed=1)[0], env.reset(seed=2)[0])


def test_snapshot_continues_bit_for_bit() -> None:
    env = RoverEnv(**OPTIONS)
    env.reset(seed=3)
    rollout(env, 11, seed=5)
    snapshot = env.snapshot()
    first = rollout(env, 20)
    env.restore(snapshot)
    assert_equal_bits(first, rollout(env, 20))
    # Not spent by the first restore, and as good in another process and environment.
    other = RoverEnv(**OPTIONS)
    other.reset(seed=99)
    other.restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own bytes
    assert_equal_bits(first, rollout(other, 20))


def by_pickle(env: gym.Env[Any, Any]) -> gym.Env[Any, Any]:
    restored: gym.Env[Any, Any] = pickle.loads(pickle.dumps(env))  # noqa: S301 - our own bytes
    return restored


@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_copy_continues_bit_for_bit(duplicate: Callable[[Any], Any]) -> None:
    env = gym.make("Rover-v0", **OPTIONS)
    env.reset(seed=3)
    rollout(env, 11, seed=5)
    other = duplicate(env)
    first = rollout(env, 20)
    assert_equal_bits(first, rollout(other, 20))


def test_copy_before_reset_works() -> None:
    assert_equal_bits([copy.deepcopy(RoverEnv()).reset(seed=1)], [RoverEnv().reset(seed=1)])


def test_snapshot_before_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        RoverEnv().snapshot()


def test_restore_refuses_what_is_no_snapshot(env: RoverEnv) -> None:
    before = env.snapshot()
    with pytest.raises(StateError) as caught:
        env.restore("nonsense")  # type: ignore[arg-type]
    assert caught.value.field == "snapshot"
    assert env.snapshot().simulation == before.simulation
