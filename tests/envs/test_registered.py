"""Every registered environment keeps the contracts of Gymnasium, stable-baselines3 and this package.

Alone and as a vector, with its defaults and with arguments that change the spaces, the ground or the rover.
"""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from machines import MACHINES

from rover_gym import HeightField
from rover_gym.registration import ENVIRONMENTS
from rover_gym.vector import RoverVectorEnv

#: `RoverGrains-v0` settles its grains for ten seconds; `test_grains.py` has its checks.
NAMES = [name for name in ENVIRONMENTS if name != "RoverGrains-v0"]
VECTORS = [name for name, known in ENVIRONMENTS.items() if known.vector_entry_point]

RANDOMISED: dict[str, Any] = {
    "slope_deg": (0.0, 10.0),
    "goal_distance": (0.6, 1.0),
    "mass_scale": (0.8, 1.2),
    "friction": (0.4, 0.9),
    "actuator_gain": (0.7, 1.3),
    "gravity_scale": (0.4, 1.2),
    "observation_noise": 0.01,
}
ROCKS: dict[str, Any] = {"height_scan": (5, 3, 0.4), "difficulty": (0.0, 1.0)}
FIELD = HeightField.fractal(80.0, 0.5, 0.05, seed=1)
VARIANTS = [
    pytest.param("Rover-v0", RANDOMISED, id="randomised"),
    pytest.param("RoverRocks-v0", ROCKS, id="rocks with a scan"),
    pytest.param("RoverHills-v0", {"height_scan": (3, 3, 0.5)}, id="hills with a scan"),
    pytest.param("Rover-v0", {"terrain": FIELD, "height_scan": (3, 3, 0.5)}, id="map"),
    pytest.param("Rover-v0", {"steered": False}, id="not steered"),
    pytest.param("RoverRocks-v0", {"steered": False, **ROCKS}, id="not steered, among rocks"),
    pytest.param("Rover-v0", {"steered": False, "mass_scale": (0.8, 1.2)}, id="not steered, random mass"),
    *(
        pytest.param("RoverRocks-v0", {"model": model, "difficulty": 0.5}, id=f"rover {name}")
        for name, (_, model) in MACHINES.items()
    ),
]
#: They wrap a rover whose snapshot does not hold their last observation, and their vectors give further infos.
WRAPPERS = ("RoverCommand-v0", "RoverGoal-v0")
TRAP: dict[str, Any] = {"observation_noise": 0.01, "friction": (0.5, 0.8), "battery": 3000.0}
SINGLE = [*(pytest.param(name, {}, id=name) for name in NAMES), *VARIANTS]
EPISODES = [*SINGLE, pytest.param("RoverTrap-v0", TRAP, id="trap, randomised")]
MANY = [*(pytest.param(name, {}, id=name) for name in VECTORS), *VARIANTS]

LIMIT = 7


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
@pytest.mark.parametrize(("name", "arguments"), SINGLE)
def test_gymnasiums_checker_has_nothing_to_say(name: str, arguments: dict[str, Any]) -> None:
    """Some environments are wrappers of another, which the checker does not expect."""
    env: Any = gym.make(name, **arguments)
    while isinstance(env, TimeLimit | OrderEnforcing | PassiveEnvChecker):
        env = env.env
    check_env(env, skip_render_check=bool(arguments))


@pytest.mark.parametrize(("name", "arguments"), SINGLE)
def test_stable_baselines3s_checker_has_nothing_to_say(name: str, arguments: dict[str, Any]) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(name, **arguments), warn=True, skip_render_check=bool(arguments))


@pytest.mark.parametrize("name", NAMES)
def test_an_environment_is_made_again_from_its_spec(name: str) -> None:
    env = gym.make(name, max_episode_steps=LIMIT)
    assert env.spec is not None
    again = gym.make(env.spec)
    assert str(again) == str(env)
    one, other = env.reset(seed=1), again.reset(seed=1)
    assert data_equivalence(one, other, exact=True)


def rollout(env: gym.Env[Any, Any], n_steps: int, seed: int = 7) -> list[Any]:
    """Observations, rewards, ends and infos under random actions, across a reset."""
    rng = np.random.default_rng(seed)
    seen: list[Any] = []
    for i in range(n_steps):
        seen.append(env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)))
        if i == n_steps // 2:
            seen.append(env.reset())
    return [bits(one) for one in seen]


@pytest.mark.parametrize(("name", "arguments"), EPISODES)
def test_same_seed_same_bits(name: str, arguments: dict[str, Any]) -> None:
    """Whether the environment is new or has driven before."""
    env = gym.make(name, **arguments)
    runs = [[bits(each.reset(seed=11)), *rollout(each, 20)] for each in (env, env, gym.make(name, **arguments))]
    assert runs[0] == runs[1] == runs[2]
    assert bits(env.reset(seed=12)) != runs[0][0]


@pytest.mark.parametrize(("name", "arguments"), EPISODES)
def test_a_snapshot_a_pickle_and_a_copy_continue_bit_for_bit(name: str, arguments: dict[str, Any]) -> None:
    env = gym.make(name, **arguments)
    env.reset(seed=3)
    rollout(env, 11, seed=5)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301 - our own bytes
    rover: Any = env.unwrapped
    snapshot = rover.snapshot()
    first = rollout(env, 20)
    for other in copies:
        assert rollout(other, 20) == first
    if name not in WRAPPERS:
        rover.restore(snapshot)
        assert rollout(env, 20) == first
        # Not spent by the first restore, and as good in another process and environment.
        fresh: Any = gym.make(name, **arguments)
        fresh.reset(seed=99)
        fresh.unwrapped.restore(pickle.loads(pickle.dumps(snapshot)))  # noqa: S301 - our own bytes
        assert rollout(fresh, 20) == first


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(("name", "arguments"), MANY)
def test_the_vector_of_the_core_is_a_sync_vector_bit_for_bit(
    name: str, arguments: dict[str, Any], mode: AutoresetMode
) -> None:
    given = {"max_episode_steps": LIMIT, **arguments}
    ours: Any = gym.make_vec(name, 3, autoreset_mode=mode, threads=2, **given)
    assert type(ours.unwrapped) is RoverVectorEnv
    theirs: Any = gym.make_vec(name, 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **given)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    for space in ("single_observation_space", "single_action_space", "observation_space", "action_space"):
        assert getattr(ours, space) == getattr(theirs, space)
    assert_same(name, ours.reset(seed=5), theirs.reset(seed=5))
    assert ours.np_random_seed == theirs.np_random_seed
    draws = np.random.default_rng(0)
    ended = 0
    for _ in range(2 * LIMIT + 3):
        action = draws.uniform(-1.0, 1.0, ours.action_space.shape).astype(np.float32)
        one, other = ours.step(action), theirs.step(action)
        assert_same(name, one, other)
        ended += int((one[2] | one[3]).sum())
    assert ended >= 6
    assert_same(name, ours.reset(), theirs.reset())


def assert_same(name: str, ours: tuple[Any, ...], theirs: tuple[Any, ...]) -> None:
    """Results of a vector: bits of the arrays, and the entries of the infos."""
    assert name in WRAPPERS or ours[-1].keys() == theirs[-1].keys()
    assert bits(ours[:-1]) == bits(theirs[:-1])
    for key, value in theirs[-1].items():
        assert data_equivalence(ours[-1].get(key), value, exact=True), key


@pytest.mark.parametrize("name", NAMES)
def test_the_time_limit_is_the_registered_one(name: str) -> None:
    limit = ENVIRONMENTS[name].max_episode_steps
    assert gym.spec(name).max_episode_steps == limit
    if name in VECTORS:
        envs: Any = gym.make_vec(name, 1)
        repeat = getattr(envs, "repeat", 1)
        assert envs.unwrapped.batch.max_episode_steps == limit * repeat
