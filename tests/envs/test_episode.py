"""Episodes: starts, commands, rewards, ends."""

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import last_step, spinning
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from rover_gym import RoverEnv, RoverModel

TORQUES, STEERING = slice(0, 6), slice(6, 12)


def action_of(torque: float = 0.0, steering: Any = 0.0) -> np.ndarray[Any, Any]:
    action = np.zeros(12, np.float32)
    action[TORQUES], action[STEERING] = torque, steering
    return action


# Commands


@pytest.mark.parametrize("heading", [0.0, 90.0, -135.0])
@pytest.mark.parametrize("torque", [0.2, -0.2])
def test_positive_torque_drives_forward(env: RoverEnv, heading: float, torque: float) -> None:
    env.reset(seed=0, options={"heading_deg": heading})
    for _ in range(20):
        env.step(action_of(torque))
    x, _, z = env.simulation.q[:3]
    h = math.radians(heading)
    ahead = x * math.cos(h) - z * math.sin(h)
    assert ahead * torque > 0.1
    assert abs(x * math.sin(h) + z * math.cos(h)) < 0.01 * abs(ahead)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_positive_front_steering_turns_left(env: RoverEnv, side: float) -> None:
    env.reset(seed=0, options={"heading_deg": 0.0})
    front = side * np.array([0.5, 0.5, 0, 0, 0, 0])
    for _ in range(20):
        env.step(action_of(0.2, front))
    q = env.simulation.q
    assert side * q[4] > 0.05, "heading grows to the left"
    assert side * q[2] < 0.0, "left is -z"


def test_full_steering_action_is_the_limit() -> None:
    env = RoverEnv(max_steering_deg=20.0)
    env.reset(seed=0)
    for _ in range(20):
        env.step(action_of(0.0, 1.0))
    steering = env.simulation.q[env.model.steering_joint_indices]
    np.testing.assert_allclose(steering, math.radians(20.0), atol=math.radians(0.5))


def test_full_torque_action_is_the_limit(env: RoverEnv) -> None:
    env.step(action_of(1.0))
    np.testing.assert_array_equal(env.simulation.wheel_torques, env.model.wheel_torque_limits)


@pytest.mark.parametrize(
    ("frequency", "time_step", "dt"), [(20.0, 0.005, 0.05), (10.0, 0.01, 0.1), (200.0, 0.005, 0.005)]
)
def test_control_period(frequency: float, time_step: float, dt: float) -> None:
    env = RoverEnv(control_frequency=frequency, time_step=time_step)
    env.reset(seed=0)
    for _ in range(3):
        info = env.step(action_of())[4]
    assert env.dt == pytest.approx(dt, rel=1e-12)
    assert info["time"] == pytest.approx(3 * dt, rel=1e-9)


# Starts


@pytest.mark.parametrize("uphill", [0.0, 70.0, -160.0])
def test_start_rests_on_the_slope(env: RoverEnv, uphill: float) -> None:
    options = {"slope_deg": 10.0, "uphill_deg": uphill, "heading_deg": 30.0, "position": (1.0, -2.0)}
    env.reset(seed=0, options=options)
    simulation = env.simulation
    np.testing.assert_allclose(simulation.wheel_gaps, 0.0, atol=1e-12)
    np.testing.assert_allclose(simulation.rotation[:, 1], simulation.terrain.normal, atol=1e-12)
    assert simulation.q[[0, 2]] == pytest.approx([1.0, -2.0])
    assert simulation.q[4] == pytest.approx(math.radians(30.0))
    np.testing.assert_array_equal(simulation.v, 0.0)
    psi = math.radians(uphill)
    plane = simulation.terrain
    rise = plane.height(math.cos(psi), -math.sin(psi)) - plane.height(0.0, 0.0)
    assert rise == pytest.approx(math.tan(math.radians(10.0)))


def test_starts_are_drawn_from_the_ranges() -> None:
    env = RoverEnv(
        slope_deg=(2.0, 4.0), heading_deg=(10.0, 20.0), goal_distance=(3.0, 4.0), goal_bearing_deg=(-5.0, 5.0)
    )
    slopes = []
    for seed in range(50):
        _, info = env.reset(seed=seed)
        start = env.start
        slopes.append(math.degrees(start.slope))
        assert 10.0 <= math.degrees(start.heading) <= 20.0
        assert 3.0 <= info["distance_to_goal"] <= 4.0 + 1e-12
        direction = math.degrees(math.atan2(-start.goal[1], start.goal[0]) - start.heading)
        assert -5.0 - 1e-9 <= direction <= 5.0 + 1e-9
    assert 2.0 <= min(slopes) < 2.5
    assert 3.5 < max(slopes) <= 4.0


def test_an_option_does_not_shift_the_other_draws(env: RoverEnv) -> None:
    env.reset(seed=5)
    free = env.start
    env.reset(seed=5, options={"slope_deg": 3.0})
    assert env.start.slope == math.radians(3.0)
    assert (env.start.heading, env.start.goal) == (free.heading, free.goal)


def test_goal_and_state_options(env: RoverEnv) -> None:
    q = env.simulation.q
    q[:3] = 0.5, 2.0, -0.5
    v = np.zeros(21)
    v[0] = 1.5
    _, info = env.reset(seed=0, options={"goal": (3.5, -4.5), "q": q, "v": v})
    np.testing.assert_allclose(env.simulation.q, q, atol=1e-12)
    np.testing.assert_allclose(env.simulation.v, v, atol=1e-12)
    assert env.goal == (3.5, -4.5)
    assert info["distance_to_goal"] == pytest.approx(5.0)


def test_another_model_and_gravity() -> None:
    env = RoverEnv(model=RoverModel().replace(wheel_radius=0.2), gravity=(0.0, -3.72, 0.0))
    env.reset(seed=0)
    for _ in range(20):
        observation, *_ = env.step(action_of(0.05))
    forces = env.observation_layout.split(observation)["normal_force"]
    assert forces.sum() == pytest.approx(960.0 * 3.72, rel=0.05)


# Rewards


def test_energy_of_the_motors_is_the_kinetic_energy_on_flat_ground(env: RoverEnv) -> None:
    # Wheels that roll without slip lose nothing, so the motors' work is all in the motion.
    env.reset(seed=0, options={"slope_deg": 0.0})
    for _ in range(40):
        info = env.step(action_of(0.2))[4]
    assert info["energy"] == info["energy_positive"]
    assert env.simulation.energy().kinetic == pytest.approx(info["energy"], rel=0.02)
    driven = info["energy_positive"]
    info = env.step(action_of(-0.2))[4]
    assert info["energy_positive"] == driven, "braking is not driving"
    assert info["energy"] > driven


def test_spinning_wheels_slip() -> None:
    env = RoverEnv(friction=0.1)
    env.reset(seed=0)
    for _ in range(20):
        info = env.step(action_of(1.0))[4]
    assert 0.5 < info["slip_ratio"] <= 2.0
    assert info["reward_terms"]["slip"] == -0.1 * info["slip_ratio"] * env.dt


def test_rolling_wheels_do_not_slip(env: RoverEnv) -> None:
    for _ in range(20):
        info = env.step(action_of(0.2))[4]
    assert info["slip_ratio"] < 0.02


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(arrays(np.float32, (3, 12), elements=st.floats(-1.0, 1.0, width=32)), st.integers(0, 2**32 - 1))
def test_any_action_gives_a_sound_step(env: RoverEnv, actions: Any, seed: int) -> None:
    observation, _ = env.reset(seed=seed)
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        assert observation in env.observation_space
        assert np.isfinite(observation).all()
        assert math.isfinite(reward)
        assert reward == sum(info["reward_terms"].values())
        assert (terminated, truncated) == (False, False)
        assert info["solver"]["status"] != "failed"


# Ends


def test_goal_terminates(env: RoverEnv) -> None:
    start = {"heading_deg": 0.0, "goal": (1.0, 0.0)}
    *_, terminated, truncated, info = last_step(env, lambda _: action_of(0.2), 100, seed=0, options=start)
    assert (terminated, truncated) == (True, False)
    assert info["termination"] == "goal"
    assert info["success"] is True
    assert info["is_success"] is True
    assert info["distance_to_goal"] <= env.goal_tolerance
    assert info["reward_terms"]["success"] == 10.0
    assert info["reward_terms"]["failure"] == 0.0


@pytest.mark.parametrize(("index", "angle"), [(3, 1.5), (3, math.pi), (5, 1.2), (5, -1.2)])
def test_roll_over_terminates(env: RoverEnv, index: int, angle: float) -> None:
    env.reset(seed=0, options={"q": 1.5 * np.eye(21)[1] + angle * np.eye(21)[index]})
    _, _, terminated, truncated, info = env.step(action_of())
    assert (terminated, truncated) == (True, False)
    assert info["termination"] == "roll_over"
    assert info["tilt"] > math.radians(60.0)
    assert info["success"] is False
    assert info["reward_terms"]["failure"] == -10.0


def test_high_centring_terminates() -> None:
    # On its back the trunk carries the whole weight and no wheel helps.
    env = RoverEnv(max_tilt_deg=180.0, stuck_time=1.0)
    env.reset(seed=0, options={"q": 0.6 * np.eye(21)[1] + math.pi * np.eye(21)[3]})
    seen = []
    for _ in range(200):
        observation, _, terminated, _, info = env.step(action_of(0.5))
        seen.append(float(observation[env.observation_layout["stuck"]][0]))
        if terminated:
            break
    assert terminated
    assert info["termination"] == "high_centred"
    assert info["reward_terms"]["failure"] == -10.0
    assert seen[-1] == 1.0
    assert max(np.diff(seen)) == pytest.approx(env.dt / 1.0, rel=1e-5), "the observation shows the clock"


def test_time_truncates() -> None:
    assert gym.make("Rover-v0").spec.max_episode_steps == 1200  # type: ignore[union-attr]
    env = gym.make("Rover-v0", max_episode_steps=3)
    env.reset(seed=0)
    ends = [env.step(action_of())[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_failed_step_terminates_openly(env: RoverEnv) -> None:
    # The trunk turns at 1e30 rad/s: no step can be taken.
    last, _ = env.reset(seed=0, options=spinning())
    observation, reward, terminated, truncated, info = env.step(action_of(0.1))
    assert (terminated, truncated) == (True, False)
    assert info["termination"] == "step_failed"
    solver = info["solver"]
    assert (solver["status"], solver["iterations"], solver["n_contacts"]) == ("failed", 0, 0)
    assert math.isinf(solver["residual"])
    assert "not finite" in solver["message"]
    assert info["reward_terms"]["failure"] == reward == -10.0
    assert reward == sum(info["reward_terms"].values())
    np.testing.assert_array_equal(observation, last)
