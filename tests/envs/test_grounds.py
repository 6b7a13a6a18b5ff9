"""Grounds of the environment: hills, maps, meshes and unions; where start and goal lie, and what is observed."""

import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from rover_gym import (
    HeightField,
    OptionError,
    PDPolicy,
    Plane,
    RoverEnv,
    SphereField,
    TerrainError,
    TriangleMesh,
    Union,
)
from rover_gym.ground import plane_of, surfaces_of
from rover_gym.vector import RoverVectorEnv

SPACING = 0.5


def bowl(n: int = 161, depth: float = 4e-3) -> HeightField:
    """A paraboloid about the origin, 80 m wide."""
    places = SPACING * (np.arange(n) - (n - 1) / 2)
    x, z = np.meshgrid(places, places)
    return HeightField(depth * (x * x + z * z), SPACING)


def wall() -> HeightField:
    """Level ground with a wall of 3 m across, from x = 3 m to 4 m."""
    n = 161
    places = SPACING * (np.arange(n) - (n - 1) / 2)
    return HeightField(np.where((places >= 3.0) & (places <= 4.0), 3.0, 0.0) * np.ones((n, 1)), SPACING)


@pytest.mark.parametrize("difficulty", [0.6, 2.0])
def test_hills_are_an_environment_of_their_own(difficulty: float) -> None:
    env = gym.make("RoverHills-v0", difficulty=difficulty)
    rover: Any = env.unwrapped
    for seed in range(5):
        observation, info = env.reset(seed=seed)
        values = rover.observation_layout.split(observation)
        # No wheel is in the ground, and the lowest touches.
        assert -1e-6 < values["wheel_gap"].min() < 1e-3
        assert np.linalg.norm(values["ground_normal"]) == pytest.approx(1.0, abs=1e-6)
        assert info["difficulty"] == difficulty
        (surface,) = surfaces_of(rover.simulation.terrain)
        assert abs(surface.heights([rover.start.position])[0]) < 1e-6
        assert np.isfinite(surface.heights([rover.start.goal])[0])
    assert plane_of(rover.simulation.terrain) is None


def test_the_slope_of_hills_follows_the_difficulty_or_the_argument() -> None:
    def slopes(**arguments: Any) -> float:
        env = RoverEnv(terrain="hills", rock_abundance=0.0, **arguments)
        squares = []
        for seed in range(6):
            env.reset(seed=seed)
            (surface,) = surfaces_of(env.simulation.terrain)
            grid, spacing = surface.grid.astype(float), surface.spacing[0]
            rise = np.stack((np.diff(grid, axis=1)[:-1], np.diff(grid, axis=0)[:, :-1])) / spacing
            squares.append((rise**2).sum(axis=0).mean())
        return float(np.sqrt(np.mean(squares)))

    assert slopes(difficulty=0.5) == pytest.approx(0.1, rel=0.2)
    assert slopes(difficulty=1.0) == pytest.approx(2.0 * slopes(difficulty=0.5), rel=1e-3)
    assert slopes(difficulty=2.0) == pytest.approx(4.0 * slopes(difficulty=0.5), rel=1e-3)
    assert slopes(hill_slope_deg=5.0) == pytest.approx(np.tan(np.radians(5.0)), rel=0.2)


def test_the_baseline_crosses_gentle_hills() -> None:
    n = 8
    envs = RoverVectorEnv(n, terrain="hills", difficulty=0.2, threads=2)
    observation, _ = envs.reset(seed=1)
    policy, reached = PDPolicy(envs), np.zeros(n, bool)
    for _ in range(500):
        observation, _, terminated, _, info = envs.step(policy.predict(observation)[0])
        reached |= terminated & info.get("success", np.zeros(n, bool))
        if reached.all():
            break
    assert reached.all()


def test_a_map_stays_from_episode_to_episode_and_the_start_stands_on_it() -> None:
    field = bowl()
    env = RoverEnv(terrain=field, goal_distance=8.0)
    for seed, place in ((0, (0.0, 0.0)), (1, (10.0, -6.0))):
        env.reset(seed=seed, options={"position": place})
        surface = env.simulation.terrain
        assert isinstance(surface, HeightField)
        np.testing.assert_array_equal(surface.grid, field.grid)
        gaps = env.simulation.wheel_gaps
        assert -1e-6 < min(gaps) < 1e-3
        assert max(gaps) < 0.02
        observation = env.step(np.zeros(12, np.float32))[0]
        normal = env.observation_layout.split(observation)["ground_normal"]
        assert normal[1] == pytest.approx(1.0, abs=0.02)


def test_a_flat_map_gives_what_the_plane_gives() -> None:
    options = {"heading_deg": 30.0, "goal": (6.0, -3.0)}
    plane, field = RoverEnv(), RoverEnv(terrain=HeightField(np.zeros((161, 161)), 0.5))
    for env in (plane, field):
        env.reset(seed=0, options=options)
    policy = PDPolicy(plane)
    for _ in range(60):
        action = policy.predict(plane.step(np.zeros(12, np.float32))[0])[0]
        field.step(np.zeros(12, np.float32))
        one, other = plane.step(action)[0], field.step(action)[0]
        np.testing.assert_allclose(one, other, atol=2e-5)


def test_goals_that_no_way_leads_to_are_refused() -> None:
    env = RoverEnv(terrain=wall())
    with pytest.raises(TerrainError, match="no way leads") as caught:
        env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (8.0, 0.0)})
    assert caught.value.field == "goal"
    env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (-8.0, 0.0)})
    # Where goals are drawn, those beyond the wall are drawn again.
    for seed in range(5):
        env.reset(seed=seed, options={"heading_deg": 0.0})
        assert env.start.goal[0] < 3.0


def test_starts_and_goals_off_the_map_are_refused() -> None:
    env = RoverEnv(terrain=bowl())
    for options, field in (({"position": (100.0, 0.0)}, "position"), ({"goal": (0.0, 41.0)}, "goal")):
        with pytest.raises(TerrainError) as caught:
            env.reset(seed=0, options=options)
        assert caught.value.field == field
    holes = bowl().grid.copy()
    holes[80, 80] = np.nan
    with pytest.raises(TerrainError) as caught:
        RoverEnv(terrain=HeightField(holes, SPACING)).reset(seed=0)
    assert caught.value.field == "position"


def test_a_rover_that_drives_off_the_map_ends_its_episode() -> None:
    n = 41
    env = RoverEnv(terrain=HeightField(np.zeros((n, n)), 0.25), goal_distance=1.0, goal_tolerance=0.05)
    env.reset(seed=0, options={"heading_deg": 0.0, "goal": (4.0, 3.0)})
    action = np.concatenate((np.full(6, 0.4), np.zeros(6))).astype(np.float32)
    for _ in range(200):
        _, _, terminated, _, info = env.step(action)
        if terminated:
            break
    assert info["termination"] == "step_failed"
    assert "map" in info["solver"]["message"] or "ground" in info["solver"]["message"]


def test_parts_are_combined() -> None:
    field = bowl()
    rocks = SphereField.rocks(0.02, (-10.0, -10.0, 10.0, 10.0), seed=3, ground=field)
    mesh = TriangleMesh(
        [[5.0, -1.0, -1.0], [7.0, -1.0, -1.0], [6.0, -1.0, 1.0], [6.0, 1.5, 0.0]],
        [[0, 2, 3], [2, 1, 3], [1, 0, 3], [0, 1, 2]],
    )
    env = RoverEnv(terrain=[field, rocks, mesh], height_scan=True)
    env.reset(seed=1, options={"position": (-8.0, -8.0), "goal": (-3.0, -8.0)})
    assert isinstance(env.simulation.terrain, Union)
    assert len(env.simulation.terrain.parts) == 3
    other = RoverEnv(terrain=Union([field, rocks, mesh]), height_scan=True)
    other.restore(pickle.loads(pickle.dumps(env.snapshot())))  # noqa: S301 - our own
    action = np.full(12, 0.1, np.float32)
    np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])


def test_files_are_opened(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.zeros((50, 50)))
    with pytest.raises(TerrainError, match="spacing"):
        RoverEnv(terrain=str(tmp_path / "map.npy"))
    with pytest.raises(FileNotFoundError):
        RoverEnv(terrain=tmp_path / "none.tif")


def test_what_does_not_fit_is_refused() -> None:
    for arguments, field in (
        ({"terrain": "hills", "slope_deg": 3.0}, "slope_deg"),
        ({"terrain": bowl(), "slope_deg": 3.0}, "slope_deg"),
        ({"terrain": bowl(), "difficulty": 0.5}, "difficulty"),
        ({"hill_slope_deg": 3.0}, "hill_slope_deg"),
        ({"terrain": "hills", "hill_slope_deg": 31.0}, "hill_slope_deg"),
    ):
        with pytest.raises(OptionError) as caught:
            RoverEnv(**arguments)
        assert caught.value.field == field
    for terrain in ("moon", 3, np.zeros((3, 3)), [Plane(), Plane()], []):
        with pytest.raises(TerrainError):
            RoverEnv(terrain=terrain)
