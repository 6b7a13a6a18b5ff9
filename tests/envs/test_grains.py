"""`RoverGrains-v0`: Gymnasium's checks, seeds, snapshots, bad input, and the grains in what the rover sees."""

import copy
import pickle
from dataclasses import fields

import gymnasium as gym
import numpy as np
import pytest
from equal_bits import bits
from gymnasium.utils.env_checker import check_env

from rover_gym.core import CommandError, OptionError, StateError
from rover_gym.drive import PDPolicy
from rover_gym.envs import EnvSnapshot, GrainsEnvSnapshot, RoverGrainsEnv
from rover_gym.ground.grains import Pit

#: A small pit just ahead of the wheels, with some 400 large grains.
SMALL = {
    "pit": Pit(begin=0.85, length=1.2, width=1.7, depth=0.08, bank_deg=30.0),
    "grain_radius": (0.032, 0.04),
    "goal_distance": 3.0,
    "heading_deg": 0.0,
    "goal_bearing_deg": 0.0,
}


@pytest.fixture(scope="module")
def env():
    env = RoverGrainsEnv(**SMALL)
    yield env
    env.close()


def drive(env, steps, torque=0.3):
    action = np.zeros(12, np.float32)
    action[:6] = torque
    return [env.step(action) for _ in range(steps)]


@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity")
def test_gymnasium_makes_and_checks_it():
    made = gym.make("RoverGrains-v0", **SMALL)
    check_env(made.unwrapped, skip_render_check=True)
    made.close()


def test_a_seed_gives_the_same_episode_and_another_seed_another_bed(env):
    first, _ = env.reset(seed=3)
    bed, places = env.bed, env.grains.position
    there = drive(env, 4)
    second, _ = env.reset(seed=3)
    np.testing.assert_array_equal(first, second)
    assert env.bed == bed
    np.testing.assert_array_equal(env.grains.position, places)
    again = drive(env, 4)
    for (a, reward_a, *_), (b, reward_b, *_) in zip(there, again, strict=True):
        np.testing.assert_array_equal(a, b)
        assert reward_a == reward_b
    beds = set()
    for seed in range(12):
        env.reset(seed=seed)
        beds.add(env.bed)
    assert len(beds) > 2


def test_wheels_feel_grains(env):
    env.reset(seed=0)
    layout = env.observation_layout
    overlaps = []
    for _ in range(40):
        observation, *_ = drive(env, 1, torque=0.5)[0]
        overlaps.append(env.grains.penetration())
        on_grains = set(env.simulation.contacts.wheels) & {0, 1}
        if env.simulation.q[0] > 0.6:
            break
    assert on_grains
    assert max(overlaps) < 0.02 * 0.032  # balls that a wheel flings within a step ended it 6.8 mm inside others
    contact = np.asarray(observation)[layout["wheel_contact"]]
    force = np.asarray(observation)[layout["normal_force"]]
    assert contact.sum() >= 3
    assert force[contact > 0].sum() > 3.0


def test_a_snapshot_continues_bit_for_bit(env):
    env.reset(seed=1)
    drive(env, 15)
    kept = pickle.loads(pickle.dumps(env.snapshot()))  # noqa: S301 - our own bytes
    assert isinstance(kept, GrainsEnvSnapshot)
    expected = drive(env, 5)
    places = env.grains.position
    env.reset(seed=9)
    drive(env, 3)
    env.restore(kept)
    for (a, *_), (b, *_) in zip(expected, drive(env, 5), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(env.grains.position, places)


def test_what_it_does_not_offer_is_refused():
    for name, value in (
        ("terrain", "plane"),
        ("height_scan", True),
        ("slope_deg", 3.0),
        ("pit", "deep"),
        ("grain_radius", -0.1),
        ("grain_friction", -1.0),
        ("n_beds", 0),
        ("sleep", 1),
    ):
        with pytest.raises(OptionError, match=name):
            RoverGrainsEnv(**{**SMALL, name: value})
    with pytest.raises(OptionError, match="radius_max"):
        RoverGrainsEnv(**{**SMALL, "grain_radius": (0.05, 0.06)}).reset(seed=0)


def test_a_refused_call_changes_nothing(env):
    env.reset(seed=2)
    drive(env, 2)
    before = env.snapshot()
    alone = EnvSnapshot(**{field.name: getattr(before, field.name) for field in fields(EnvSnapshot)})
    with pytest.raises(CommandError):
        env.step(np.full(12, np.nan, np.float32))
    with pytest.raises(OptionError):
        env.reset(options={"goal": (1.0,), "speed": 3})
    with pytest.raises(StateError):
        env.reset(seed=5, options={"position": (1.6, 0.0)})
    with pytest.raises(StateError):
        env.restore(alone)
    after = env.snapshot()
    assert after.grains == before.grains
    assert after.simulation == before.simulation
    assert after.random_state == before.random_state
    drive(env, 1)


def test_a_vector_of_them_is_one_of_single_rovers():
    """With its autoreset, its snapshots and its copies."""
    given = {"max_episode_steps": 3, **SMALL}
    ours = gym.make_vec("RoverGrains-v0", 2, autoreset_mode="SameStep", **given)
    theirs = gym.make_vec(
        "RoverGrains-v0", 2, vectorization_mode="sync", vector_kwargs={"autoreset_mode": "SameStep"}, **given
    )
    assert bits(ours.reset(seed=5)[0]) == bits(theirs.reset(seed=5)[0])
    policy = PDPolicy(ours)
    observation, _ = ours.reset(seed=5)
    for step in range(5):
        if step == 3:  # the second bed's first
            copied, kept = copy.deepcopy(ours), pickle.loads(pickle.dumps(ours.unwrapped.snapshot()))  # noqa: S301
        action = policy.predict(observation)[0]
        observation, *rest = ours.step(action)
        expected = theirs.step(action)
        assert bits((observation, *rest[:3])) == bits(expected[:4])
        assert bits(rest[3]["final_info"]["energy"]) == bits(expected[4]["final_info"]["energy"]) if step == 2 else True
    other = gym.make_vec("RoverGrains-v0", 2, autoreset_mode="SameStep", **given).unwrapped
    other.restore(kept)
    for one in (copied.unwrapped, other):
        for _ in range(2):
            seen, *_ = one.step(policy.predict(one.batch.observation)[0])
        assert bits(seen) == bits(observation)
