"""The planner by hand: what it sees of rover and ground, its paths, its memory, and goals that the baseline misses."""

import inspect
import math
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused
from rovers import with_fields

from rover_gym import OptionError, PDPolicy, Plane, RoverEnv, RoverModel, SphereField, StateError
from rover_gym.drive import FORECAST_FILE, ForesightCosts, Network, PathCosts, PolicyError, ScanGains, ScanPolicy
from rover_gym.drive.evaluation import drive_all
from rover_gym.drive.forecast.arc_forecast import OUTPUTS, ArcFeatures, ArcForecast, Outcomes, with_speed
from rover_gym.drive.named_policy import named_policy
from rover_gym.drive.scan.scan_policy import TRAPS, ScanMemory
from rover_gym.drive.search.arc_search import Arcs, RoverOutline
from rover_gym.models import open_model

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
        with refused(OptionError, "height_scan"):
            ScanPolicy(RoverEnv(**arguments))
    with refused(OptionError, "env"):
        ScanPolicy(gym.make("CartPole-v1"))


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
    with refused(OptionError, field):
        make(rocks)


def test_bad_observations_and_states_are_refused(rocks: RoverEnv, policy: ScanPolicy) -> None:
    observation, _ = rocks.reset(seed=0)
    _, state = policy.predict(observation)
    for bad in (observation[:-1], np.full_like(observation, np.nan)):
        with refused(StateError, "observation"):
            policy.predict(bad)
    for other in (state[:-1], tuple(np.concatenate((values, values)) for values in state)):
        with refused(StateError, "state"):
            policy.predict(observation, other)


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
    model = with_fields(RoverModel(), {name: {"collides": False} for name in RoverModel().solid_names})
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
    """Rocks on three sides: a policy that only drives ahead stays inside."""
    wall = [(2.6, 0.0, 0.45 * k) for k in range(-3, 4)]
    wall += [(2.6 - 0.45 * k, 0.0, side * 1.35) for k in range(3) for side in (-1, 1)]
    ends = []
    for x in (0.96, 0.98, 1.0):
        env = RoverEnv(terrain=SphereField(wall, [0.3] * len(wall), Plane()), heading_deg=0.0, **ARGUMENTS)
        end, state = drive(env, ScanPolicy(env), 0, steps=1200, position=(x, 0.0), goal=(6.0, 0.0))
        ends.append(end)
        assert ScanMemory(*state).n_traps[0] >= 1
    assert ends.count("goal") >= 2, ends  # the way out leads along the rocks


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


def constant(size: int, outputs: Any) -> Network:
    """A network whose prediction does not depend on its input."""
    zero, weights = np.zeros(size, np.float32), np.zeros((len(outputs), size), np.float32)
    return Network(zero, zero + 1.0, (weights,), (np.asarray(outputs, dtype=np.float32),))


def foretelling(env: RoverEnv, outputs: list[float], folder: Path, by_speed: float = 0.0) -> Path:
    """The folder of a forecast that is the same for all, but for the first output by the speed."""
    network = constant(ArcFeatures(env, ScanPolicy(env)).size + 1, outputs)
    network.weights[0][0, -1] = by_speed
    network.save(folder / FORECAST_FILE)
    return folder


def in_front_of_a_rock(radius: float) -> tuple[RoverEnv, np.ndarray]:
    """A rover with a rock between its wheels and a metre ahead, and what it observes."""
    rock = SphereField([[1.2, 0.0, 0.0]], [radius], Plane())
    env = RoverEnv(terrain=rock, heading_deg=0.0, **ARGUMENTS)
    observation, _ = env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (6.0, 0.0)})
    return env, observation.astype(np.float64)


def test_the_features_see_the_rock_on_the_arcs_that_lead_over_it() -> None:
    env, row = in_front_of_a_rock(0.25)
    policy = ScanPolicy(env)
    features = ArcFeatures(env, policy)
    seen = features(row, *policy.ground(row))
    assert seen.shape == (len(policy.arcs), features.size)
    n = 6 + 3
    gap = seen[:, : 8 * n].reshape(-1, 8, n)[:, :, 6].min(axis=1)
    ahead = int(np.argmin(np.abs(policy.commands - [1.0, 0.0, 0.0]).sum(axis=1)))
    back = int(np.argmin(np.abs(policy.commands - [-1.0, 0.0, 0.0]).sum(axis=1)))
    assert gap[ahead] < 0.1 < 0.5 < gap[back]


def foreseen_by(policy: ScanPolicy, row: Any) -> Outcomes:
    return policy.forecast(row, *policy.ground(row))


def test_the_shipped_forecast_knows_what_holds_the_trunk() -> None:
    """Only over a rock higher than the clearance does it predict less progress and a high-centred rover."""
    foreseen = []
    for radius in (0.1, 0.26):
        env, row = in_front_of_a_rock(radius)
        policy = ScanPolicy(env, forecast=True)
        outcomes = foreseen_by(policy, row)
        ahead = int(np.argmin(np.abs(policy.commands - [1.0, 0.0, 0.0]).sum(axis=1)))
        foreseen.append((outcomes.way[0, ahead], outcomes.stuck[0, ahead]))
    assert foreseen[0][0] > foreseen[1][0] + 0.2
    assert foreseen[1][1] > foreseen[0][1] + 0.02


@pytest.mark.nightly("tests/envs/test_scan_policy.py::test_one_forecast_serves_every_rover")
def test_the_forecast_helps_the_small_rover() -> None:
    """Of difficulty 2, where `ScanPolicy` reaches six goals of ten in the same time, it reaches nearly all."""
    model = open_model("open-rover")
    arguments = {"terrain": "rocks", "difficulty": 2.0, "model": model, **ScanPolicy.arguments(model)}
    drives = drive_all(partial(ScanPolicy, forecast=True), range(1_000_000, 1_000_008), arguments=arguments, num_envs=8)
    assert sum(drive.success for drive in drives) >= 6


@pytest.mark.parametrize("name", RoverModel.names())
def test_one_forecast_serves_every_rover(name: str) -> None:
    """The inputs have the same entries for all, and what gets on with one rover gets on with another."""
    model = open_model(name)
    env = RoverEnv(terrain="plane", model=model, **ScanPolicy.arguments(model))
    row = env.reset(seed=2)[0].astype(np.float64)
    policy = ScanPolicy(env, forecast=True)
    features = ArcFeatures(env, policy)(row, *policy.ground(row))
    assert features.shape == (len(policy.arcs), ArcFeatures.size)
    assert np.isfinite(features).all()
    outcomes = foreseen_by(policy, row)
    assert outcomes.way.shape == (2, len(policy.arcs))
    ahead = int(np.argmin(np.abs(policy.commands - [1.0, 0.0, 0.0]).sum(axis=1)))
    assert outcomes.way[0, ahead] > 0.15
    assert outcomes.stuck[0, ahead] < 0.2


def test_what_is_foreseen_costs_in_proportion_to_the_way(tmp_path: Path) -> None:
    """Costs scale with the length of the arcs, which is shorter for a slower rover."""
    for model in (RoverModel(), open_model("open-rover")):
        env = RoverEnv(terrain="plane", model=model, **ScanPolicy.arguments(model))
        row = env.reset(seed=1)[0].astype(np.float64)
        policy = ScanPolicy(env, forecast=foretelling(env, [0.0, 0.5, 0.0], tmp_path))
        costs, fast = policy._outlook(row, *policy.ground(row), 1.0)
        assert costs == pytest.approx(policy.cruise_speed / 1.2 * (2.0 * 0.85 * 1.2 + 10.0 * 0.5))
        assert not fast.any()


def test_costs_of_what_is_foreseen_choose_arc_and_speed(tmp_path: Path) -> None:
    """If a forecast predicts progress only at high speed, the rover drives fast; a uniform forecast changes nothing."""
    env, row = in_front_of_a_rock(0.1)
    foretelling(env, [1.0, 0.0, 0.0], tmp_path)
    alike = ScanPolicy(env, forecast=tmp_path, foresight=ForesightCosts(caution=1.0))
    observation = row.astype(np.float32)
    np.testing.assert_array_equal(alike.predict(observation)[0], ScanPolicy(env).predict(observation)[0])
    foretelling(env, [-0.5, 0.0, 0.0], tmp_path, by_speed=1.0)
    command = ScanPolicy(env, forecast=tmp_path).predict(observation)[1][0][0]
    assert command[0] == pytest.approx(1.0)
    slow = ScanPolicy(env, forecast=tmp_path, foresight=ForesightCosts(push=100.0)).predict(observation)[1][0][0]
    assert slow[0] < 0.6


def test_the_forecast_scales_and_limits_its_outputs() -> None:
    env, row = in_front_of_a_rock(0.1)
    policy = ScanPolicy(env)
    features = ArcFeatures(env, policy)
    outcomes = ArcForecast(features, constant(features.size + 1, [0.4, -0.2, 0.7]))(row, *policy.ground(row))
    assert outcomes.way == pytest.approx(0.4 * OUTPUTS[0])
    assert (outcomes.stuck == 0.0).all()
    assert outcomes.failed == pytest.approx(0.7)
    fast = with_speed(np.zeros((2, 3), np.float32), [0.0, 1.0])
    assert fast.tolist() == [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    env, _ = in_front_of_a_rock(0.1)
    with pytest.raises(PolicyError, match="is not there"):
        ScanPolicy(env, forecast=tmp_path)
    with refused(OptionError, "foresight"):
        ScanPolicy(env, foresight=1.0)  # type: ignore[arg-type]
    with refused(OptionError, "foresight.stuck"):
        ForesightCosts(stuck=-1.0)
    constant(5, [0.0, 0.0, 0.0]).save(tmp_path / FORECAST_FILE)
    with pytest.raises(PolicyError, match="must have 139 inputs, got 5"):
        ScanPolicy(env, forecast=tmp_path)
    with pytest.raises(PolicyError, match="3 outputs"):
        ScanPolicy(env, forecast=foretelling(env, [0.0, 0.0], tmp_path))


def test_a_name_and_a_folder_lead_to_it(tmp_path: Path) -> None:
    env, _ = in_front_of_a_rock(0.1)
    named = named_policy("foresight")
    assert getattr(named.make(env), "forecast", None) is not None
    own = named_policy(str(foretelling(env, [0.0, 0.0, 0.0], tmp_path)))
    assert own.arguments == ARGUMENTS
    assert getattr(own.make(env), "forecast", None) is not None
