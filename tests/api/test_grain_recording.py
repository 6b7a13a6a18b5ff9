"""Recordings of balls in space: what is stored is what was there, a killed run keeps what it had, damage is told."""

import multiprocessing
import os
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from balls import MovingBalls, RoverOnMovingBalls

from rover_gym import OptionError, RoverModel
from rover_gym.grains import SurfaceMap, record_grains, surface_map
from rover_gym.mechanics import GrainSimulation, ball_packing
from rover_gym.record import RecordingError, read_frames
from rover_gym.runs import open_run

FLOOR = [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]]


def falling(count: int = 40) -> GrainSimulation:
    """Balls that fall on a floor."""
    packing = ball_packing(count, radius_min=0.02, radius_max=0.03, mass=0.1, width=0.4, depth=0.4, bottom=0.01)
    return GrainSimulation(*packing, walls=FLOOR, time_step=0.005)


def test_places_are_stored_within_the_resolution_and_facts_beside_them(tmp_path: Path) -> None:
    sim = falling()
    places = [sim.position]
    path = tmp_path / "fall.h5"
    unconverged = record_grains(
        sim, 0.4, path, 50.0, title="a fall", seed=3, until=lambda now: places.append(now.position) or False
    )
    run = open_run(path)
    resolution = run.trajectory.attributes["scene"]["resolution"]
    assert 0.0 < resolution <= 0.02 / 250.0
    assert run.n_frames == 21
    assert np.abs(run.positions - places).max() <= resolution + 1e-6
    np.testing.assert_array_equal(run.radius, sim.radius)
    np.testing.assert_array_equal(run.mass, sim.mass)
    assert not run.kinematic.any()
    assert run.time[-1] == pytest.approx(0.4)
    attributes = run.trajectory.attributes
    assert (attributes["complete"], attributes["seed"], attributes["unconverged_rows"]) == (True, 3, unconverged)
    assert attributes["solver"]["tolerance"] == sim.settings["tolerance"]
    assert run.title == "a fall"
    data = run.trajectory
    assert data["kinetic_energy"][0] == 0.0
    assert data["potential_energy"][-1] < data["potential_energy"][0]
    assert data["n_contacts"].max() > 0
    assert run.model is None
    assert run.rover is None


def test_a_bed_at_rest_takes_little_room(tmp_path: Path) -> None:
    """50 000 balls, 25 frames a second, 20 s and a moving share must stay below 150 MB."""
    sizes = []
    for moving in (0.0, 1.0):
        path = tmp_path / f"{moving}.h5"
        record_grains(MovingBalls((40, 5, 20), 0.005, moving), 4.0, path)
        sizes.append(path.stat().st_size / 4000 / 101)
    assert sizes[0] < 1.2  # bytes a ball and frame
    assert sizes[1] < 6.0
    assert 50_000 * 501 * sizes[1] < 150e6


def test_a_resampled_run_reads_its_own_rows(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record_grains(MovingBalls(), 2.0, path)
    run = open_run(path)
    coarse = run.resample(5.0)
    assert coarse.n_frames == 11
    np.testing.assert_array_equal(coarse.positions, run.positions[coarse.rows])
    np.testing.assert_array_equal(read_frames(path, "position", [3, 17, 40]), run.positions[[3, 17, 40]])
    with pytest.raises(RecordingError, match="must increase"):
        read_frames(path, "position", [4, 4])
    with pytest.raises(RecordingError, match="is not in the file"):
        read_frames(path, "velocity")


def test_a_rover_among_balls_is_recorded_with_its_forces_and_sinkage(tmp_path: Path) -> None:
    sim = RoverOnMovingBalls((60, 2, 30), 0.03, 0.02)
    path = tmp_path / "rover.h5"
    record_grains(sim, 0.4, path)
    run = open_run(path)
    assert run.model is not None
    assert run.model.to_dict() == RoverModel().to_dict()
    assert run.rover is not None
    np.testing.assert_allclose(run.rover.positions[-1, 0], sim.rover.q[:3], atol=1e-12)
    weight = run.model.mass * 9.81
    assert run.wheel_forces[1:, :, 1].sum(axis=1).mean() == pytest.approx(weight, rel=0.05)
    assert np.abs(run.wheel_forces[1:, :, 0].sum(axis=1)).max() < 0.5 * weight
    # It stands 20 mm below the highest tops, and those are the upper part of a rough surface.
    assert 0.0 < np.nanmean(run.sinkage) < 0.02


def keep_recording(path: Path) -> None:
    record_grains(MovingBalls((10, 3, 10)), 1e4, path, progress=lambda _: time.sleep(0.002))


def test_a_killed_run_keeps_what_it_had(tmp_path: Path) -> None:
    path = tmp_path / "killed.h5"
    process = multiprocessing.get_context("fork").Process(target=keep_recording, args=(path,))
    process.start()
    end = time.monotonic() + 30.0
    while not path.exists() or path.stat().st_size < 60_000:
        assert time.monotonic() < end
        time.sleep(0.01)
    os.kill(process.pid or 0, 9)
    process.join()
    run = open_run(path)
    assert run.n_frames >= 16
    assert run.n_frames % 16 == 0
    assert not run.trajectory.attributes["complete"]
    assert len(run.positions) == run.n_frames


def test_a_run_of_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record_grains(MovingBalls((4, 2, 4)), 0.1, path)
    with h5py.File(path, "r+") as file:
        file["frames/position"][0, 3] = np.nan
    with pytest.raises(RecordingError, match="must be finite"):
        _ = open_run(path).positions
    with h5py.File(path, "r+") as file:
        radius = file.attrs["grain_radius"]
        del file.attrs["grain_radius"]
        file.attrs["grain_radius"] = -radius
    with pytest.raises(RecordingError, match="positive radius"):
        open_run(path)
    with h5py.File(path, "r+") as file:
        del file.attrs["grain_radius"]
        file.attrs["grain_radius"] = radius[:-1]
        del file.attrs["grain_mass"]
        file.attrs["grain_mass"] = radius[:-1]
        kinematic = file.attrs["grain_kinematic"]
        del file.attrs["grain_kinematic"]
        file.attrs["grain_kinematic"] = kinematic[:-1]
    with pytest.raises(RecordingError, match="frames/position"):
        _ = open_run(path).positions


@pytest.mark.parametrize(("duration", "fps"), [(0.0, 25.0), (-1.0, 25.0), (1.0, 0.0), (np.nan, 25.0), (1.0, np.inf)])
def test_bad_options_are_refused_before_a_file_is_made(duration: float, fps: float, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with pytest.raises(OptionError):
        record_grains(MovingBalls((4, 2, 4)), duration, path, fps)
    assert not path.exists()


def test_the_surface_is_the_highest_point_over_each_cell() -> None:
    surface = surface_map([[0.0, 1.0, 0.0], [0.5, 0.3, 0.0]], [0.2, 0.1], cell=0.05, bounds=(-0.3, -0.1, 0.7, 0.1))
    assert surface.heights.shape == (5, 21)
    for x, z, height in ((0.0, 0.0, 1.2), (0.1, 0.0, 1.0 + np.sqrt(0.03)), (0.5, 0.05, 0.3 + np.sqrt(0.0075))):
        assert surface.at([x, z]) == pytest.approx(height, abs=1e-9)
    assert np.isnan(surface.at([0.3, 0.0]))
    assert np.isnan(surface.at([5.0, 0.0]))
    assert surface.at([0.0, 0.0], width=0.1) < 1.2
    with pytest.raises(OptionError, match="cell"):
        surface_map([[0.0, 0.0, 0.0], [1e3, 0.0, 1e3]], [0.01, 0.01], cell=1e-3)


def test_a_smoothed_surface_is_the_mean_over_squares() -> None:
    rng = np.random.default_rng(1)
    heights = rng.uniform(0.0, 1.0, (9, 12))
    heights[4, 5] = np.nan
    heights[:4, :4] = np.nan
    smooth = SurfaceMap(heights, (0.0, 0.0), 0.1).smoothed(3).heights
    assert smooth.shape == heights.shape
    assert smooth[4, 5] == pytest.approx(np.nanmean(heights[3:6, 4:7]))
    assert smooth[6, 8] == pytest.approx(heights[5:8, 7:10].mean())
    assert np.isnan(smooth[1, 1])
