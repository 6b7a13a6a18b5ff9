"""Recordings of balls in space: what is stored is what was there, a killed run keeps what it had, damage is told."""

import json
import multiprocessing
import os
import pickle
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from balls import MovingBalls, RoverOnMovingBalls
from forged import without_checksum
from refusals import refused

from rover_gym import ModelError, OptionError, RoverModel, StateError
from rover_gym.core import GrainSimulation, Plane, RoverGrainSimulation, Simulation, ball_packing
from rover_gym.ground.grains import (
    BallBed,
    MovingWindow,
    SurfaceMap,
    rover_on_bed,
    settled_track,
    surface_map,
    with_wheel_width,
)
from rover_gym.ground.grains.grain_surface import Footprint, Parts
from rover_gym.record import RecordingError, read_frames
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.replay.grain_scene import grain_scene

FLOOR = [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]]


def falling(count: int = 40) -> GrainSimulation:
    """Balls that fall on a floor."""
    packing = ball_packing(count, radius_min=0.02, radius_max=0.03, mass=0.1, width=0.4, depth=0.4, bottom=0.01)
    return GrainSimulation(*packing, walls=FLOOR, time_step=0.005)


def test_places_are_stored_within_the_resolution_and_facts_beside_them(tmp_path: Path) -> None:
    sim = falling()
    places = [sim.position]
    path = tmp_path / "fall.h5"
    unconverged = record_run(
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


def test_the_strongest_contacts_carry_what_lies_on_them(tmp_path: Path) -> None:
    """Three balls stand on each other in a narrow tube."""
    walls = [*FLOOR, [0.02, 0, 0, -1, 0, 0], [-0.02, 0, 0, 1, 0, 0], [0, 0, 0.02, 0, 0, -1], [0, 0, -0.02, 0, 0, 1]]
    radius, mass = np.full(3, 0.02), np.array([0.3, 0.2, 0.1])
    tower = np.array([[0.0, 0.02 + 0.04 * k, 0.0] for k in range(3)])
    sim = GrainSimulation(radius, mass, tower, walls=np.array(walls, dtype=float), friction=0.0, time_step=0.005)
    path = tmp_path / "tower.h5"
    record_run(sim, 0.1, path, 50.0)
    run = open_run(path)
    chains = run.force_chains
    assert chains.shape == (6, 12, 7)
    assert not chains[0].any()  # no step was taken before the first row
    strong = chains[-1][chains[-1, :, 6] > 0.01]
    assert strong[:, 6] == pytest.approx(9.81 * np.array([0.6, 0.3, 0.1]), rel=1e-3)
    ends = strong[:, :6].reshape(-1, 2, 3)
    assert ends[0, :, 1] == pytest.approx([0.02, 0.0], abs=1e-3)  # on the floor
    assert sorted(ends[1, :, 1]) == pytest.approx([0.02, 0.06], abs=1e-3)
    assert sorted(ends[2, :, 1]) == pytest.approx([0.06, 0.10], abs=1e-3)
    scene = grain_scene(run, follow=True)
    channels = {channel.name: channel.values for channel in scene.channels}
    assert channels["chains"][-1, 0, 6] == pytest.approx(0.02)  # the strongest is as wide as a ball's radius
    assert channels["mass"][-1, 0] == pytest.approx([0.0, (0.3 * 0.02 + 0.2 * 0.06 + 0.1 * 0.1) / 0.6, 0.0], abs=1e-3)


def test_a_ball_that_rolls_far_is_shown_where_it_is(tmp_path: Path) -> None:
    """On the page, a heap that spread stopped at a square about it, twice as wide as at the start."""
    places = np.array([[0.0, 0.02, 0.0], [0.1, 0.02, 0.0]])
    sim = GrainSimulation(np.full(2, 0.02), np.full(2, 0.1), places, walls=FLOOR, time_step=0.005)
    sim.set_state(places, np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]]), np.zeros((2, 3)))
    path = tmp_path / "far.h5"
    record_run(sim, 0.5, path, 20.0)
    run = open_run(path)
    assert run.positions[-1, 1, 0] > 1.0
    (balls,) = (channel for channel in grain_scene(run, follow=True).channels if channel.name == "balls")
    shown = balls.low + balls.step * balls.levels(slice(0, run.n_frames))
    assert np.abs(shown - run.positions).max() < 0.02 / 20.0


def test_a_recording_without_contacts_has_a_page(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record_run(falling(), 0.1, path, 50.0)
    with h5py.File(path, "r+") as file:
        del file["frames/force_chains"]
        scene = json.loads(file.attrs["scene"])
        del scene["chains"]
        file.attrs["scene"] = np.bytes_(json.dumps(scene))
        without_checksum(file)
    run = open_run(path)
    assert run.force_chains.shape == (6, 0, 7)
    assert "chains" not in {channel.name for channel in grain_scene(run, follow=True).channels}


def test_a_bed_at_rest_takes_little_room(tmp_path: Path) -> None:
    """50 000 balls, 25 frames a second, 20 s and a moving share must stay below 150 MB."""
    sizes = []
    for moving in (0.0, 1.0):
        path = tmp_path / f"{moving}.h5"
        record_run(MovingBalls((40, 5, 20), 0.005, moving), 4.0, path)
        sizes.append(path.stat().st_size / 4000 / 101)
    assert sizes[0] < 1.2  # bytes a ball and frame
    assert sizes[1] < 6.0
    assert 50_000 * 501 * sizes[1] < 150e6


def test_a_resampled_run_reads_its_own_rows(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record_run(MovingBalls(), 2.0, path)
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
    record_run(sim, 0.4, path)
    run = open_run(path)
    assert run.model.to_dict() == RoverModel().to_dict()
    np.testing.assert_allclose(run.rover.positions[-1, 0], sim.rover.q[:3], atol=1e-12)
    weight = run.model.mass * 9.81
    assert run.wheel_forces[1:, :, 1].sum(axis=1).mean() == pytest.approx(weight, rel=0.05)
    assert np.abs(run.wheel_forces[1:, :, 0].sum(axis=1)).max() < 0.5 * weight
    # It stands 20 mm below the highest tops, and those are the upper part of a rough surface.
    assert 0.0 < np.nanmean(run.sinkage) < 0.02


def keep_recording(path: Path) -> None:
    record_run(MovingBalls((10, 3, 10)), 1e4, path, progress=lambda _: time.sleep(0.002))


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
    record_run(MovingBalls((4, 2, 4)), 0.1, path)
    with h5py.File(path, "r+") as file:
        file["frames/position"][0, 3] = np.nan
    with pytest.raises(RecordingError, match="must be finite"):
        _ = open_run(path).positions
    with h5py.File(path, "r+") as file:
        radius = file.attrs["grain_radius"]
        del file.attrs["grain_radius"]
        file.attrs["grain_radius"] = -radius
        without_checksum(file)
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
        record_run(MovingBalls((4, 2, 4)), duration, path, fps)
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


OPTIONS: dict[str, Any] = {"gravity": (0.0, -3.71, 0.0), "time_step": 0.004}

MODEL = with_wheel_width(RoverModel().replace(wheel_radius=0.25), 0.2)


def track(length: float) -> BallBed:
    return settled_track(length, 1.6, 1.0, radius_min=0.036, radius_max=0.044, **OPTIONS)


@pytest.fixture(scope="module")
def bed() -> BallBed:
    return track(4.0)


def whole(bed: BallBed, torque: float = 60.0) -> RoverGrainSimulation:
    return rover_on_bed(bed, MODEL, torque, **OPTIONS)


def window(bed: BallBed, torque: float = 60.0, **options: Any) -> MovingWindow:
    both = whole(bed, torque)
    return MovingWindow(both.rover, both.grains, **{"reach": 0.2, "stride": 0.02, **options})


def state(sim: MovingWindow | RoverGrainSimulation) -> list[Any]:
    balls = sim if isinstance(sim, MovingWindow) else sim.grains
    return [balls.position, balls.velocity, balls.spin, sim.rover.q, sim.rover.v]


def push(sim: MovingWindow | RoverGrainSimulation, speed: float) -> None:
    """Lets the rover roll forward."""
    rover = sim.rover
    v = rover.v
    v[0] = speed
    v[rover.model.wheel_joint_indices] = speed / 0.25
    rover.set_state(rover.q, v)


def test_a_window_over_the_whole_bed_is_the_whole_bed_to_the_bit(bed: BallBed) -> None:
    all_of_it, part = whole(bed), window(bed, reach=10.0, stride=0.001)
    for sim in (all_of_it, part):
        push(sim, 1.0)
    report = all_of_it.step(40)
    assert part.moves == 0
    followed = part.step(40)
    assert part.moves > 5
    assert (followed.steps, followed.iterations, followed.residual) == (40, report.iterations, report.residual)
    for own, theirs in zip(state(part), state(all_of_it), strict=True):
        np.testing.assert_array_equal(own, theirs)
    assert part.time == all_of_it.time
    np.testing.assert_array_equal(part.wheel_gaps, all_of_it.wheel_gaps)
    assert part.energy().kinetic == all_of_it.grains.energy().kinetic
    assert part.energy().potential == pytest.approx(all_of_it.grains.energy().potential, rel=1e-12)


def test_the_window_follows_the_rover_and_leaves_the_rest_in_its_place(bed: BallBed) -> None:
    sim = window(bed)
    rover, grains, first = sim.rover, sim.grains, sim.inside
    assert len(first) < 0.7 * len(bed.radius)
    push(sim, 1.0)
    speed = 0.0
    for _ in range(60):
        sim.step()
        outside = np.setdiff1d(np.arange(len(bed.radius)), sim.inside)
        assert not sim.velocity[outside].any()
        assert sim.asleep[outside].all()
        speed = max(speed, float(np.abs(sim.velocity).max()))
        middles = np.array([sim.rover.poses()[wheel["solid"]][0] for wheel in MODEL.to_dict()["wheels"]])
        apart = np.hypot(*(sim.position[:, None, ::2] - middles[None, :, ::2]).transpose(2, 0, 1)).min(axis=1)
        still = grains.kinematic
        assert apart[sim.inside[still]].min() > 0.2 - 0.02 - 0.01
    assert speed > 0.1
    assert sim.moves >= 3
    assert sim.rover is rover
    assert sim.grains is grains
    np.testing.assert_array_equal(rover.wheel_torques, 60.0)
    assert sim.time == pytest.approx(0.24)
    assert rover.time == pytest.approx(0.24)
    assert set(sim.inside) - set(first)
    never = np.setdiff1d(np.arange(len(bed.radius)), np.union1d(first, sim.inside))
    np.testing.assert_array_equal(sim.position[never], bed.position[never])
    assert sim.penetration() < 0.05 * bed.radius.min()
    assert 0.0 <= sim.frozen_momentum < 0.02 * bed.mass.sum()


def test_what_is_simulated_does_not_depend_on_the_length_of_the_bed(bed: BallBed) -> None:
    short, long = window(bed), window(track(9.0))
    np.testing.assert_array_equal(short.inside, long.inside)
    assert len(long.radius) > 2 * len(short.radius)


def test_a_snapshot_continues_bit_for_bit_across_moves_of_the_window(bed: BallBed) -> None:
    sim = window(bed)
    push(sim, 1.0)
    sim.step(15)
    taken = pickle.loads(pickle.dumps(sim.snapshot()))  # noqa: S301 - our own
    moves = sim.moves
    sim.step(30)
    end, momentum = state(sim), sim.frozen_momentum
    assert sim.moves > moves
    for other in (sim, window(bed)):
        other.restore(taken)
        assert other.moves == moves
        other.step(30)
        for own, theirs in zip(state(other), end, strict=True):
            np.testing.assert_array_equal(own, theirs)
        assert other.frozen_momentum == momentum


def test_a_snapshot_of_something_else_is_refused_and_changes_nothing(bed: BallBed) -> None:
    sim = window(bed)
    sim.step(3)
    before = state(sim)
    other = BallBed(1.01 * bed.radius, bed.mass, 1.01 * bed.position, 1.02 * bed.walls, 1.02 * bed.width, bed.depth)
    for wrong in (sim.rover.snapshot(), window(track(5.0)).snapshot(), window(other).snapshot()):
        with pytest.raises(StateError, match="snapshot"):
            sim.restore(wrong)  # type: ignore[arg-type]
    for own, theirs in zip(state(sim), before, strict=True):
        np.testing.assert_array_equal(own, theirs)
    assert sim.step(3).steps == 3


def test_a_ball_that_runs_away_stays_in_the_simulation_until_it_is_slow(bed: BallBed) -> None:
    both = whole(bed, 0.0)
    ahead = np.abs(bed.position[:, 0] - 3.2) < 0.3
    ball = int(np.argmax(np.where(ahead, bed.position[:, 1], 0.0)))
    velocity = np.zeros_like(bed.position)
    velocity[ball] = [0.6, 1.2, 0.0]
    both.grains.set_state(bed.position, velocity)
    sim = MovingWindow(both.rover, both.grains, reach=0.2, stride=0.1, freeze_speed=0.1)
    assert ball in sim.inside
    farthest = 0.0
    for _ in range(250):
        sim.step()
        farthest = max(farthest, float(sim.position[ball, 0] - bed.position[ball, 0]))
    assert farthest > 0.25
    assert sim.penetration() < 0.05 * bed.radius.min()
    place = sim.position[ball]
    apart = np.linalg.norm(sim.position - place, axis=1) - bed.radius - bed.radius[ball]
    apart[ball] = np.inf
    assert apart.min() > -0.05 * bed.radius.min()


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"reach": 0.1}, "reach"),
        ({"reach": np.nan}, "reach"),
        ({"stride": 0.2}, "stride"),
        ({"stride": 0.0}, "stride"),
        ({"freeze_speed": 0.0}, "freeze_speed"),
        ({"wheel_friction": -1.0}, "wheel_friction"),
    ],
)
def test_bad_options_are_refused_before_balls_are_taken_out(
    options: dict[str, float], field: str, bed: BallBed
) -> None:
    both = whole(bed)
    with refused(OptionError, field, field):
        MovingWindow(both.rover, both.grains, **options)
    assert len(both.grains.radius) == len(bed.radius)
    with pytest.raises(OptionError, match="n:"):
        window(bed).step(-1)


def test_footprints_are_the_wheels_and_what_hangs_low() -> None:
    rover = Simulation(MODEL, Plane())
    rover.set_state(MODEL.resting_pose(Plane(), (1.0, 0.5), 0.0))
    parts = Parts(MODEL)
    high = parts.footprint(rover, 0.1)
    assert len(high.names) == 6
    x, z = rover.poses()["wheel_FR"][0][::2]
    beside = [[x, z + 0.5], [x + 0.45, z], [x + 0.25 + 0.3, z + 0.4], [x, z]]
    np.testing.assert_allclose(high.distance(np.array(beside)), [0.4, 0.1, 0.4, -0.1], atol=1e-9)
    everything = parts.footprint(rover, 0.35)
    assert "trunk/0" in everything.names
    assert everything.distance(np.array([[1.0, 0.5]]))[0] < 0.0 < high.distance(np.array([[1.0, 0.5]]))[0]
    assert everything.has_moved(high, 1.0)
    assert not high.has_moved(everything, 1e-9)
    ahead = Footprint(high.names, high.ends + 0.1, high.margin)
    assert ahead.has_moved(high, 0.14)
    assert not ahead.has_moved(high, 0.15)


def test_a_drive_is_recorded_with_all_balls(bed: BallBed, tmp_path: Path) -> None:
    sim = window(bed)
    push(sim, 1.0)
    path = tmp_path / "track.h5"
    record_run(sim, 0.12, path)
    run = open_run(path)
    assert run.positions.shape == (4, len(bed.radius), 3)
    np.testing.assert_allclose(run.positions[-1], sim.position, atol=1e-3)
    assert not run.kinematic.any()
    assert run.time[-1] == pytest.approx(0.12)
    assert run.trajectory["n_asleep"][0] > 0.3 * len(bed.radius)
    potential = run.trajectory["potential_energy"][0]
    assert potential == pytest.approx(3.71 * float(bed.mass @ bed.position[:, 1]) + MODEL.mass * 3.71 * 0.58, rel=0.2)


def test_balls_are_exchanged_in_order_and_bad_numbers_are_refused(bed: BallBed) -> None:
    sim: GrainSimulation = bed.simulation(**OPTIONS)
    sim.step(5)
    time = sim.time
    kept = np.arange(0, len(bed.radius), 2)
    place = sim.position[kept]
    arguments = (bed.radius[kept], bed.mass[kept], place)
    n = len(bed.radius)
    with pytest.raises(ModelError, match=r"before\[1\]"):
        sim.exchange(*arguments, [*kept[:1], n, *kept[2:]])
    with pytest.raises(ModelError, match=r"before\[2\]"):
        sim.exchange(*arguments, [*kept[:2], kept[0], *kept[3:]])
    with pytest.raises(ModelError, match=r"before\[0\]"):
        sim.exchange(*arguments, [-2, *kept[1:]])
    with pytest.raises(ModelError, match="before"):
        sim.exchange(*arguments, kept[1:].tolist())
    with pytest.raises(StateError, match="velocity"):
        sim.exchange(*arguments, kept.tolist(), velocity=np.full_like(place, np.nan))
    assert len(sim.radius) == n
    sim.exchange(*arguments, kept.tolist(), kinematic=bed.radius[kept] > 0.04)
    np.testing.assert_array_equal(sim.position, place)
    assert sim.time == time
    assert not sim.velocity.any()
    sim.step(5)
    still = sim.kinematic
    np.testing.assert_array_equal(sim.position[still], place[still])
    assert (sim.position[~still] != place[~still]).any()
