"""A battery that the wheel motors draw on: charge in observation and info, and the end when it is empty."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, PDPolicy, RoverEnv
from rover_gym.drive import PlannerOptions, PlannerPolicy, drive_all, summarise

FORWARD = np.array([0.3] * 6 + [0.0] * 6, np.float32)


def test_the_charge_falls_by_the_work_of_the_motors_until_none_is_left() -> None:
    env, plain = RoverEnv(battery=400.0), RoverEnv()
    observation, info = env.reset(seed=0)
    plain.reset(seed=0)
    layout = env.observation_layout
    assert info["charge"] == 400.0
    assert layout.split(observation)["charge"][0] == 1.0
    for _ in range(100):
        observation, _, terminated, _, info = env.step(FORWARD)
        *_, other = plain.step(FORWARD)
        assert info["energy"] == other["energy"], "the battery changes nothing before it is empty"
        assert info["charge"] == max(0.0, 400.0 - info["energy"])
        assert layout.split(observation)["charge"][0] == pytest.approx(info["charge"] / 400.0)
        assert terminated == (info["energy"] >= 400.0)
        if terminated:
            break
    assert info["termination"] == "battery_empty"
    assert not info["success"]
    assert info["reward_terms"]["failure"] == -10.0
    assert info["charge"] == 0.0


def test_a_goal_reached_with_the_last_joule_counts() -> None:
    for battery, end in ((1.0, "battery_empty"), (1e6, "goal")):
        env = RoverEnv(battery=battery, goal_distance=0.55, goal_bearing_deg=0.0)
        env.reset(seed=0)
        info: dict[str, Any] = {"termination": ""}
        while not info["termination"]:
            *_, info = env.step(FORWARD)
        assert info["termination"] == end
    env = RoverEnv(battery=1.0, goal_distance=0.4, goal_bearing_deg=0.0)
    env.reset(seed=0)
    *_, info = env.step(np.array([1.0] * 6 + [0.0] * 6, np.float32))
    assert info["energy"] >= 1.0
    assert info["termination"] == "goal"


def test_without_a_battery_nothing_is_told_of_one() -> None:
    env = RoverEnv()
    assert "charge" not in env.observation_layout
    assert "charge" not in env.reset(seed=0)[1]


def test_evaluations_count_empty_batteries() -> None:
    drives = drive_all(PDPolicy, [0, 1, 2], arguments={"battery": 100.0})
    summary = summarise("pd", drives)
    assert summary.ends["battery_empty"] == 3
    assert sum(summary.ends.values()) == summary.episodes
    assert "battery_empty" not in summarise("pd", drive_all(PDPolicy, [0], arguments={})).ends


GROUNDS = [{}, {"terrain": "rocks", "difficulty": 0.3}, {"terrain": "hills", "difficulty": 0.3}]


def course(**arguments: Any) -> RoverEnv:
    return RoverEnv(**{"waypoints": 3, "goal_distance": (1.5, 2.5), **arguments})


@pytest.mark.parametrize("ground", GROUNDS, ids=["plane", "rocks", "hills"])
def test_the_baseline_reaches_one_goal_after_the_other(ground: dict[str, Any]) -> None:
    env = course(**ground)
    observation, info = env.reset(seed=2)
    goals, layout = env.start.goals, env.observation_layout
    policy = PDPolicy(env)
    assert (info["waypoints_reached"], info["waypoints_remaining"]) == (0, 3)
    legs = [math.dist(a, b) for a, b in itertools.pairwise(goals)]
    assert info["distance_remaining"] == pytest.approx(info["distance_to_goal"] + sum(legs))
    total, terminated, reached = 0.0, False, 0
    while not terminated:
        before = info["distance_to_goal"]
        observation, reward, terminated, _, info = env.step(policy.predict(observation)[0])
        x, _, z = env.simulation.q[:3]
        if info["waypoints_reached"] > reached:
            reached = info["waypoints_reached"]
            to_old = math.dist((x, z), goals[reached - 1])
            assert to_old <= env.goal_tolerance
            assert info["reward_terms"]["progress"] == pytest.approx(before - to_old)
            assert terminated == (reached == 3)
        present, following = goals[min(reached, 2)], goals[min(reached + 1, 2)]
        assert env.goal == present
        seen = layout.split(observation)
        assert info["distance_to_goal"] == pytest.approx(math.dist((x, z), present))
        assert seen["goal_distance"][0] == pytest.approx(info["distance_to_goal"], abs=1e-5)
        assert seen["waypoints_remaining"][0] == pytest.approx(info["waypoints_remaining"])
        for name, place in (("goal", present), ("next_goal", following)):
            np.testing.assert_allclose(seen[name], env.simulation.reading(place)[target(env)], atol=1e-5)
        total += float(reward)
        assert info["time"] < 60.0
    assert info["termination"] == "goal"
    assert info["success"]
    assert info["waypoints_remaining"] == 0
    assert info["reward_terms"]["success"] == 10.0


def target(env: RoverEnv) -> slice:
    """The goal ahead and to the right in a reading."""
    place = env.simulation.reading_layout()["target"]
    return slice(place.start, place.start + 2)


def test_goals_lie_as_far_apart_and_turn_as_asked() -> None:
    env = course(waypoints=6, goal_distance=(3.0, 4.0), waypoint_turn_deg=(20.0, 40.0), goal_bearing_deg=10.0)
    for seed in range(5):
        env.reset(seed=seed)
        start = env.start
        places = [start.position, *start.goals]
        directions = [math.atan2(a[1] - b[1], b[0] - a[0]) for a, b in itertools.pairwise(places)]
        assert all(3.0 <= math.dist(a, b) <= 4.0 for a, b in itertools.pairwise(places))
        turns = [math.degrees(math.remainder(b - a, math.tau)) for a, b in itertools.pairwise(directions)]
        assert all(20.0 - 1e-9 <= turn <= 40.0 + 1e-9 for turn in turns)
        assert math.degrees(math.remainder(directions[0] - start.heading, math.tau)) == pytest.approx(10.0)


def test_one_waypoint_is_the_environment_without() -> None:
    for ground in GROUNDS:
        plain, one = RoverEnv(**ground), RoverEnv(waypoints=1, waypoint_turn_deg=(10.0, 20.0), **ground)
        first, second = plain.reset(seed=4), one.reset(seed=4)
        assert first[0].tobytes() == second[0].tobytes()
        assert first[1] == second[1]


def test_rocks_leave_each_goal_clear() -> None:
    env = course(waypoints=4, goal_distance=(4.0, 5.0), terrain="rocks", difficulty=1.5, goal_tolerance=2.0)
    env.reset(seed=0)
    field: Any = env.simulation.terrain
    for goal in env.start.goals:
        gaps = np.hypot(*(field.centres[:, [0, 2]] - goal).T) - field.radii
        assert gaps.min() >= 2.0 - 1e-9
    reach = np.array([env.start.position, *env.start.goals])
    low, high = reach.min(axis=0) - 4.0, reach.max(axis=0) + 4.0
    assert (field.centres[:, [0, 2]] >= low - field.radii[:, None]).all()
    assert (field.centres[:, [0, 2]] <= high + field.radii[:, None]).all()


def test_goals_are_fixed_by_options() -> None:
    env = course()
    goals = ((2.0, 0.0), (2.0, 2.0), (4.0, 2.0))
    env.reset(seed=0, options={"goals": goals})
    assert env.start.goals == goals
    env.reset(seed=0, options={"goal": (2.0, 0.0)})
    assert env.start.goals[0] == (2.0, 0.0)
    assert env.start.goals[1:] != goals[1:]
    before = env.snapshot().simulation
    for options, field in (
        ({"goals": goals[:2]}, "options.goals"),
        ({"goals": 3.0}, "options.goals"),
        ({"goals": [(2.0, 0.0), (2.0, 2.0), (math.inf, 2.0)]}, "options.goals[2][0]"),
        ({"goals": goals, "goal": (2.0, 0.0)}, "options.goal"),
    ):
        with refused(OptionError, field):
            env.reset(options=options)
    assert env.snapshot().simulation == before


def test_goals_within_the_tolerance_are_all_reached_at_once() -> None:
    env = course(goal_tolerance=1.0)
    env.reset(seed=0, options={"heading_deg": 0.0, "goals": [(0.5, 0.0), (0.7, 0.0), (3.0, 0.0)]})
    *_, terminated, _, info = env.step(np.zeros(12, np.float32))
    assert not terminated
    assert info["waypoints_reached"] == 2
    env.reset(seed=0, options={"heading_deg": 0.0, "goals": [(0.5, 0.0), (0.7, 0.0), (0.9, 0.0)]})
    *_, terminated, _, info = env.step(np.zeros(12, np.float32))
    assert terminated
    assert info["termination"] == "goal"
    assert info["distance_remaining"] == info["distance_to_goal"]


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"waypoints": 0}, "waypoints"),
        ({"waypoints": 2.0}, "waypoints"),
        ({"waypoints": 1000}, "waypoints"),
        ({"waypoint_turn_deg": (3.0, 2.0)}, "waypoint_turn_deg"),
        ({"waypoints": 20, "goal_distance": 6.0, "terrain": "rocks"}, "waypoints"),
    ],
)
def test_bad_courses_are_refused(arguments: dict[str, Any], field: str) -> None:
    with refused(OptionError, field):
        RoverEnv(**arguments)


def test_the_planner_turns_to_the_next_goal() -> None:
    env = course(waypoints=2, goal_distance=1.2, waypoint_turn_deg=40.0)
    observation, info = env.reset(seed=1)
    policy = PlannerPolicy(env, PlannerOptions(samples=40, iterations=1))
    while not info["termination"]:
        observation, *_, info = env.step(policy.predict(observation)[0])
        assert info["time"] < 15.0
    assert info["termination"] == "goal"
