"""Commands, features and the numpy network: what a trained policy is made of."""

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import CommandError, OptionError, PDPolicy, Plane, RoverEnv, SphereField, StateError
from rover_gym.policy import (
    CommandController,
    CommandLimits,
    CommandVectorEnv,
    DriveByCommand,
    Features,
    Network,
    PolicyCard,
    TrainedPolicy,
)

ROVER = RoverEnv()
RNG = np.random.default_rng(0)
CARD = PolicyCard(environment={}, pool=1, hold=0.1, command=CommandLimits(), guided=True, source={})


def observations(n: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Observations of rovers that drive about."""
    env = RoverEnv(slope_deg=(0.0, 10.0))
    env.action_space.seed(1)
    rows = []
    for seed in range(n):
        env.reset(seed=seed)
        for _ in range(5):
            row = env.step(env.action_space.sample())[0]
        rows.append(row)
    return np.stack(rows)


def test_without_sideways_motion_the_wheels_stand_as_the_baselines() -> None:
    controller, baseline = CommandController(ROVER, guided=False), PDPolicy(ROVER)
    seen = observations(1)
    for entry in (-1.0, -0.3, 0.0, 0.6, 1.0):
        action = controller.act(seen, np.array([[0.5, entry, 0.0]]))[0]
        angles = baseline.steering_angles(entry * controller.limits.curvature)
        np.testing.assert_allclose(action[6:] * ROVER.max_steering, angles, atol=1e-6)


def test_sideways_alone_turns_all_wheels_alike() -> None:
    controller = CommandController(ROVER, guided=False)
    action = controller.act(observations(1), np.array([[0.5, 0.0, -0.4]]))[0]
    np.testing.assert_allclose(action[6:] * ROVER.max_steering, -0.4 * math.radians(35.0), atol=1e-6)


def test_torques_follow_the_regulator() -> None:
    # At rest on the flat with wheels that stand right: tau = R (m / 6) (v_wanted - 0) / response.
    env = RoverEnv()
    env.reset(seed=0)
    seen = env.step(np.zeros(12, np.float32))[0][None]
    limits = CommandLimits(speed=1.0, response=2.0)
    action = CommandController(env, limits, guided=False).act(seen, np.array([[0.3, 0.0, 0.0]]))[0]
    torque = env.model.wheel_radii * env.model.mass / 6.0 * 0.3 / 2.0
    np.testing.assert_allclose(action[:6], torque / env.model.wheel_torque_limits, rtol=1e-5)


def test_actions_are_in_the_action_space_and_batches_equal_single_ones() -> None:
    controller, seen = CommandController(ROVER), observations(6)
    commands = RNG.uniform(-1.0, 1.0, (6, 3))
    actions = controller.act(seen, commands)
    for i in range(6):
        assert actions[i] in ROVER.action_space
        np.testing.assert_array_equal(controller.act(seen[i : i + 1], commands[i : i + 1])[0], actions[i])


def test_the_guide_follows_the_circle_through_the_goal() -> None:
    env = RoverEnv()
    controller = CommandController(env)
    # Goal 4 m ahead and 2 m to the left (towards -z): kappa = 2 y / (x^2 + y^2) = 0.2 per metre.
    seen = env.reset(seed=0, options={"position": (0.0, 0.0), "heading_deg": 0.0, "goal": (4.0, -2.0)})[0][None]
    (command,) = controller.guide(seen.astype(np.float64))
    np.testing.assert_allclose(command, (1.0, 0.2 / controller.limits.curvature, 0.0), atol=1e-6)


def test_features_know_neither_place_nor_heading() -> None:
    env = RoverEnv(terrain="plane", height_scan=(6, 4, 0.2))
    features = Features(env, pool=2)
    rows = []
    for place, heading in (((0.0, 0.0), 0.0), ((30.0, -7.0), 120.0)):
        direction = math.radians(heading)
        goal = (place[0] + 5.0 * math.cos(direction), place[1] - 5.0 * math.sin(direction))
        seen, _ = env.reset(seed=0, options={"position": place, "heading_deg": heading, "goal": goal})
        rows.append(features(seen[None])[0])
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-4)
    assert rows[0].shape == (features.size,)


def test_a_slope_shows_no_rocks_and_a_rock_shows_its_height() -> None:
    slope = math.radians(8.0)
    ground = Plane((-math.sin(slope), math.cos(slope), 0.0))
    centre = (1.25, 1.25 * math.tan(slope), 0.05)
    for radius, rocks in ((0.1, ()), (0.1, (centre,))):
        field = SphereField(np.array(rocks).reshape(-1, 3), np.full(len(rocks), radius), ground=ground)
        env = RoverEnv(terrain=field, height_scan=(32, 16, 0.1), heading_deg=0.0)
        seen, _ = env.reset(seed=0)
        cells = Features(env, pool=2)(seen[None])[0][-13 * 8 :] / 10.0
        if rocks:
            # The nearest point of the scan is within 0.05 m in x and z of the top.
            assert math.sqrt(0.1**2 - 2 * 0.05**2) - 0.01 < cells.max() < 0.1 / math.cos(slope) + 1e-3
            assert np.count_nonzero(cells > 0.02) <= 4
        else:
            np.testing.assert_allclose(cells, 0.0, atol=1e-4)


def test_pool_must_divide_the_scan() -> None:
    with refused(OptionError, "pool"):
        Features(RoverEnv(height_scan=(5, 4, 0.2)), pool=2)


def test_a_policy_is_saved_and_read_back(tmp_path: Path) -> None:
    size = Features(ROVER).size
    network = Network(
        mean=RNG.normal(size=size).astype(np.float32),
        deviation=np.ones(size, np.float32),
        weights=tuple(RNG.normal(size=shape).astype(np.float32) for shape in ((8, size), (3, 8))),
        biases=(np.zeros(8, np.float32), np.zeros(3, np.float32)),
    )
    network.save(tmp_path / "policy.npz")
    CARD.save(tmp_path / "policy.json")
    seen = observations(4)
    actions, state = TrainedPolicy.load(ROVER, tmp_path).predict(seen)
    np.testing.assert_array_equal(state[1], 1)
    np.testing.assert_array_equal(actions, TrainedPolicy(ROVER, network, CARD).predict(seen)[0])
    np.testing.assert_allclose(TrainedPolicy.load(ROVER, tmp_path).predict(seen[0])[0], actions[0], atol=1e-4)


def test_the_guide_alone_drives_on_the_plane() -> None:
    env: Any = gym.make("Rover-v0", max_episode_steps=600)
    policy = TrainedPolicy.untrained(env, CARD)
    observation, _ = env.reset(seed=3, options={"goal": (5.0, 1.0), "heading_deg": 0.0})
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(policy.predict(observation)[0])
        ended = terminated or truncated
    assert info["is_success"]


def test_a_command_holds_as_long_as_it_says() -> None:
    size = Features(ROVER).size
    weights = (RNG.normal(size=(3, size)).astype(np.float32),)
    policy = TrainedPolicy(ROVER, Network(np.zeros(size), np.ones(size), weights, (np.zeros(3, np.float32),)), CARD)
    rows, state, held = observations(4), None, []
    # 0.1 s are two control periods; the second rover's episode begins anew at the second step.
    for row in range(3):
        _, state = policy.predict(rows[[row, row]], state, np.array([row == 0, row <= 1]))
        held.append(state[0])
    np.testing.assert_array_equal(held[1][0], held[0][0])
    assert not np.array_equal(held[2][0], held[0][0])
    assert not np.array_equal(held[1][1], held[0][1])
    np.testing.assert_array_equal(held[2][1], held[1][1])


@pytest.mark.parametrize("bad", [np.zeros(3, np.float32), np.full(91, np.nan, np.float32)])
def test_a_policy_refuses_what_is_no_observation(bad: np.ndarray[Any, Any]) -> None:
    with refused(StateError, "observation"):
        TrainedPolicy.untrained(ROVER, CARD).predict(bad)


def test_a_policy_refuses_an_environment_that_it_was_not_made_for() -> None:
    policy = TrainedPolicy.untrained(ROVER, CARD)
    with refused(OptionError, "policy"):
        TrainedPolicy(RoverEnv(height_scan=True), policy._network, CARD)


def test_the_wrapper_sums_the_rewards_of_the_steps_it_holds() -> None:
    wrapped = DriveByCommand(gym.make("Rover-v0"), repeat=3, guided=True)
    plain: Any = gym.make("Rover-v0")
    features, _ = wrapped.reset(seed=5)
    seen, _ = plain.reset(seed=5)
    assert features in wrapped.observation_space
    controller = CommandController(plain.unwrapped)
    command = np.array([0.2, -0.1, 0.1], np.float32)
    _, total, *_ = wrapped.step(command)
    expected = 0.0
    for _ in range(3):
        seen, reward, *_ = plain.step(controller.act(seen[None], command[None])[0])
        expected += reward
    assert total == pytest.approx(expected, rel=1e-12)


SCANNED: dict[str, Any] = {"terrain": "rocks", "height_scan": (6, 4, 0.3), "difficulty": 1.0}


@pytest.mark.parametrize("limit", [9, 10])
def test_a_scan_once_a_command_is_the_scan_where_it_counts(limit: int) -> None:
    # The limit of 10 steps cuts the fourth command short: its features, too, have the heights of their place.
    wrapped = DriveByCommand(gym.wrappers.TimeLimit(RoverEnv(**SCANNED), limit), repeat=3)
    plain = RoverEnv(**SCANNED)
    features, controller = Features(plain), CommandController(plain, guided=False)
    command = np.array([1.0, 0.2, 0.0], np.float32)
    wrapped.reset(seed=5)
    seen, _ = plain.reset(seed=5)
    for step in range(limit):
        if step % 3 == 0:
            ours, *_, truncated, _ = wrapped.step(command)
        seen, *_ = plain.step(controller.act(seen[None], command[None])[0])
        if step % 3 == 2 or step == limit - 1:
            assert ours.tobytes() == features(seen[None])[0].tobytes()
    assert truncated


def test_a_vector_of_commanded_rovers_refuses_what_it_cannot_do() -> None:
    for env, field in (
        (gym.make_vec("Rover-v0", 2, "sync"), "env"),
        (gym.make_vec("Rover-v0", 2, autoreset_mode="Disabled"), "env.autoreset_mode"),
    ):
        made: Any = env
        with refused(OptionError, field):
            CommandVectorEnv(made)
    envs = CommandVectorEnv(gym.make_vec("Rover-v0", 2))
    envs.reset(seed=0)
    before = envs.step(np.zeros((2, 3)))[0]
    for commands in (np.zeros((2, 12)), np.full((2, 3), np.nan), "forward"):
        with pytest.raises(CommandError):
            envs.step(commands)
    np.testing.assert_array_equal(envs.reset(options={"reset_mask": np.zeros(2, bool)})[0], before)
