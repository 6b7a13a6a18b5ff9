"""`RoverSand-v0`: soils, ground and rover of the episodes, what is observed, and what the baseline does."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import RoverEnv, RoverGymError, RoverModel
from rover_gym.drive import PDPolicy, SandPolicy, drive_all
from rover_gym.envs.sand_ground import DRAWN_SOILS
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.ground.sand import Soil, named_soil
from rover_gym.ground.terrain_parts import plane_of, spheres_of, surfaces_of


def test_soils_are_drawn_and_the_ground_follows_the_difficulty() -> None:
    env = gym.make("RoverSand-v0", difficulty=0.6)
    rover: Any = env.unwrapped
    soils, slopes = set(), []
    for seed in range(12):
        observation, _ = env.reset(seed=seed)
        values = rover.observation_layout.split(observation)
        assert -1e-6 < values["wheel_gap"].min() < 1e-3
        soils.add(rover.soil.name)
        slopes.append(np.degrees(rover.start.slope))
        (surface,) = surfaces_of(rover.simulation.terrain)
        assert abs(surface.heights([rover.start.goal])[0]) < 3.0
        assert len(spheres_of(rover.simulation.terrain)[0]) > 0
        (rocky,) = (part for part in rover.simulation.terrain.parts if len(spheres_of(part)[0]))
        assert plane_of(rocky) is None
    assert len(soils) >= 3
    assert soils <= set(DRAWN_SOILS)
    assert 0.0 < max(slopes) <= 6.0
    # Without difficulty the sand is level.
    env.reset(seed=1, options={"difficulty": 0.0})
    assert plane_of(rover.simulation.terrain) is not None
    assert not surfaces_of(rover.simulation.terrain)


def test_equal_seeds_of_the_field_give_equal_ripples() -> None:
    env = RoverEnv(terrain="sand", difficulty=0.5, soil="grc-1", slope_deg=0.0)
    grids = []
    for field_seed in (5, 5, 6):
        env.reset(seed=1, options={"field_seed": field_seed, "goal": (4.0, 1.0)})
        (surface,) = surfaces_of(env.simulation.terrain)
        grids.append(np.array(surface.grid))
        assert 0.5 * 0.01 < np.abs(grids[-1]).max() <= 0.5 * 0.03
        assert env.soil == named_soil("grc-1")
    np.testing.assert_array_equal(grids[0], grids[1])
    assert np.abs(grids[0] - grids[2]).max() > 1e-3


def test_a_wheel_in_sand_is_observed_as_a_contact() -> None:
    env = RoverEnv(terrain="sand", difficulty=0.0, soil="cmu-sand", height_scan=(3, 3, 0.2))
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape, np.float32)
    action[: len(env.model.wheel_names)] = 0.3
    for _ in range(20):
        observation, _, _, _, info = env.step(action)
    values = env.observation_layout.split(observation)
    sand = env.simulation.sand()
    assert (sand["sinkage"] > 1e-3).all()
    np.testing.assert_allclose(values["wheel_gap"], -sand["sinkage"], atol=2e-3)
    assert (values["wheel_contact"] == 1.0).all()
    weight = env.model.mass * 9.81
    assert values["normal_force"].sum() == pytest.approx(weight, rel=0.1)
    assert sand["force"][:, 1].sum() == pytest.approx(weight, rel=0.1)
    assert info["slip_ratio"] == pytest.approx(sand["slip"].mean(), abs=1e-12)
    assert 0.0 < info["slip_ratio"] < 1.0
    assert len(sand["ruts"]) > 0


def test_the_baseline_reaches_most_goals_straight_ahead_on_gentle_sand() -> None:
    """Not all: a wheel that its regulator brakes digs itself in."""
    n = 8
    arguments: dict[str, Any] = {"terrain": "sand", "goal_distance": 2.0, "goal_bearing_deg": (-15.0, 15.0)}
    envs = RoverVectorEnv(n, difficulty=0.1, threads=2, **arguments)
    observation, _ = envs.reset(seed=1)
    policy, reached, ended = PDPolicy(envs), np.zeros(n, bool), np.zeros(n, bool)
    for _ in range(200):
        observation, _, terminated, _, info = envs.step(policy.predict(observation)[0])
        reached |= terminated & info.get("success", np.zeros(n, bool)) & ~ended
        ended |= terminated
    assert reached.sum() >= 5


def climbs(policy: Any, slope: float, seeds: int, seconds: float, soil: str | Soil = "cmu-sand") -> int:
    """How many of some seeds reach a goal 2 m uphill, up to 30 degrees aside."""
    arguments: dict[str, Any] = {
        "terrain": "sand",
        "difficulty": 0.0,
        "soil": soil,
        "slope_deg": slope,
        "uphill_deg": (-30.0, 30.0),
        "heading_deg": 0.0,
        "goal_distance": 2.0,
        "goal_bearing_deg": (-30.0, 30.0),
    }
    drives = drive_all(policy, range(seeds), arguments=arguments, threads=2, max_episode_steps=round(20.0 * seconds))
    return sum(drive.end == "goal" for drive in drives)


def test_the_crawler_climbs_ten_degrees_of_dry_sand() -> None:
    """The baseline reached none of these goals in 30 s."""
    assert climbs(SandPolicy, 10.0, seeds=4, seconds=20.0) == 4


@pytest.mark.nightly("tests/envs/test_sand.py::test_the_crawler_climbs_ten_degrees_of_dry_sand")
def test_the_crawler_climbs_twenty_degrees_of_dry_sand_in_zigzags() -> None:
    """Straight uphill a wheel of this rover climbs 16 degrees at a slip of 0.8."""
    assert climbs(SandPolicy, 20.0, seeds=8, seconds=120.0) >= 6


@pytest.mark.nightly("tests/envs/test_sand.py::test_the_crawler_climbs_ten_degrees_of_dry_sand")
def test_the_crawler_takes_flatter_ways_up_loose_sand() -> None:
    """On ways of 14 degrees, which dense sand bears, none of eight rovers reached its goal."""
    loose = named_soil("cmu-sand").having(density=1200.0, internal_friction=0.5)
    assert climbs(SandPolicy, 20.0, seeds=4, seconds=200.0, soil=loose) >= 3


def test_the_memory_of_one_rover_is_not_anothers() -> None:
    env = RoverEnv(terrain="sand", difficulty=0.0, soil="cmu-sand", slope_deg=18.0)
    policy = SandPolicy(env)
    first, _ = env.reset(seed=1)
    second, _ = env.reset(seed=2)
    state = alone = None
    for _ in range(200):  # at rest, both are stuck sooner or later
        together, state = policy.predict(np.stack([first, second]), state)
        single, alone = policy.predict(second, alone)
        np.testing.assert_array_equal(single, together[1])
    assert (state[0][:, 1] > 0.0).all(), "a rover that does not move is stuck"
    _, state = policy.predict(np.stack([first, second]), state, np.array([True, False]))
    assert state[0][0, 1] == 0.0 < state[0][1, 1]
    with pytest.raises(RoverGymError, match="gains"):
        SandPolicy(env, gains=3.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"soil": "cmu-sand"}, "soil"),
        ({"terrain": "sand", "soil": "quicksand"}, "soil"),
        ({"terrain": "sand", "soil": []}, "soil"),
        ({"terrain": "sand", "soil": [3.0]}, "soil"),
        ({"terrain": "sand", "model": RoverModel()}, "width"),
    ],
)
def test_what_sand_cannot_be_is_refused_by_name(arguments: dict[str, Any], field: str) -> None:
    with pytest.raises(RoverGymError, match=field):
        RoverEnv(**arguments)


def test_a_soil_of_ones_own_and_a_list_are_taken() -> None:
    own = Soil("mine", "resistive", {**named_soil("cmu-sand").numbers, "density": 1500.0})
    env = RoverEnv(terrain="sand", soil=[own, "grc-1"])
    names = set()
    for seed in range(8):
        env.reset(seed=seed)
        names.add(env.soil.name)
    assert names == {"mine", "grc-1"}
