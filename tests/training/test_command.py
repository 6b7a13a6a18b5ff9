"""Commands and features."""

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import CommandError, OptionError, PDPolicy, Plane, RoverEnv, SphereField
from rover_gym.drive import CommandController, CommandLimits, Features
from rover_gym.envs.tasks import CommandVectorEnv, DriveByCommand

ROVER = RoverEnv()
RNG = np.random.default_rng(0)


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
    controller, baseline = CommandController(ROVER), PDPolicy(ROVER)
    seen = observations(1)
    for entry in (-1.0, -0.3, 0.0, 0.6, 1.0):
        action = controller.act(seen, np.array([[0.5, entry, 0.0]]))[0]
        angles = baseline.steering_angles(entry * controller.limits.curvature)
        np.testing.assert_allclose(action[6:] * ROVER.max_steering, angles, atol=1e-6)


def test_sideways_alone_turns_all_wheels_alike() -> None:
    controller = CommandController(ROVER)
    action = controller.act(observations(1), np.array([[0.5, 0.0, -0.4]]))[0]
    np.testing.assert_allclose(action[6:] * ROVER.max_steering, -0.4 * math.radians(35.0), atol=1e-6)


def test_torques_follow_the_regulator() -> None:
    # At rest on the flat with wheels that stand right: tau = R (m / 6) (v_wanted - 0) / response.
    env = RoverEnv()
    env.reset(seed=0)
    seen = env.step(np.zeros(12, np.float32))[0][None]
    limits = CommandLimits(speed=1.0, response=2.0)
    action = CommandController(env, limits).act(seen, np.array([[0.3, 0.0, 0.0]]))[0]
    torque = env.model.wheel_radii * env.model.mass / 6.0 * 0.3 / 2.0
    np.testing.assert_allclose(action[:6], torque / env.model.wheel_torque_limits, rtol=1e-2)


def test_actions_are_in_the_action_space_and_batches_equal_single_ones() -> None:
    controller, seen = CommandController(ROVER), observations(6)
    commands = RNG.uniform(-1.0, 1.0, (6, 3))
    actions = controller.act(seen, commands)
    for i in range(6):
        assert actions[i] in ROVER.action_space
        np.testing.assert_array_equal(controller.act(seen[i : i + 1], commands[i : i + 1])[0], actions[i])


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


def test_the_wrapper_sums_the_rewards_of_the_steps_it_holds() -> None:
    wrapped = DriveByCommand(gym.make("Rover-v0"), repeat=3)
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
    features, controller = Features(plain), CommandController(plain)
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
