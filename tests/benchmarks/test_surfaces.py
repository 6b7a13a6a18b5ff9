"""Drives over maps: the references by other means, the measures on made-up data, and that ours meets both."""

import importlib
from types import ModuleType

import numpy as np
import pytest
from comparison.peers.grid import corners, middle, triangles
from comparison.run import run
from comparison.scene import distance
from comparison.surfaces import bodies, drives
from comparison.surfaces.our_surfaces import ROVERS, ROVERS_ON_BALLS, OurBody
from comparison.surfaces.rolling import over_curve, over_facets, rolled
from comparison.surfaces.scene import G, largest_false_impulse
from comparison.surfaces.tables import tables

from rover_gym import HeightField

integrate = pytest.importorskip("scipy.integrate")
ROLLING = 1.4  # 1 + 2/5
ROUGH = HeightField(np.random.default_rng(3).uniform(-0.1, 0.2, (7, 9)), (0.3, 0.5), origin=(-1.2, -1.0))


def places(field: HeightField) -> np.ndarray:
    """(n, 2) well inside the map, m."""
    x_min, z_min, x_max, z_max = field.bounds
    return np.random.default_rng(4).uniform((x_min + 0.01, z_min + 0.01), (x_max - 0.01, z_max - 0.01), (200, 2))


def test_a_ball_runs_down_a_slope_at_five_sevenths_of_a_blocks_rate() -> None:
    slope = -np.tan(0.2)
    x = np.linspace(0.0, 5.0, 11)
    times = np.linspace(0.0, 1.5, 31)
    path = rolled(*over_facets(x, slope * x, 0.3, 1000), 0.0, 0.5, times)
    travelled = np.linalg.norm(path - path[0], axis=1)
    np.testing.assert_allclose(travelled, 0.5 * times + 0.5 * G * np.sin(0.2) / ROLLING * times**2, atol=1e-5)


def test_on_a_sine_the_closed_form_agrees_with_an_integrated_equation_of_motion() -> None:
    times = np.linspace(0.0, 4.0, 41)
    a, k, r = bodies.AMPLITUDE, 2.0 * np.pi / bodies.WAVELENGTH, 0.5

    def rates(_: float, state: np.ndarray) -> list[float]:
        """Of the contact's place x and the centre's speed: Newton's law along the path, with the inertia of rolling."""
        x, speed = state
        slope, bend = -a * k * np.sin(k * x), -a * k * k * np.cos(k * x)
        norm = np.sqrt(1.0 + slope**2)
        along = speed / (norm * (1.0 - r * bend / norm**3))
        return [along, -G * slope / norm / ROLLING]

    found = integrate.solve_ivp(rates, (0.0, 4.0), [0.0, 1.0], "DOP853", times, rtol=1e-11, atol=1e-12).y[0]
    expected = over_curve(found, a * np.cos(k * found), -a * k * np.sin(k * found), r)
    np.testing.assert_allclose(bodies.smooth_path(times), expected, atol=1e-7)


def test_a_hollows_corner_takes_speed_and_a_ridge_takes_none() -> None:
    angle, radius = 0.1, 0.5
    valley = np.array([-1.0, 0.0, 5.0]), np.array([np.tan(angle), 0.0, 5.0 * np.tan(angle)])
    path, turns = over_facets(*valley, radius, 5000)
    times = np.linspace(0.0, 5.0, 5001)
    with pytest.raises(ValueError, match="the ball stops"):
        rolled(path, turns, path[0, 0], 1.0, times)
    corner = int(np.argmax(turns))
    assert turns[corner] == pytest.approx(2.0 * angle)
    speed = np.sqrt(1.0 + 2.0 * G / ROLLING * (path[0, 1] - path[corner, 1]))
    # About the new contact: m r (v cos(turn) + 2/5 v) = m r (7/5) v'.
    after = speed * (np.cos(2.0 * angle) + 0.4) / 1.4
    passing = np.linalg.norm(path[corner] - path[0]) / (0.5 * (1.0 + speed))
    later = rolled(path, turns, path[0, 0], 1.0, np.array([passing, passing + 0.05]))
    way = after * 0.05 - 0.5 * G * np.sin(angle) / ROLLING * 0.05**2
    assert np.linalg.norm(later[1] - path[corner]) == pytest.approx(way, abs=1e-5)
    ridge = np.array([-1.0, 0.0, 1.0]), np.array([0.0, 0.1, 0.0])
    assert not over_facets(*ridge, radius)[1].any()


def test_the_path_on_the_facets_approaches_that_on_the_sine() -> None:
    times = np.linspace(0.0, 4.0, 41)
    smooth = bodies.smooth_path(times)
    errors = [distance(bodies.faceted_path(bodies.wave(spacing), times), smooth) for spacing in (0.05, 0.025)]
    assert errors[0] == pytest.approx(2.0 * errors[1], rel=0.15)


def test_all_that_changes_a_steady_velocity_is_a_false_impulse() -> None:
    steady = np.tile([1.0, 0.0, 0.2], (5, 1))
    assert largest_false_impulse(steady, 0.01) == 0.0
    free_fall = steady + np.outer([0, 0, 1, 1, 1], [0.0, -G * 0.01, 0.0])
    assert largest_false_impulse(free_fall, 0.01) == pytest.approx(1.0)
    sideways = free_fall + np.outer([0, 0, 0, 1, 1], [0.0, 0.0, 3.0 * G * 0.01])
    assert largest_false_impulse(sideways, 0.01) == pytest.approx(3.0)


def test_the_ball_crosses_the_edges_that_are_counted() -> None:
    x, z = (bodies.over_edges(0.02, 3.0).velocity * 3.0)[[0, 2]] / 0.02
    crossed = int(x) + int(z) + int(x - z)
    assert abs(bodies.inner_edges(0.02, 3.0) - crossed) <= 3
    assert crossed > 200


@pytest.mark.parametrize("step", [5e-3, 1e-3])
def test_ours_feels_no_inner_edge(step: float) -> None:
    for row in bodies.measure_edges(OurBody, step, 1.0, 20.0):
        assert row["error"] < 1e-9
        assert row["from_plane"] < 1e-9
        assert row["impulse"] < 1e-9


def test_ours_holds_a_box_on_a_flat_map() -> None:
    for row in bodies.measure_rest(OurBody, 5e-3, 0.3, 20.0):
        assert row["error"] < 1e-9
        assert row["impulse"] < 1e-9


def test_ours_follows_the_ball_on_the_facets_and_not_on_the_sine() -> None:
    times = bodies.SAMPLE * np.arange(201)
    scene = bodies.over_wave(0.1, 2.0)
    assert scene.field is not None
    path = bodies.roll(OurBody, scene, 1e-3, 20.0).path[::10, :2]
    assert distance(path, bodies.faceted_path(scene.field, times)) < 1e-3
    assert distance(path, bodies.smooth_path(times)) > 1e-2


def test_on_level_ground_balls_for_wheels_drive_as_discs_do() -> None:
    scene = drives.level(None, 1.0)
    paths = [run(variant, scene, 5e-3).positions for variant in (ROVERS[0], ROVERS_ON_BALLS[0])]
    assert np.ptp(paths[0][:, 0]) > 0.2
    assert distance(*paths) < 1e-5


def test_on_a_flat_map_ours_drives_as_on_the_plane() -> None:
    for row in drives.measure_level(ROVERS[0], 5e-3, 1.0, 20.0):
        assert row["error"] < 1e-9


def test_the_triangles_are_the_surface_of_the_height_field() -> None:
    place, faces = corners(ROUGH), triangles(ROUGH)
    centres = place[faces].mean(axis=1)
    np.testing.assert_allclose(ROUGH.heights(centres[:, [0, 2]]), centres[:, 1], atol=1e-7)
    assert middle(ROUGH) == pytest.approx((0.0, 0.5))
    up = np.cross(place[faces[:, 1]] - place[faces[:, 0]], place[faces[:, 2]] - place[faces[:, 0]])
    assert np.all(up[:, 1] > 0.0)


def test_mujoco_has_the_same_surface() -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (make chart installs it)")
    from comparison.peers.mujoco_engine import model_on  # noqa: PLC0415 - it imports MuJoCo

    model = model_on("<mujoco><worldbody/></mujoco>", ROUGH)
    data, hit = mujoco.MjData(model), np.zeros(1, dtype=np.int32)
    mujoco.mj_forward(model, data)
    for x, z in places(ROUGH):
        down = mujoco.mj_ray(model, data, np.array([x, 5.0, z]), np.array([0.0, -1.0, 0.0]), None, 1, -1, hit)
        assert 5.0 - down == pytest.approx(ROUGH.heights([[x, z]])[0], abs=1e-6)


@pytest.mark.parametrize("as_mesh", [False, True])
def test_bullet_has_the_same_surface(*, as_mesh: bool) -> None:
    pytest.importorskip("pybullet", reason="PyBullet is not installed (make chart installs it)")
    from comparison.peers.bullet import add_map  # noqa: PLC0415 - it imports PyBullet
    from pybullet_utils.bullet_client import BulletClient  # noqa: PLC0415 - it imports PyBullet

    client = BulletClient()
    add_map(client, ROUGH, as_mesh=as_mesh)
    for x, z in places(ROUGH):
        hit = client.rayTest([x, 5.0, z], [x, -5.0, z])[0]
        assert hit[3][1] == pytest.approx(ROUGH.heights([[x, z]])[0], abs=1e-5)


@pytest.mark.parametrize("name", ["mujoco_surfaces", "bullet_surfaces", "drake_surfaces"])
def test_on_the_plane_every_engine_rolls_straight(name: str) -> None:
    try:
        module: ModuleType = importlib.import_module(f"comparison.surfaces.{name}")
    except ImportError as missing:
        pytest.skip(f"not installed (make chart installs it): {missing}")
    key = next(iter(module.BODIES))
    scene = bodies.over_edges(None, 0.5)
    travelled = bodies.roll(module.BODIES[key], scene, 2e-3, 20.0).path
    expected = np.outer(2e-3 * np.arange(len(travelled)), scene.velocity)
    assert distance(travelled - travelled[0], expected) < 2e-3


def test_what_is_left_out_leaves_a_gap_in_the_table_and_says_why() -> None:
    point = {"scene": "edges", "engine": "E", "variant": "v", "step": 0.001}
    done = {"spacing": None, "error": 2e-3, "from_plane": 0.0, "impulse": 0.5, "cpu_ms_per_s": 1.5}
    hill = {"scene": "hills", "error": 2e-3, "errors": [1e-3, 2e-3, 3e-3], "cpu_ms_per_s": 4.0}
    meta = {"command": "make chart", "processor": "P", "packages": {}, "missing": ["drake"]}
    meta |= {"durations_s": [1.0], "changes_of_references_m": [1e-4]}
    points = [point | done, point | {"spacing": 0.1, "failure": "9 prisms"}, point | hill]
    text = tables({"meta": meta, "points": points})
    assert "| engine | plane | cells of 0.1 m, 20 edges |" in text
    assert "| E, v | 2 (0), 0.5, 1.5 | - |" in text
    assert "Left out: E, v, cells of 0.1 m, 20 edges: 9 prisms." in text
    assert "| E, v | 2 (3), 4 |" in text
    assert "Left out, not installed: drake." in text
