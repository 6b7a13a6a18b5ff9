"""The map that a rover remembers from its height scans, and the way over it."""

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pytest

from rover_gym import OptionError, Plane, SphereField, StateError
from rover_gym.env.rocks import HeightScan, scan_points
from rover_gym.env.rover_env import RoverEnv
from rover_gym.policy import MapOptions, ScanPolicy
from rover_gym.policy.ground_map import GroundMap

SCAN = HeightScan(21, 17, 0.1)
GROUND = SphereField([[0.6, -0.1, 0.4], [-0.5, -0.2, -0.3]], [0.4, 0.5], Plane())


def taken(place: tuple[float, float], heading: float) -> npt.NDArray[np.float64]:
    return np.asarray(GROUND.heights(scan_points(SCAN.offsets, place, heading)))


def empty(cells: int, place: tuple[float, float]) -> tuple[GroundMap, npt.NDArray[np.float32], npt.NDArray[np.int64]]:
    ground = GroundMap(SCAN, MapOptions(cells=cells), 0.3)
    heights, corner = np.zeros((cells, cells), np.float32), np.zeros(2, np.int64)
    ground.begin(heights, corner, place)
    return ground, heights, corner


def true_heights(corner: npt.NDArray[np.int64], cells: int) -> npt.NDArray[np.float64]:
    x, z = (0.1 * (corner[k] + np.arange(cells)) for k in (0, 1))
    points = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(GROUND.heights(points)).reshape(cells, cells)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_the_map_shows_the_ground_that_was_scanned(heading: float) -> None:
    place = (0.13, -0.08)
    ground, heights, corner = empty(60, place)
    assert np.isnan(heights).all()
    ground.remember(heights, corner, taken(place, heading), place, heading)
    seen = np.isfinite(heights)
    # The scan covers 2.0 by 1.6 m, a cell 0.01 m2.
    assert seen.sum() == pytest.approx(320, abs=25)
    assert np.abs(heights - true_heights(corner, 60))[seen].max() < 0.06


def test_what_was_seen_stays_when_the_map_moves() -> None:
    ground, heights, corner = empty(40, (0.0, 0.0))
    ground.remember(heights, corner, taken((0.0, 0.0), 0.0), (0.0, 0.0), 0.0)
    before = int(np.isfinite(heights).sum())
    first = corner.copy()
    ground.remember(heights, corner, taken((0.9, 0.4), 0.3), (0.9, 0.4), 0.3)
    assert (corner - first).tolist() == [9, 4]
    seen = np.isfinite(heights)
    assert seen.sum() > before
    assert np.abs(heights - true_heights(corner, 40))[seen].max() < 0.06
    # Far away nothing of it is left, and the scan is all that is known.
    ground.remember(heights, corner, taken((50.0, 0.0), 0.0), (50.0, 0.0), 0.0)
    assert np.isfinite(heights).sum() == pytest.approx(21 * 17, abs=40)


def test_a_rover_remembers_the_ground_of_its_own_episode() -> None:
    env = gym.make("RoverRocks-v0", difficulty=1.0, **ScanPolicy.arguments())
    assert isinstance(env.unwrapped, RoverEnv)
    policy = ScanPolicy(env, map=MapOptions(cells=100))
    observation, _ = env.reset(seed=3)
    action, state = policy.predict(observation)
    assert env.action_space.contains(action)
    both = np.stack((observation, observation))
    twice = (np.concatenate((part, part)) for part in state)
    actions, state = policy.predict(both, tuple(twice), np.array([False, True]))
    assert actions.shape == (2, 12)
    cells, corner = state[-4], state[-3]
    x, z = ((corner[1, k] + np.arange(100)) * ScanPolicy.arguments()["height_scan"][2] for k in (0, 1))
    points = np.stack(np.meshgrid(x, z, indexing="ij"), axis=-1).reshape(-1, 2)
    truth = np.asarray(env.unwrapped.simulation.terrain.heights(points)).reshape(100, 100)  # type: ignore[union-attr]
    off = np.abs(cells[1] - truth)
    assert np.nanmedian(off) < 0.01
    assert 1500 < np.isfinite(off).sum() < 2300


def test_a_map_that_is_none_is_refused() -> None:
    env = gym.make("RoverRocks-v0", **ScanPolicy.arguments())
    with pytest.raises(OptionError, match="map"):
        ScanPolicy(env, map=160)  # type: ignore[arg-type]
    for name, value in (("cells", 7), ("risk", -1.0), ("unknown", np.nan), ("trap", np.inf), ("every", 0)):
        with pytest.raises(OptionError, match=f"map.{name}"):
            MapOptions(**{name: value})  # type: ignore[arg-type]
    observation, _ = env.reset(seed=1)
    _, state = ScanPolicy(env).predict(observation)
    with pytest.raises(StateError, match="state"):
        ScanPolicy(env, map=MapOptions()).predict(observation, state)


def test_a_rover_with_a_map_comes_out_of_a_deep_dead_end() -> None:
    """A bay of rocks, 5 m wide and 4 m deep, stands open to the rover; the goal lies behind it.

    Without a map the policy is still in it after a minute.
    """
    end = [[5.0, 0.0, z] for z in np.arange(-2.5, 2.6, 0.6)]
    sides = [[x, 0.0, side * 2.8] for x in np.arange(1.0, 5.1, 0.6) for side in (-1.0, 1.0)]
    centres = end + sides
    terrain = SphereField(centres, [0.5] * len(centres), Plane())
    env = gym.make("Rover-v0", terrain=terrain, heading_deg=0.0, **ScanPolicy.arguments())
    observation, _ = env.reset(seed=0, options={"position": (0.0, 0.0), "goal": (9.0, 0.0)})
    policy = ScanPolicy(env, map=MapOptions())
    state: Any = None
    over = False
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    assert info["termination"] == "goal"
