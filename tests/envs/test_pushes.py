"""Random pushes disturb a rover as declared, alone and in a vector, and a seed repeats them."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from rover_gym.core import OptionError
from rover_gym.envs import PushOptions, RandomPushes
from rover_gym.envs.tasks import CommandVectorEnv, DriveByCommand
from rover_gym.envs.vector import RandomPushesVector

OPTIONS = {"force": (300.0, 900.0), "interval": (0.5, 1.0), "duration": (0.1, 0.3)}


def pushed(seed=3, steps=40, env=None, **options):
    """Forces and paths of an episode in which the rover stands."""
    env = env or RandomPushes(gym.make("Rover-v0"), **(OPTIONS | options))
    forces, places = [], []
    env.reset(seed=seed)
    for _ in range(steps):
        info = env.step(np.zeros(env.action_space.shape, np.float32))[4]
        forces.append(info["push"])
        places.append(env.unwrapped.simulation.q[:3])
    return np.array(forces), np.array(places)


def test_pushes_have_the_declared_strength_and_times():
    forces, _ = pushed(steps=400)
    dt = gym.make("Rover-v0").unwrapped.dt
    sizes = np.linalg.norm(forces, axis=1)
    on = sizes > 0.0
    assert not forces[:, 1].any()
    begins, ends = np.flatnonzero(np.diff(np.r_[0, on]) > 0), np.flatnonzero(np.diff(np.r_[on, 0]) < 0) + 1
    assert len(begins) > 10
    lasts, gaps = (ends - begins) * dt, np.r_[begins[0], begins[1:] - ends[:-1]] * dt
    assert 0.1 - dt <= lasts.min()
    assert lasts.max() <= 0.3 + dt
    assert gaps.min() >= 0.5
    assert gaps.max() <= 1.0 + dt
    assert 300.0 <= sizes[on].min() < 400.0
    assert 800.0 < sizes[on].max() <= 900.0
    angles = np.arctan2(forces[begins, 2], forces[begins, 0])
    assert angles.min() < -1.0
    assert angles.max() > 1.0


def test_a_rover_moves_otherwise_from_its_first_push_on():
    env = RandomPushes(gym.make("Rover-v0"), **(OPTIONS | {"force": 600.0, "duration": 0.5}))
    calm = gym.make("Rover-v0")
    env.reset(seed=2)
    calm.reset(seed=2)
    np.testing.assert_array_equal(env.unwrapped.simulation.q, calm.unwrapped.simulation.q)
    drift, total = [], np.zeros(3)
    for _ in range(30):
        action = np.zeros(env.action_space.shape, np.float32)
        total += env.step(action)[4]["push"] * env.unwrapped.dt
        calm.step(action)
        drift.append(np.abs(env.unwrapped.simulation.q[:3] - calm.unwrapped.simulation.q[:3]).max())
        if not total.any():
            assert drift[-1] == 0.0
    assert drift[-1] > 1e-4


def test_a_seed_repeats_the_pushes_and_changes_nothing_else():
    first, places = pushed()
    again, same = pushed()
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(places, same)
    other, _ = pushed(seed=4)
    assert (first != other).any()
    env, plain = RandomPushes(gym.make("Rover-v0"), 100.0), gym.make("Rover-v0")
    for seed in (5, None):
        np.testing.assert_array_equal(env.reset(seed=seed)[0], plain.reset(seed=seed)[0])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("repeat", [None, 4], ids=["actions", "commands"])
def test_a_vector_is_pushed_as_each_rover_alone(mode, repeat):
    arguments = {"max_episode_steps": 26}  # ends within a command
    envs = RandomPushesVector(gym.make_vec("Rover-v0", 3, autoreset_mode=mode, **arguments), **OPTIONS)
    alone = [RandomPushes(gym.make("Rover-v0", **arguments), **OPTIONS) for _ in range(3)]
    if repeat:
        envs = CommandVectorEnv(envs, repeat=repeat)
        alone = [DriveByCommand(env, repeat=repeat) for env in alone]
    envs.reset(seed=7)
    for i, env in enumerate(alone):
        env.reset(seed=7 + i)
    over, seen = [False] * 3, 0
    for k in range(30 if repeat else 70):
        actions = np.random.default_rng(k).uniform(-0.5, 0.5, envs.action_space.shape).astype(np.float32)
        observations, rewards, *_, infos = envs.step(actions)
        for i, env in enumerate(alone):
            if over[i] and mode == "NextStep":
                observation, info = env.reset()
                over[i] = False
            else:
                observation, reward, terminated, truncated, info = env.step(actions[i])
                assert rewards[i] == reward
                over[i] = terminated or truncated
            np.testing.assert_array_equal(infos["push"][i], info["push"])
            if over[i] and mode == "SameStep":
                told = infos["final_info"] if repeat else infos
                np.testing.assert_array_equal(told["push"][i], info["push"])
                observation, _ = env.reset()
            np.testing.assert_array_equal(observations[i], observation)
            seen += bool(info["push"].any())
    assert seen > 10


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_wrapper_passes_gymnasiums_checker():
    env = RandomPushes(gym.make("Rover-v0"), 300.0, interval=0.1)
    check_env(env, skip_render_check=True)  # warns of the missing bounds, too
    assert env.spec is not None
    assert env.options == PushOptions(300.0, interval=0.1)
    with pytest.raises(ResetNeeded):
        RandomPushes(gym.make("Rover-v0").unwrapped, 300.0).step(np.zeros(12, np.float32))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"force": -1.0}, "force: must be at least 0"),
        ({"force": (2.0, 1.0)}, "force: must be a pair"),
        ({"force": 1.0, "interval": -1.0}, "interval"),
        ({"force": 1.0, "duration": float("nan")}, "duration"),
        ({"force": 1.0, "solid": "mast"}, "solid: must be one of trunk"),
        ({"force": 1.0, "point": (0.0, 0.0)}, "point"),
        ({"force": 1.0, "strength": 3.0}, "strength: is unknown"),
    ],
)
def test_wrong_pushes_are_refused(options, message):
    with pytest.raises(OptionError, match=message):
        RandomPushes(gym.make("Rover-v0"), **options)
    with pytest.raises(OptionError, match=message):
        RandomPushesVector(gym.make_vec("Rover-v0", 2), **options)


def test_other_environments_are_refused():
    with pytest.raises(OptionError, match="env: must be a RoverEnv"):
        RandomPushes(gym.make("CartPole-v1"), 1.0)
    with pytest.raises(OptionError, match="env: must be a RoverVectorEnv"):
        RandomPushesVector(gym.make("Rover-v0"), 1.0)
