"""The planner by hand: what it sees of rover and ground, its paths, its memory, and goals that the baseline misses."""

import inspect
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import OptionError, PDPolicy, Plane, RoverEnv, RoverModel, SphereField, StateError
from rover_gym.policy import PathCosts, ScanGains, ScanPolicy
from rover_gym.policy.rover_outline import RoverOutline
from rover_gym.policy.scan_memory import TRAPS, ScanMemory
from rover_gym.policy.sweeps import Arcs

ARGUMENTS = ScanPolicy.arguments()


@pytest.fixture(scope="module")
def rocks() -> RoverEnv:
    """A rover among rocks of difficulty 1, with the scan that the policy asks for."""
    return RoverEnv(terrain="rocks", difficulty=1.0, **ARGUMENTS)


@pytest.fixture(scope="module")
def policy(rocks: RoverEnv) -> ScanPolicy:
    return ScanPolicy(rocks)


def drive(env: RoverEnv, policy: Any, seed: int, steps: int = 900, **options: Any) -> tuple[str, Any]:
    """How an episode ends, "" at the limit, and the policy's last state."""
    observation, _ = env.reset(seed=seed, options=options or None)
    state: Any = None
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, terminated, _, info = env.step(action)
        if terminated:
            return str(info["termination"]), state
    return "", state


def test_an_environment_without_a_scan_is_refused() -> None:
    for arguments in ({}, {"height_scan": (20, 1, 0.1)}, {"height_scan": (1, 20, 0.1)}):
        with pytest.raises(OptionError) as caught:
            ScanPolicy(RoverEnv(**arguments))
        assert caught.value.field == "height_scan"
    with pytest.raises(OptionError) as caught:
        ScanPolicy(gym.make("CartPole-v1"))
    assert caught.value.field == "env"


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda env: ScanPolicy(env, gains={"speed": 1.0}), "gains"),
        (lambda env: ScanPolicy(env, costs=1.0), "costs"),
        (lambda _: ScanGains(speed=0.0), "gains.speed"),
        (lambda _: ScanGains(period=math.nan), "gains.period"),
        (lambda _: PathCosts(belly=-1.0), "costs.belly"),
        (lambda _: PathCosts(depth=0), "costs.depth"),
        (lambda _: PathCosts(width=1.5), "costs.width"),  # type: ignore[arg-type]
    ],
)
def test_bad_gains_and_costs_are_refused_by_name(rocks: RoverEnv, make: Any, field: str) -> None:
    with pytest.raises(OptionError) as caught:
        make(rocks)
    assert caught.value.field == field


def test_bad_observations_and_states_are_refused(rocks: RoverEnv, policy: ScanPolicy) -> None:
    observation, _ = rocks.reset(seed=0)
    _, state = policy.predict(observation)
    for bad in (observation[:-1], np.full_like(observation, np.nan)):
        with pytest.raises(StateError) as caught:
            policy.predict(bad)
        assert caught.value.field == "observation"
    for other in (state[:-1], tuple(np.concatenate((values, values)) for values in state)):
        with pytest.raises(StateError) as caught:
            policy.predict(observation, other)
        assert caught.value.field == "state"


def test_the_signature_is_stable_baselines3s(policy: ScanPolicy) -> None:
    names = list(inspect.signature(policy.predict).parameters)
    assert names == ["observation", "state", "episode_start", "deterministic"]


def test_a_batch_drives_as_each_rover_alone(policy: ScanPolicy) -> None:
    envs = [RoverEnv(terrain="rocks", difficulty=1.0, **ARGUMENTS) for _ in range(3)]
    seen = np.stack([env.reset(seed=seed)[0] for seed, env in enumerate(envs)])
    states: list[Any] = [None] * 3
    state: Any = None
    for _ in range(30):
        actions, state = policy.predict(seen, state)
        assert actions.dtype == np.float32
        for i in range(3):
            action, states[i] = policy.predict(seen[i], states[i])
            np.testing.assert_array_equal(action, actions[i])
        seen = np.stack([env.step(action)[0] for env, action in zip(envs, actions, strict=True)])


def test_predict_leaves_the_given_state_alone_and_forgets_at_a_start(rocks: RoverEnv, policy: ScanPolicy) -> None:
    observation, _ = rocks.reset(seed=0)
    _, state = policy.predict(observation)
    before = [values.copy() for values in state]
    policy.predict(observation, state)
    for values, kept in zip(state, before, strict=True):
        np.testing.assert_array_equal(values, kept)
    used = tuple(values + 1 for values in state)
    fresh = policy.predict(observation[None], used, np.array([True]))[1]
    for values, expected in zip(fresh, policy.predict(observation[None])[1], strict=True):
        np.testing.assert_array_equal(values, expected)


def test_the_underside_is_the_models() -> None:
    built_in = RoverOutline.of(RoverModel(), 0.1)
    inside = (np.abs(built_in.underside) < 0.45).all(axis=1)
    np.testing.assert_allclose(built_in.clearance[inside], 0.15, atol=1e-9)  # the belly of the report's rover
    # The front axle, 3 cm under its pivot, reaches out before the trunk.
    front = built_in.clearance[np.isclose(built_in.underside[:, 0], 0.6) & (np.abs(built_in.underside[:, 1]) < 0.3)]
    np.testing.assert_allclose(front, 0.15, atol=1e-9)
    mars = RoverOutline.of(RoverModel.named("mars-rover"), 0.25)
    middle = np.abs(mars.underside).max(axis=1) < 0.3
    np.testing.assert_allclose(mars.clearance[middle], 0.6, atol=1e-9)
    # Its arms are turned boxes that sink to the wheels.
    assert 0.3 < mars.clearance.min() < 0.5
    assert np.abs(mars.underside[:, 1]).max() > 1.1


def test_a_model_without_colliding_shapes_has_no_underside() -> None:
    description = RoverModel().to_dict()
    for solid in description["solids"]:
        solid["collides"] = False
    model = RoverModel.from_dict(description)
    assert RoverOutline.of(model, 0.1).underside.shape == (0, 2)
    env = RoverEnv(terrain="rocks", model=model, **ARGUMENTS)
    observation, _ = env.reset(seed=0)
    action, _ = ScanPolicy(env).predict(observation)
    assert np.isfinite(action).all()


def test_poses_of_an_arc_are_the_integral_of_its_directions() -> None:
    arcs = Arcs(np.array([0.7, -0.4, 0.0]), np.array([0.3, -0.2, 0.5]), np.array([1.0, -1.0, 1.0]))
    poses, n = arcs.poses(1.3, 4), 100_000
    for kappa, beta, direction, pose in zip(arcs.curvature, arcs.sideways, arcs.direction, poses[:, -1], strict=True):
        t = direction * 1.3 * (np.arange(n) + 0.5) / n
        angle = kappa * t + beta
        ahead, left = (direction * 1.3 * np.mean(part) for part in (np.cos(angle), np.sin(angle)))
        np.testing.assert_allclose(pose, [ahead, -left, kappa * direction * 1.3], atol=1e-9)


def test_only_arcs_that_the_wheels_can_follow_are_kept() -> None:
    wheels = np.array([[0.6, -0.5], [0.6, 0.5], [-0.6, -0.5], [-0.6, 0.5]])
    arcs = Arcs.grid(np.linspace(-1.0, 1.0, 9), np.radians([-30.0, 0.0, 30.0]), 1.0)
    kept = arcs.within(math.radians(40.0), wheels)
    assert 0 < len(kept) < len(arcs)
    assert np.abs(kept.steering(wheels)).max() <= math.radians(41.0)
    assert len(arcs.within(math.radians(40.0), wheels[:0])) == len(arcs)


def test_it_turns_to_go_round_a_rock_that_it_cannot_pass() -> None:
    """A rock of 0.5 m in the way: the baseline drives at it until the time is over."""
    rock = SphereField([[3.0, 0.0, 0.0]], [0.5], Plane())
    env = RoverEnv(terrain=rock, heading_deg=0.0, **ARGUMENTS)
    place = {"position": (0.0, 0.0), "goal": (6.0, 0.0)}
    assert drive(env, PDPolicy(env), 0, steps=500, **place)[0] != "goal"
    assert drive(env, ScanPolicy(env), 0, steps=500, **place)[0] == "goal"


def test_it_backs_out_of_a_dead_end() -> None:
    """Rocks on three sides: whoever only drives ahead stays inside."""
    wall = [(2.6, 0.0, 0.45 * k) for k in range(-3, 4)]
    wall += [(2.6 - 0.45 * k, 0.0, side * 1.35) for k in range(3) for side in (-1, 1)]
    env = RoverEnv(terrain=SphereField(wall, [0.3] * len(wall), Plane()), heading_deg=0.0, **ARGUMENTS)
    end, state = drive(env, ScanPolicy(env), 0, steps=1200, position=(1.0, 0.0), goal=(6.0, 0.0))
    assert end == "goal"
    assert ScanMemory(*state).n_traps[0] >= 1


def test_it_backs_off_where_it_does_not_move(rocks: RoverEnv, policy: ScanPolicy) -> None:
    observation, _ = rocks.reset(seed=0)
    state: Any = None
    speeds = []
    for _ in range(60):
        _, state = policy.predict(observation, state)
        speeds.append(ScanMemory(*state).command[0, 0])
    assert speeds[0] > 0.0
    backward = next(i for i, speed in enumerate(speeds) if speed < 0.0)
    assert 0.9 <= backward * rocks.dt <= 1.5
    memory = ScanMemory(*state)
    assert memory.n_traps[0] >= 1
    heading = observation[rocks.observation_layout["q"]][4]
    place = observation[rocks.observation_layout["q"]][[0, 2]]
    ahead = (memory.traps[0, 0, :2] - place) @ [math.cos(heading), -math.sin(heading)]
    assert ahead > 0.1


def test_the_oldest_trap_is_forgotten() -> None:
    memory = ScanMemory.of(None, 1)
    for k in range(TRAPS + 3):
        memory.back_off((float(k), 0.0, 0.0), -1.0, 1.0, 0)
    assert sorted(memory.known_traps(0)[:, 0]) == [float(k) for k in range(3, TRAPS + 3)]


@pytest.mark.parametrize("seed", [4_000_007, 4_000_012])
def test_it_reaches_goals_that_the_baseline_does_not(rocks: RoverEnv, policy: ScanPolicy, seed: int) -> None:
    assert drive(rocks, PDPolicy(rocks), seed)[0] != "goal"
    assert drive(rocks, policy, seed)[0] == "goal"


@pytest.mark.parametrize("name", RoverModel.names())
def test_it_drives_every_rover_of_the_gallery(name: str) -> None:
    model = RoverModel.named(name)
    env = RoverEnv(terrain="rocks", difficulty=0.3, model=model, goal_distance=3.0, **ScanPolicy.arguments(model))
    assert drive(env, ScanPolicy(env), 1)[0] == "goal"


def test_a_smaller_scan_will_do() -> None:
    env = RoverEnv(terrain="rocks", difficulty=0.75, height_scan=True)
    assert drive(env, ScanPolicy(env), 2)[0] == "goal"
