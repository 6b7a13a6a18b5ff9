"""`RoverArcs-v0`: arcs as actions, single and as a vector, its expert, and the network that drives by it."""

import time
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from episodes import last_step
from refusals import refused

from rover_gym import CommandError, OptionError, RoverEnv, RoverModel
from rover_gym.drive import (
    ArcNetwork,
    ArcNetworkPolicy,
    PlannerOptions,
    PlannerPolicy,
    PolicyError,
    ScanPolicy,
    named_policy,
)
from rover_gym.drive.arcs.arc_driver import ARCS, N_ARCS, arc_of
from rover_gym.drive.arcs.arc_network import shapes
from rover_gym.drive.evaluation import drive_all
from rover_gym.drive.forecast.network_files import FOLDER
from rover_gym.drive.scan.scan_policy import ScanMemory
from rover_gym.envs.tasks import RoverArcsEnv

SHIPPED = FOLDER / "anywhere"


def random_network(seed: int = 0) -> ArcNetwork:
    rng = np.random.default_rng(seed)
    return ArcNetwork({name: 0.05 * rng.normal(size=shape).astype(np.float32) for name, shape in shapes().items()})


@pytest.mark.parametrize("name", RoverModel.names())
def test_the_table_has_the_planners_arcs_of_every_rover(name: str) -> None:
    model = RoverModel.named(name)
    planner = ScanPolicy(RoverEnv(model=model, **ScanPolicy.arguments(model)))
    table = {tuple(arc) for arc in ARCS.round(9).tolist()}
    arcs = [tuple(arc) for arc in planner.commands.round(9).tolist()]
    if name == "rover":
        np.testing.assert_allclose(planner.commands, ARCS, atol=1e-12)
    steered = [arc for arc in arcs if arc[2] == 0.0]
    assert set(steered) <= table
    assert len(ARCS) == 32
    for arc in steered:
        assert ARCS[arc_of(arc, pushes=False)].round(9).tolist() == list(arc)
        assert arc_of(arc, pushes=True) == 32 + arc_of(arc, pushes=False)


def test_readings_of_sensors_stand_beside_the_entries_of_the_observation() -> None:
    plain = gym.make("RoverArcs-v0")
    env = gym.make("RoverArcs-v0", sensors=[{"LaserScanner": {"name": "laser", "rays": 5}}])
    seen, own = env.reset(seed=2)[0], plain.reset(seed=2)[0]
    for arc in (12, 44, None):
        assert seen.keys() == own.keys() | {"laser"}
        assert env.observation_space.contains(seen)
        for key, part in own.items():
            np.testing.assert_array_equal(seen[key], part)
        if arc is not None:
            assert env.get_wrapper_attr("expert_action")() == plain.get_wrapper_attr("expert_action")()
            seen, own = env.step(arc)[0], plain.step(arc)[0]


def test_the_expert_drives_to_the_goal_as_the_planner_does() -> None:
    env = RoverArcsEnv(terrain="rocks", difficulty=1.0)
    seen, _ = env.reset(seed=4)
    assert env.observation_space.contains(seen)
    planner = ScanPolicy(env.unwrapped)
    foresight = ScanPolicy(env.unwrapped, forecast=True)
    assert 0 <= env.expert_action(foresight) < N_ARCS
    *_, info = last_step(env, lambda _: env.expert_action(planner), 300, seed=4)
    assert info["termination"] == "goal"
    alone = RoverEnv(terrain="rocks", difficulty=1.0, **ScanPolicy.arguments())
    observation, _ = alone.reset(seed=4)
    state, told = None, {}
    for _ in range(1200):
        action, state = planner.predict(observation, state)
        observation, _, terminated, _, told = alone.step(action)
        if terminated:
            break
    assert told["time"] == pytest.approx(info["time"])


def test_a_planner_that_knows_the_field_is_a_teacher_too() -> None:
    env = RoverArcsEnv(terrain="rocks", difficulty=0.5, goal_bearing_deg=0.0)
    env.reset(seed=1)
    teacher = PlannerPolicy(env.unwrapped, PlannerOptions(samples=40, iterations=1, horizon=1.2), threads=1)
    arc = env.expert_action(teacher)
    assert ARCS[arc % 32][0] == 1.0  # the goal lies ahead


def test_bad_arcs_change_nothing() -> None:
    env = RoverArcsEnv()
    env.reset(seed=1)
    before = env.unwrapped.simulation.q
    for action in (-1, 64, 0.5, np.nan):
        with pytest.raises(CommandError):
            env.step(action)  # type: ignore[arg-type]
    np.testing.assert_array_equal(env.unwrapped.simulation.q, before)
    with refused(OptionError, "height_scan"):
        RoverArcsEnv(height_scan=True)


def test_a_rover_that_leaves_the_field_ends_its_episode() -> None:
    env = RoverEnv(terrain="rocks", difficulty=0.0, heading_deg=0.0, slope_deg=0.0)
    options = {"position": (0.0, 0.0), "goal": (6.0, 0.0), "heading_deg": 180.0}
    forward = np.array([0.3] * 6 + [0.0] * 6, np.float32)
    _, reward, *_, info = last_step(env, lambda _: forward, 400, seed=0, options=options)
    assert info["termination"] == "left_field"
    assert -4.2 < env.simulation.q[0] < -4.0
    assert reward < 0.0
    margins = {terrain: RoverEnv(terrain=terrain).task.field_margin for terrain in ("plane", "rocks", "hills", "sand")}
    assert margins == {"plane": None, "rocks": 4.0, "hills": 25.0, "sand": None}


def test_the_planner_sees_a_fence_at_the_edge() -> None:
    env = RoverArcsEnv(terrain="rocks", difficulty=0.0, slope_deg=0.0)
    seen, _ = env.reset(seed=0, options={"goal": (6.0, 0.0), "heading_deg": 90.0})
    assert seen["scan"].max() < 1.0  # 4 m to the edge, and the scan reaches 2.4 m
    rows, layout = env.unwrapped.progress.observation[None].astype(np.float64), env.unwrapped.observation_layout
    rows[:, layout["q"].start + 2] = -3.0  # as if it had driven 3 m ahead, to the left of the way to the goal
    rows[:, layout["goal"].start] -= 3.0 / layout.scale[layout["goal"].start]
    beyond = env.driver.planner.beyond_field(rows, np.zeros((1, 2)))
    grid = beyond.reshape(48, 40)
    assert grid[0].all()  # ahead, beyond z = -4
    assert not grid[24:].any()


def test_arcs_through_the_fence_cost_more_than_any_detour() -> None:
    env = RoverArcsEnv(terrain="rocks", difficulty=0.0, slope_deg=0.0)
    env.reset(seed=0, options={"goal": (6.0, 0.0), "heading_deg": 90.0})
    row, layout = env.unwrapped.progress.observation.astype(np.float64), env.unwrapped.observation_layout
    planner, start = env.driver.planner, np.zeros(2)
    assert planner._through_fence(row, start) is None
    row[layout["q"].start + 2] = -3.6  # 0.4 m before the edge, which lies ahead
    row[layout["goal"].start] -= 3.6 / layout.scale[layout["goal"].start]
    costs = planner._through_fence(row, start)
    ahead = planner.arcs.poses(0.9 * planner.reach, 1)[:, 0, 0]
    np.testing.assert_array_equal(costs > 0.0, ahead > 0.4)
    assert costs.max() > 40.0
    # Backing off stops at the fence, here at a rover's nose.
    row[layout["q"].start + 2] = -3.99
    row[layout["goal"].start] -= 0.39 / layout.scale[layout["goal"].start]
    memory = ScanMemory.of(None, 1)
    memory.retreat[0], memory.away[0] = 1.0, 1.0
    arc, _ = planner.choose(row, [0.0, 0.0], memory, 0)
    assert planner.arcs.direction[arc] == -1.0
    row[layout["q"].start + 2] = 0.0
    row[layout["goal"].start] += 3.99 / layout.scale[layout["goal"].start]
    arc, _ = planner.choose(row, [0.0, 0.0], memory, 0)
    assert planner.arcs.direction[arc] == 1.0


def test_the_shipped_network_loads_and_decides_in_time() -> None:
    assert (SHIPPED / "arcs.npz").stat().st_size < 1_000_000
    named = named_policy("anywhere")
    env = RoverEnv(terrain="rocks", difficulty=1.0, **named.arguments)
    policy = named.make(env)
    observation, _ = env.reset(seed=3)
    times = []
    for _ in range(30):
        clock = time.process_time()
        policy.predict(observation)
        times.append(time.process_time() - clock)
    assert np.median(times) < 0.01  # 2 ms on a quiet machine


@pytest.mark.parametrize(("model", "least"), [(None, 6), ("open-rover", 5), ("skid-steered", 3)])
def test_the_shipped_network_reaches_goals(model: str | None, least: int) -> None:
    rover = None if model is None else RoverModel.named(model)
    named = named_policy("anywhere", rover)
    arguments = {"terrain": "rocks", "difficulty": 0.5, "model": rover, **named.arguments}
    drives = drive_all(named.make, range(1_000_000, 1_000_006), arguments=arguments)
    assert sum(drive.success for drive in drives) >= least


def test_a_batch_decides_as_single_rovers_do() -> None:
    env = RoverEnv(terrain="rocks", difficulty=1.5, **ScanPolicy.arguments())
    seen = np.stack([env.reset(seed=k)[0] for k in range(4)])
    policy = ArcNetworkPolicy(env, random_network())
    together, state = policy.predict(seen)
    for k in range(4):
        action, _ = policy.predict(seen[k])
        np.testing.assert_allclose(action, together[k], atol=1e-5)
    again, _ = policy.predict(seen, state)  # holds its arcs
    np.testing.assert_allclose(again, together, atol=1e-5)
    drawn = {policy.predict(seen[0], deterministic=False)[0].tobytes() for _ in range(40)}
    assert len(drawn) > 3


def test_damaged_networks_are_refused(tmp_path: Path) -> None:
    network = random_network()
    network.save(tmp_path / "arcs.npz")
    read = ArcNetwork.read(tmp_path / "arcs.npz")
    for name, values in network.arrays.items():
        np.testing.assert_allclose(read.arrays[name], values, rtol=1e-3, atol=1e-6)
    for change in ({"dense_0": np.zeros((2, 2), np.float16)}, {"dense_bias_0": np.full(256, np.inf, np.float16)}):
        arrays = {name: values.astype(np.float16) for name, values in network.arrays.items()} | change
        np.savez(tmp_path / "arcs.npz", **arrays)
        with pytest.raises(PolicyError):
            ArcNetwork.read(tmp_path / "arcs.npz")
    (tmp_path / "arcs.npz").write_bytes(b"PK nothing")
    with pytest.raises(PolicyError):
        ArcNetwork.read(tmp_path / "arcs.npz")
    with pytest.raises(PolicyError):
        ArcNetworkPolicy.load(RoverEnv(**ScanPolicy.arguments()), tmp_path / "none")
