"""The baseline steers about one centre, keeps its speed and reaches the goal."""

import inspect
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_gym import PDPolicy, RoverEnv
from rover_gym.env import wheel_centres

POLICY = PDPolicy(RoverEnv())
CENTRES = wheel_centres(RoverEnv().model)


def drive(env: gym.Env[Any, Any], seed: int, **options: Any) -> dict[str, Any]:
    """One episode; returns the last info."""
    policy = PDPolicy(env)
    observation, _ = env.reset(seed=seed, options=options)
    while True:
        action, _ = policy.predict(observation)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return info


def test_wheel_centres_are_the_rovers() -> None:
    expected = [(0.62, -0.53), (0.62, 0.53), (-0.10, -0.53), (-0.70, -0.53), (-0.10, 0.53), (-0.70, 0.53)]
    np.testing.assert_allclose(CENTRES, expected, atol=1e-12)


@given(st.floats(-1.0, 1.0))
def test_axles_meet_in_one_turning_centre(fraction: float) -> None:
    curvature = fraction * POLICY.max_curvature
    angles = POLICY.steering_angles(curvature)
    assert max(map(abs, angles)) <= POLICY._max_steering * (1.0 + 1e-12)
    for (x, z), angle in zip(CENTRES, angles, strict=True):
        # The centre, (x_c, -1 / curvature), lies on the axle: no part along the rolling direction.
        along = (POLICY._turning.x_c - x) * curvature * math.cos(angle) - (-1.0 - z * curvature) * math.sin(angle)
        assert abs(along) < 1e-12
        assert math.cos(angle) > 0.0


def test_tightest_turn_uses_the_whole_steering() -> None:
    angles = POLICY.steering_angles(POLICY.max_curvature)
    assert max(map(abs, angles)) == pytest.approx(POLICY._max_steering, rel=1e-12)


def test_signature_is_stable_baselines3s() -> None:
    names = list(inspect.signature(POLICY.predict).parameters)
    assert names == ["observation", "state", "episode_start", "deterministic"]
    base = pytest.importorskip("stable_baselines3.common.base_class")
    assert names == list(inspect.signature(base.BaseAlgorithm.predict).parameters)[1:]


def test_batch_equals_single_ones(env: RoverEnv) -> None:
    policy = PDPolicy(env)
    env.action_space.seed(0)
    observations = np.stack([env.step(env.action_space.sample())[0] for _ in range(5)])
    actions, state = policy.predict(observations, state=None, episode_start=np.ones(5, bool), deterministic=True)
    assert state is None
    assert actions.shape == (5, 12)
    assert actions.dtype == np.float32
    for observation, action in zip(observations, actions, strict=True):
        np.testing.assert_array_equal(policy.predict(observation)[0], action)
        assert action in env.action_space


def test_policy_reads_vector_environments() -> None:
    vector = gym.make_vec("Rover-v0", num_envs=2, vectorization_mode="sync")
    observations, _ = vector.reset(seed=0)
    actions, _ = PDPolicy(vector).predict(observations)
    assert actions in vector.action_space
    vector.close()


def test_policy_keeps_its_speed_on_a_slope() -> None:
    env = RoverEnv(slope_deg=10.0, uphill_deg=0.0, heading_deg=0.0)
    policy = PDPolicy(env)
    observation, _ = env.reset(seed=0, options={"goal": (30.0, 0.0)})
    for _ in range(160):
        observation = env.step(policy.predict(observation)[0])[0]
    speed = env.observation_layout.split(observation)["velocity"][0]
    assert speed == pytest.approx(policy.gains.speed, rel=0.03)


@pytest.mark.parametrize("bearing", [0, 45, 90, 135, 180, -90])
@pytest.mark.parametrize("distance", [0.6, 1.0, 1.5, 3.0])
def test_goal_anywhere_around_the_rover_is_reached(env: RoverEnv, bearing: float, distance: float) -> None:
    angle = math.radians(bearing)
    goal = (distance * math.cos(angle), -distance * math.sin(angle))
    assert drive(env, 0, heading_deg=0.0, goal=goal)["success"]


@pytest.mark.parametrize("first_seed", range(0, 100, 10))
def test_goal_is_reached(first_seed: int) -> None:
    # 98 of 100 are asked for; each ten is held to ten of ten, which is what was measured, here and with 100 episodes
    # each on flat ground and on 10 degrees.
    env = gym.make("Rover-v0", slope_deg=(0.0, 10.0), goal_bearing_deg=(-180.0, 180.0))
    lost = [seed for seed in range(first_seed, first_seed + 10) if not drive(env, seed)["success"]]
    assert not lost


@pytest.mark.parametrize("slope", [0.0, 10.0])
def test_goal_is_reached_from_the_default_start(slope: float) -> None:
    assert drive(gym.make("Rover-v0", slope_deg=slope), 0)["success"]
