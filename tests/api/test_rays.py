"""Rays against every ground and the rover itself, as arrays; bad rays are refused by name."""

import math
from typing import Any

import numpy as np
import pytest
from refusals import refused
from rovers import placed

from rover_gym.core import (
    HeightField,
    OptionError,
    Plane,
    Simulation,
    SphereField,
    TriangleMesh,
    Union,
)

DOWN = np.array([0.0, -1.0, 0.0])

HILLS = HeightField.fractal(16.0, 0.2, 0.1, seed=4, craters=0.01)
ROCKS = SphereField([[1.0, 0.0, 2.0], [-2.0, 0.1, 0.0]], [0.5, 0.3], Plane.tilted(0.1, 0.3))
PYRAMID = TriangleMesh(
    [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1, 0]], [[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]]
)

GROUNDS = {"map": HILLS, "rocks": ROCKS, "mesh": PYRAMID, "union": Union([ROCKS, PYRAMID])}


@pytest.mark.parametrize("ground", GROUNDS.values(), ids=GROUNDS)
def test_straight_down_a_ray_measures_the_height(ground: Any) -> None:
    places = np.random.default_rng(0).uniform(-3.0, 3.0, (500, 2))
    origins = np.column_stack([places[:, 0], np.full(500, 9.0), places[:, 1]])
    distances, normals = ground.cast_rays(origins, DOWN)
    expected = 9.0 - ground.heights(places)
    np.testing.assert_allclose(distances, np.where(np.isnan(expected), np.inf, expected), rtol=1e-9)
    met = np.isfinite(distances)
    assert met.any()
    np.testing.assert_allclose(np.linalg.norm(normals[met], axis=1), 1.0, rtol=1e-9)
    assert (normals[met, 1] > 0.0).all()
    assert np.isnan(normals[~met]).all()


def test_from_one_place_many_rays_measure_a_slope() -> None:
    around = np.radians(np.arange(0.0, 360.0, 15.0))
    directions = np.column_stack([np.cos(around), -0.5 * np.ones_like(around), np.sin(around)])
    plane = Plane.tilted(0.2, 0.0)
    distances, normals = plane.cast_rays([0.0, 1.0, 0.0], directions)
    reached = np.array([0.0, 1.0, 0.0]) + distances[:, None] * directions / math.hypot(1.0, 0.5)
    np.testing.assert_allclose(reached @ plane.normal, 0.0, atol=1e-12)
    np.testing.assert_array_equal(normals, np.tile(plane.normal, (24, 1)))
    assert np.isinf(plane.cast_rays([0.0, 1.0, 0.0], DOWN[None], 0.9)[0]).all()


def test_a_simulation_sees_its_ground_and_its_own_parts_if_asked() -> None:
    simulation = placed(Simulation(), x=2.0, y=1.0, z=-3.0)
    x, _ = simulation.poses()["wheel_FL"]
    ahead = x + np.array([5.0, 0.0, 0.0])
    back = np.array([-1.0, 0.0, 0.0])
    assert np.isinf(simulation.cast_rays(ahead, back)[0])
    # The wheel is a disc seen edge on; a little to the side, it is met at an angle.
    aslant = x + np.array([3.0, 0.0, -1.0])
    towards = x + np.array([0.05, 0.05, 0.0]) - aslant
    distance, normal = simulation.cast_rays(aslant, towards, parts=True)
    assert distance[0] == pytest.approx(np.linalg.norm(towards), rel=1e-9)
    assert abs(normal[0, 2]) == pytest.approx(1.0)
    missed, _ = simulation.cast_rays(aslant, towards, parts=True, without="wheel_FL")
    assert missed[0] > distance[0]
    over = simulation.q[:3] - 3.0 * DOWN
    trunk, _ = simulation.cast_rays(over, DOWN, parts=True)
    ground, _ = simulation.cast_rays(over, DOWN)
    assert trunk[0] < ground[0] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("origins", "directions", "field"),
    [
        ([0.0, 1.0], [DOWN], "origins"),
        ([[0.0, 1.0, 0.0]] * 2, [DOWN] * 3, "directions"),
        ([[0.0, math.nan, 0.0]], [DOWN], "origins[0]"),
        ([[0.0, 2e6, 0.0]], [DOWN], "origins[0]"),
        ([[0.0, 1.0, 0.0]], [[0.0, math.inf, 0.0]], "directions[0]"),
        ([0.0, 1.0, 0.0], [DOWN, [0.0, 0.0, 0.0]], "directions[1]"),
        ([0.0, 1.0, 0.0], "down", "directions"),
    ],
)
def test_bad_rays_are_refused(origins: Any, directions: Any, field: str) -> None:
    for ground in (*GROUNDS.values(), Plane(), Simulation()):
        with refused(OptionError, field) as caught:
            ground.cast_rays(origins, directions)
        assert str(caught.value).startswith(field.partition("[")[0])


@pytest.mark.parametrize("reach", [0.0, -1.0, math.nan, "far"])
def test_a_range_is_positive(reach: Any) -> None:
    with refused(OptionError, "max_range"):
        Plane().cast_rays([0.0, 1.0, 0.0], DOWN, reach)


def test_no_rays_meet_nothing() -> None:
    distances, normals = HILLS.cast_rays(np.empty((0, 3)), np.empty((0, 3)))
    assert (distances.shape, normals.shape) == ((0,), (0, 3))


def test_unknown_solids_are_refused() -> None:
    with pytest.raises(OptionError, match="without: the model has no solid"):
        Simulation().cast_rays([0.0, 1.0, 0.0], DOWN, parts=True, without=["wheel_XX"])
