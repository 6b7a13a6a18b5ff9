"""Planning with the simulator: the field's plan, the roll-outs, and the policy that chooses among them."""

import gymnasium as gym
import numpy as np
import pytest
from episodes import last_step
from pursuit import pursuit

from rover_gym import HeightField, OptionError, Plane, RoverModel, SphereField, StateError
from rover_gym.drive import CommandController, FieldPlan, PlannerOptions, PlannerPolicy, Rollouts, ScanPolicy
from rover_gym.drive.planning.planner_policy import ScannedGround
from rover_gym.envs.rover_env import RoverEnv

ROVER = RoverModel()


def rock(x: float, z: float, radius: float) -> SphereField:
    return SphereField([[x, 0.0, z]], [radius], Plane())


def test_on_a_plane_the_cost_is_the_distance() -> None:
    plan = FieldPlan.over(Plane(), ROVER, (0.0, 0.0), (4.0, 3.0))
    assert plan.cost_to_go([[4.0, 3.0]])[0] == pytest.approx(0.0, abs=1e-9)
    # A grid's way has corners: by eight neighbours it is at most 8.2% longer (1 / cos 22.5 degrees).
    assert 5.0 <= plan.cost_to_go([[0.0, 0.0]])[0] <= 1.083 * 5.0
    assert (plan.price == 1.0).all()


def test_the_way_leads_around_what_the_rover_cannot_pass() -> None:
    plan = FieldPlan.over(rock(3.0, 0.0, 0.4), ROVER, (0.0, 0.0), (6.0, 0.0))
    way = plan.way((0.0, 0.0))
    assert way[0] == pytest.approx([0.0, 0.0], abs=plan.resolution)
    assert way[-1] == pytest.approx([6.0, 0.0], abs=plan.resolution)
    steps = np.hypot(*np.diff(way, axis=0).T)
    assert steps.max() <= 1.5 * plan.resolution
    assert np.hypot(*(way - (3.0, 0.0)).T).min() > 0.4
    assert plan.cost_to_go([[0.0, 0.0]])[0] > 6.0


def test_ground_that_is_not_known_is_not_crossed() -> None:
    heights = np.zeros((41, 81))  # along z, along x
    heights[:30, 38:42] = np.nan
    plan = FieldPlan.over(HeightField(heights, 0.2, (-4.0, -4.0)), ROVER, (0.0, 0.0), (7.0, 0.0))
    assert plan.way((0.0, 0.0))[:, 1].max() > 1.5
    heights[:, 40] = np.nan
    walled = FieldPlan.over(HeightField(heights, 0.2, (-4.0, -4.0)), ROVER, (0.0, 0.0), (7.0, 0.0))
    with pytest.raises(OptionError, match="start"):
        walled.way((0.0, 0.0))


def test_a_grid_too_fine_is_refused() -> None:
    with pytest.raises(OptionError, match="resolution"):
        FieldPlan.over(Plane(), ROVER, (0.0, 0.0), (40.0, 40.0), resolution=0.01)


def planar() -> RoverEnv:
    env = gym.make("Rover-v0", goal_distance=6.0, goal_bearing_deg=20.0)
    env.reset(seed=1)
    return env.unwrapped


def test_a_future_ends_where_the_rover_would() -> None:
    env = planar()
    controller = CommandController(env)
    commands = np.array([[[0.8, 0.5, 0.0], [0.8, -0.5, 0.3]], [[-0.5, 0.0, 0.0], [-0.5, 0.5, 0.0]]])
    hold = 10
    ends = Rollouts(env, 2, threads=1).drive(controller, commands, hold)
    before = env.snapshot()
    for one, plan in zip(ends.place, commands, strict=True):
        env.restore(before)
        seen = env.progress.observation
        for k in range(2 * hold):
            seen, *_ = env.step(controller.act(seen[None], plan[k // hold][None])[0])
        assert env.simulation.q[[0, 2]] == pytest.approx(one, abs=0.02)
    assert not ends.reached.any()
    assert not ends.failed.any()
    assert ends.time == pytest.approx(2 * hold * env.dt)
    assert (ends.energy > 0.0).all()


def test_a_future_that_reaches_the_goal_ends_there() -> None:
    env = planar()
    controller = CommandController(env)
    circle = pursuit(env, controller, env.progress.observation[None])
    ends = Rollouts(env, 1, threads=1).drive(controller, circle[None], 400)
    assert ends.reached.all()
    assert ends.time[0] < 400 * env.dt


def test_planning_leaves_the_environment_as_it_is() -> None:
    env = planar()
    policy = PlannerPolicy(env, PlannerOptions(samples=40, horizon=0.6, knot=0.3), threads=1)
    before = env.snapshot()
    action, state = policy.predict(env.progress.observation)
    after = env.snapshot()
    assert state is None
    assert env.action_space.contains(action)
    assert after.simulation == before.simulation
    assert after.random_state == before.random_state


def test_an_observation_that_is_none_is_refused_before_planning() -> None:
    env = planar()
    policy = PlannerPolicy(env, PlannerOptions(samples=40), threads=1)
    seen = env.progress.observation
    for bad in (seen[:-1], np.stack((seen, seen)), np.where(np.arange(len(seen)) == 3, np.nan, seen)):
        with pytest.raises(StateError, match="observation"):
            policy.predict(bad)


@pytest.mark.nightly("tests/envs/test_planner.py::test_raw_actions_drive_to_the_goal")
def test_the_planner_backs_out_of_a_dead_end() -> None:
    """Three rocks stand around the rover's front; the goal lies behind them."""
    centres = [[1.35, 0.0, -0.9], [1.6, 0.0, 0.0], [1.35, 0.0, 0.9]]
    env = gym.make("Rover-v0", terrain=SphereField(centres, [0.5, 0.5, 0.5], Plane()), heading_deg=0.0)
    env.reset(seed=0)
    policy = PlannerPolicy(env, PlannerOptions(samples=48), threads=1)
    start = {"position": (0.0, 0.0), "goal": (4.0, 0.0)}
    *_, info = last_step(env, lambda seen: policy.predict(seen)[0], 600, seed=0, options=start)
    assert info["termination"] == "goal"


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"samples": 1}, "samples"),
        ({"horizon": 0.0}, "horizon"),
        ({"period": float("nan")}, "period"),
        ({"energy_price": -1.0}, "energy_price"),
        ({"spread": (0.4, 0.5)}, "spread"),
        ({"actions": "torques"}, "actions"),
        ({"raw_spread": (0.1, -0.1)}, "raw_spread"),
    ],
)
def test_bad_options_are_refused_by_name(options: dict[str, object], field: str) -> None:
    with pytest.raises(OptionError, match=field):
        PlannerOptions(**options)  # type: ignore[arg-type]


def test_raw_actions_drive_to_the_goal() -> None:
    env = planar()
    policy = PlannerPolicy(env, PlannerOptions(samples=40, actions="raw", horizon=1.2), threads=1)
    seen = env.progress.observation
    for _ in range(20):
        action, _ = policy.predict(seen)
        assert env.action_space.contains(action)
        seen, _, over, _, info = env.step(action)
        assert not over
    # One second from rest, of 6 m.
    assert info["distance_to_goal"] < 5.9


def scanning(terrain: SphereField) -> RoverEnv:
    return gym.make("Rover-v0", terrain=terrain, heading_deg=0.0, **ScanPolicy.arguments()).unwrapped


def test_a_planner_that_sees_by_scan_knows_what_was_scanned() -> None:
    field = SphereField([[1.5, 0.0, 0.3], [30.0, 0.0, 0.0]], [0.3, 2.0], Plane())
    env = scanning(field)
    seen, _ = env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (5.0, 0.0)})
    ground = ScannedGround(env)
    ground.see(seen)
    points = np.stack(np.meshgrid(np.linspace(-2.0, 2.0, 21), np.linspace(-2.0, 2.0, 21)), axis=-1).reshape(-1, 2)
    off = np.abs(np.asarray(ground.terrain.heights(points)) - np.asarray(field.heights(points)))
    assert np.median(off) < 1e-3
    # A cell of the scan is wider than a rock's edge is steep.
    assert np.quantile(off, 0.95) < 0.05
    # The rock beyond the scan is not known, and the ground there is as high as what was seen.
    assert abs(float(ground.terrain.heights([[5.0, 0.0]])[0])) < 0.02


def test_a_planner_that_sees_by_scan_leaves_the_environment_as_it_is() -> None:
    env = scanning(SphereField([[1.5, 0.0, 0.3]], [0.3], Plane()))
    env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (5.0, 0.0)})
    policy = PlannerPolicy(env, PlannerOptions(samples=40, horizon=0.6, knot=0.3), threads=1, sees="scan")
    before = env.snapshot()
    action, _ = policy.predict(env.progress.observation)
    assert env.action_space.contains(action)
    assert env.snapshot().simulation == before.simulation


def test_what_a_planner_cannot_see_by_is_refused() -> None:
    with pytest.raises(OptionError, match="height_scan"):
        PlannerPolicy(planar(), sees="scan")
    with pytest.raises(OptionError, match="sees"):
        PlannerPolicy(planar(), sees="stars")  # type: ignore[arg-type]
    with pytest.raises(OptionError, match="terrain"):
        PlannerPolicy(scanning(rock(3.0, 0.0, 0.4)), sees="scan", terrain=Plane())
