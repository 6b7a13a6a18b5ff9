"""The baseline steers about one centre, keeps its speed and reaches the goal."""

import inspect
import math
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st

from rover_gym import HeightField, PDPolicy, RoverEnv
from rover_gym.drive import CommandController, CommandLimits
from rover_gym.drive.commands.regulator import SLACK, WheelRegulator
from rover_gym.envs import wheel_centres
from rover_gym.envs.batch import RoverBatch

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


Array = npt.NDArray[np.float64]

ROVER = RoverEnv()

RADIUS, LIMIT = 0.1, 150.0

#: m / n / response and I / (r^2 dt), N s/m, with a response of 0.2 s.
ROLL, SPIN = 960.0 / 6.0 / 0.2, 0.15 / RADIUS**2 / ROVER.dt


def force(missing: float, traction: float = 0.0, load: float = 1.0) -> float:
    """Force at the rim of wheels that stand and pushed with the traction, N, under a load in units of the mean."""
    layout = ROVER.observation_layout
    seen = np.zeros((1, layout.size))
    seen[:, layout["wheel_contact"]] = float(load > 0.0)
    seen[:, layout["normal_force"]] = load
    seen[:, layout["tangential_force"]][:, ::2] = traction / (960.0 * 9.81 / 6.0)
    seen[:, layout["previous_action"]][:, :6] = traction * RADIUS / LIMIT
    entries = WheelRegulator(ROVER, 0.2).entries(seen, np.full((1, 6), missing), np.zeros((1, 1)))
    assert np.ptp(entries) < 1e-12
    return float(entries[0, 0]) * LIMIT / RADIUS


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_force_is_that_of_the_formula(sign: float) -> None:
    # Within the slack, the rover's share of mass; in the air, the wheel's own.
    assert force(sign * 0.1) == pytest.approx(sign * ROLL * 0.1)
    assert force(sign * 0.1, load=0.0) == pytest.approx(sign * SPIN * 0.1)
    assert force(sign * 1.0, load=0.5) == pytest.approx(sign * SPIN * (1.0 + 0.5 * SLACK))
    # Stopped: more than before. Beyond its speed under the same traction: not braked at once.
    assert force(sign * 1.0, sign * 800.0) == pytest.approx(sign * (800.0 + SPIN * (1.0 - SLACK)))
    assert force(-sign * 0.2, sign * 800.0) == pytest.approx(sign * (800.0 - SPIN * (0.2 + SLACK)))
    # Close to its speed after a hard push: the push fades.
    assert force(sign * 0.1, sign * 800.0) == pytest.approx(sign * 800.0 * 0.1 / SLACK)


def test_wheels_in_the_air_turn_as_commanded_after_one_period() -> None:
    env = RoverEnv()
    env.reset(seed=0)
    q = env.simulation.q
    q[1] += 5.0
    seen, _ = env.reset(seed=0, options={"q": q})
    controller = CommandController(env, CommandLimits(speed=1.0))
    scale = env.observation_layout.scale
    rates = env.observation_layout["velocity"].start + np.asarray(env.model.wheel_joint_indices)
    for _ in range(5):
        seen = env.step(controller.act(seen[None], np.array([[0.6, 0.0, 0.0]]))[0])[0]
        assert not seen[env.observation_layout["wheel_contact"]].any()
        # The joints turn about axes that point left: forward is negative.
        np.testing.assert_allclose(-RADIUS * (seen * scale)[rates], 0.6, rtol=0.05)


def regulated(policy: Any, seconds: float, **arguments: Any) -> tuple[float, float]:
    """Share of the wheels' periods whose torque flips between 75 N m and its opposite, and energy over way, J/m."""
    n = 8
    batch = RoverBatch(n, threads=1, **arguments)
    for i in range(n):
        batch.reset(i, 3_200_000 + i)
    act = policy(RoverEnv.row(batch, 0))
    active, before = np.ones(n, np.bool_), np.zeros((n, 6))
    place = batch.task.layout["q"].start
    seen = batch.observation
    flips = periods = way = 0.0
    for _ in range(round(seconds / batch.task.dt)):
        actions = act(seen)
        torques = LIMIT * actions[:, :6]
        swung = (torques * before < 0.0) & (np.minimum(abs(torques), abs(before)) > 75.0)
        flips, periods = flips + swung[active].sum(), periods + 6 * active.sum()
        before, last = torques, seen[:, [place, place + 2]]
        seen, _, ended, _, _ = batch.step(actions, active)
        way += np.linalg.norm(seen[:, [place, place + 2]] - last, axis=1).sum()
        active &= ~ended
    return flips / periods, batch.infos()["energy"].sum() / way


def commanded(env: RoverEnv) -> Any:
    controller = CommandController(env)
    return lambda seen: controller.act(seen, np.zeros((len(seen), 3)))


def baseline(env: RoverEnv) -> Any:
    policy = PDPolicy(env)
    return lambda seen: policy.predict(seen)[0]


@pytest.mark.parametrize("policy", [commanded, baseline])
@pytest.mark.parametrize("gravity", [1.0, 0.38])
def test_torques_do_not_swing_among_rocks(policy: Any, gravity: float) -> None:
    """The torques of wheels in the air alternated between the limits in half of the periods (a quarter at 0.38 g)."""
    flips, _ = regulated(policy, 8.0, terrain="rocks", difficulty=1.0, gravity_scale=gravity)
    assert flips < 0.001


@pytest.mark.parametrize("policy", [commanded, baseline])
@pytest.mark.parametrize("arguments", [{"gravity_scale": 0.38}, {"gravity": (0.0, -3.73, 0.0)}])
def test_little_gravity_costs_no_energy_on_the_flat(policy: Any, arguments: dict[str, Any]) -> None:
    """The torques of slipping wheels also alternated, which cost 830 J/m on average."""
    flips, energy = regulated(policy, 14.0, **arguments)
    assert flips == 0.0
    assert energy < 200.0


def test_the_torques_of_a_stuck_rover_flipped_at_every_period() -> None:
    """Wheels that span on a rough map got too little torque, then too much, 20 times a second for 60 s.

    The regulator took the softer gain of a rolling wheel for a wheel without grip, whose inertia is a tenth.
    """
    ground = HeightField.fractal(40.0, 0.1, 0.3, hurst=0.5, seed=2)
    env = RoverEnv(terrain=ground, model="four-steered")
    policy = PDPolicy(env)
    observation, _ = env.reset(seed=0, options={"position": (5.0, 5.0), "goal": (12.0, 12.0)})
    torques = []
    for _ in range(160):
        action, _ = policy.predict(observation)
        observation, *_, info = env.step(action)
        torques.append(action[:4])
    assert info["distance_to_goal"] > 9.0, "it is still stuck"
    steps = np.diff(torques[60:], axis=0)
    flips = (steps[1:] * steps[:-1] < 0.0) & (np.abs(steps[1:]) > 0.1) & (np.abs(steps[:-1]) > 0.1)
    assert flips.mean(axis=0).max() < 0.5  # 0.9 before; a rover that rocks flips too
