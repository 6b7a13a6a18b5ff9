"""What `rover drive` records of what a rover sees and intends, and the overlays that a page makes of it."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from commands import error_of, output_of

from rover_gym.drive import ScanPolicy
from rover_gym.ground.terrain_parts import heights_of, surfaces_of
from rover_gym.record import RoverRun, read_run
from rover_gym.show.replay.overlays import NO_PLAN, NO_SCAN, sensor_of
from rover_gym.show.replay.rover_scene import rover_scene


def driven(folder: Path, *arguments: str) -> RoverRun:
    output_of("drive", "--time-limit", "1", "--seed", "3", "--output", folder, *arguments)
    return read_run(folder / "episode-3.h5")


def in_the_world(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Places x, z, m, of points ahead of and to the right of the rover."""
    sine, cosine = math.sin(q[4]), math.cos(q[4])
    return q[[0, 2]] + points @ [[cosine, -sine], [sine, cosine]]


def test_a_laser_over_a_plane_measures_what_its_height_and_angle_say(tmp_path: Path) -> None:
    run = driven(tmp_path, "--sensor", "laser", "--sensor", "depth", "--heading", "0")
    sensor = sensor_of("laser", run.model)
    along = sensor.directions.reshape(-1, 3)
    for row in (0, 10, 20):
        turn = run.rotations[row, 0]
        height = (run.positions[row, 0] + turn @ np.array(sensor.mount.position))[1]
        down = -(along @ turn.T)[:, 1]
        expected = np.where(down > 0.0, height / np.maximum(down, 1e-9), math.inf)
        seen = expected < sensor.max_range - 1e-6
        assert seen.sum() > 100
        assert run.trajectory["laser"][row][seen] == pytest.approx(expected[seen], rel=1e-6)
    camera = sensor_of("depth", run.model)
    points = (camera.directions.reshape(-1, 3) * run.trajectory["depth"][10][:, None]) @ camera.mount.rotation.T
    places = (points + camera.mount.position) @ run.rotations[10, 0].T + run.positions[10, 0]
    seen = run.trajectory["depth"][10] < camera.max_range
    assert seen.sum() > 100
    assert np.abs(places[seen, 1]).max() < 1e-6  # all of them lie on the ground


def test_the_scans_points_lie_on_the_ground_and_the_plan_is_one_of_the_arcs(tmp_path: Path) -> None:
    run = driven(tmp_path, "--difficulty", "0.5", "--policy", "scan")
    scene = run.trajectory.attributes["scene"]
    path = run.trajectory["plan_path"].reshape(run.n_frames, -1, 2)
    assert np.isnan(path[0]).all()  # nothing is planned before the first step
    arcs = np.array(scene["arcs"])
    assert arcs.shape[1:] == path.shape[1:]
    for row in (1, 10, 20):
        assert np.abs(arcs - path[row]).max(axis=(1, 2)).min() < 2e-4
    page = rover_scene(run, follow=True)
    channels = {channel.name: channel.values for channel in page.channels}
    grid = np.reshape(page.arrays["scan-grid"][1], (-1, 2))
    assert channels["scan"].shape == (run.n_frames, len(grid), 1)
    q = run.trajectory["q"][10]
    assert channels["scan"][10, :, 0] == pytest.approx(heights_of(run.terrain, in_the_world(q, grid)))
    assert page.facts["missing"].keys() == {"laser", "depth"}
    assert page.facts["friction"] == 0.7
    (mass,) = (channel for channel in page.channels if channel.name == "mass")
    centre = np.reshape(mass.levels(slice(10, 11)), 3) * mass.step + mass.low
    assert centre == pytest.approx(run.model.tags(q)["centre_of_mass"], abs=1e-4)


def test_the_plan_lies_on_the_heights_of_the_ground(tmp_path: Path) -> None:
    """It was drawn in the plane of the trunk, under hills and above hollows."""
    run = driven(tmp_path, "--terrain", "hills", "--difficulty", "1", "--policy", "scan")
    page = rover_scene(run, follow=True)
    channels = {channel.name: channel.values for channel in page.channels}
    arcs = np.reshape(page.arrays["arcs"][1], (-1, 2))
    assert channels["arc-heights"].shape == (run.n_frames, len(arcs), 1)
    (field,) = surfaces_of(run.terrain)
    for row in (1, 20):
        q = run.trajectory["q"][row]
        for points, heights in (
            (channels["path"][row, :, :2], channels["path"][row, :, 2]),
            (arcs, channels["arc-heights"][row, :, 0]),
        ):
            assert heights == pytest.approx(field.heights(in_the_world(q, points)))
            assert np.ptp(heights) > 0.02
    assert channels["path"][0].tolist() == [[-1e5, -1e5, pytest.approx(run.trajectory["q"][0, 1])]] * 13


@pytest.mark.nightly(
    "tests/cli/test_overlays.py::test_the_scans_points_lie_on_the_ground_and_the_plan_is_one_of_the_arcs"
)
def test_the_planner_with_futures_tells_a_path_that_leads_on(tmp_path: Path) -> None:
    pytest.importorskip("scipy")
    run = driven(tmp_path, "--difficulty", "0.5", "--policy", "planner")
    path = run.trajectory["plan_path"].reshape(run.n_frames, -1, 2)
    assert np.isfinite(path[1:]).all()
    assert np.abs(np.linalg.norm(path[1:, -1], axis=1)).max() > 0.5
    assert "arcs" not in run.trajectory.attributes["scene"]


def test_what_a_run_does_not_hold_has_a_reason(tmp_path: Path) -> None:
    run = driven(tmp_path)
    missing = rover_scene(run, follow=True).facts["missing"]
    assert missing["plan"] == NO_PLAN
    assert missing["scan"] == NO_SCAN
    assert missing["laser"] == "this run has no laser: record with `rover drive --sensor laser`"
    assert "depth" in missing


def test_an_unknown_sensor_is_refused_before_driving(tmp_path: Path) -> None:
    error = error_of("drive", "--sensor", "sonar", "--output", tmp_path / "run")
    assert error.startswith("error: --sensor: must be one of laser, depth")
    assert not (tmp_path / "run").exists()


def test_a_ghost_drives_along_and_stays_where_it_ended(tmp_path: Path) -> None:
    first = driven(tmp_path / "a", "--difficulty", "0.5")
    output_of("drive", "--time-limit", "0.5", "--seed", "4", "--output", tmp_path / "b")
    ghost = read_run(tmp_path / "b" / "episode-4.h5")
    scene = rover_scene(first, follow=True, ghost=ghost)
    n = len(first.model.solid_names)
    (places,) = (channel.values for channel in scene.channels if channel.name == "places")
    assert places.shape == (first.n_frames, 2 * n, 3)
    assert places[5, n:] == pytest.approx(ghost.positions[5])
    assert places[-1, n:] == pytest.approx(ghost.positions[-1])
    chart = scene.facts["curves"]["charts"][2]
    assert [series.get("ghost", False) for series in chart["series"]] == [False, True]
    assert chart["values"][1][5] is not None
    assert chart["values"][1][-1] is None  # it was over by then
    page = tmp_path / "page.html"
    output_of("replay", tmp_path / "a", "--ghost", tmp_path / "b", "--html", page, "--no-open")
    assert page.stat().st_size > 100_000


def test_a_ghost_beside_something_else_is_refused(tmp_path: Path) -> None:
    output_of("planar", "ball", "--duration", "0.1", "--output", tmp_path)
    driven(tmp_path / "rover")
    error = error_of("replay", tmp_path / "ball.h5", "--ghost", tmp_path / "rover", "--no-open")
    assert error.startswith("error: --ghost: can only drive beside a rover's run")


def test_the_arcs_of_a_policy_begin_at_the_middle_of_its_wheelbase_and_fan_out() -> None:
    import gymnasium as gym  # noqa: PLC0415 - of this test alone

    env = gym.make("RoverRocks-v0", **ScanPolicy.arguments())
    arcs = ScanPolicy(env).choices()
    env.close()
    assert np.ptp(arcs[:, 0], axis=0) == pytest.approx(0.0)
    assert np.ptp(arcs[:, -1, 1]) > 0.5  # m
    assert json.dumps(arcs.tolist())
