"""Saved runs, read back with their rover and ground."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import error_of, output_of
from recordings import killed_run, recorded
from rovers import placed

from rover_gym import OptionError, Plane, RoverModel, Simulation, SphereField
from rover_gym.record import Recorder, RecordingError, RoverSampler, describe, read_run, read_trajectory
from rover_gym.record.saved_runs import record_run
from rover_gym.scenes import inclined_plane, sphere_rug
from rover_gym.scenes.report_scenes import GRAVITY, WHEEL_RADIUS, distance_to_siconos, reference_data
from rover_gym.show.replay.rover_scene import rover_curves, rover_scene


def test_poses_are_those_of_the_simulation(tmp_path: Path) -> None:
    sim = inclined_plane.simulation()
    run = recorded(sim, tmp_path / "run.h5", 20)
    assert run.n_frames == 21
    assert run.positions.shape == (21, 16, 3)
    assert run.rotations.shape == (21, 16, 3, 3)
    for i, (position, rotation) in enumerate(sim.poses().values()):
        assert run.positions[-1, i] == pytest.approx(position, abs=1e-12)
        assert run.rotations[-1, i] == pytest.approx(rotation, abs=1e-12)
    assert list(sim.poses()) == run.model.solid_names
    # Of contact 0.30 m in this scene, so the rover is the recorded one and not the built-in one.
    assert run.model.wheel_radii == pytest.approx(np.full(6, 0.3))
    assert run.model.to_dict() == sim.model.to_dict()
    assert run.goal is None
    assert run.title == "a test"


def test_the_wheels_recorded_gaps_are_those_over_the_ground_that_is_read(tmp_path: Path) -> None:
    for name, sim in (("plane", inclined_plane.simulation()), ("rug", sphere_rug.simulation())):
        run = recorded(sim, tmp_path / f"{name}.h5", 20)
        for q, gaps in zip(run.trajectory["q"], run.trajectory["wheel_gaps"], strict=True):
            assert run.model.wheel_gaps(q, run.terrain, "state") == pytest.approx(gaps, abs=1e-12)


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_an_episode_is_read_back_with_its_goal(terrain: str, tmp_path: Path) -> None:
    arguments = ["drive", "--terrain", terrain, "--goal", "5", "1", "--time-limit", "1", "--output", str(tmp_path)]
    output_of(*arguments)
    run = read_run(tmp_path / "episode-0.h5")
    assert run.goal == (5.0, 1.0)
    assert isinstance(run.terrain, Plane if terrain == "plane" else SphereField)
    assert run.n_frames == 21
    for q, gaps in zip(run.trajectory["q"], run.trajectory["wheel_gaps"], strict=True):
        assert run.model.wheel_gaps(q, run.terrain, "state") == pytest.approx(gaps, abs=1e-12)


def test_both_sections_of_the_report_are_read_back(tmp_path: Path) -> None:
    for scene in (inclined_plane, sphere_rug):
        result = scene.run(tmp_path / "run.h5", duration=0.1)
        assert read_run(result.path).n_frames == 21


def test_a_killed_run_is_read_back_as_far_as_it_came(tmp_path: Path) -> None:
    path = tmp_path / "killed.h5"
    run = killed_run(path)
    assert (run.n_frames, run.title) == (50, "to be killed")
    assert not run.trajectory.attributes["complete"]
    sim = inclined_plane.simulation()
    sim.step(50)
    trunk = run.model.solid_names.index("trunk")
    assert run.positions[-1, trunk] == pytest.approx(sim.poses()["trunk"][0], abs=1e-12)
    output_of("replay", path, "--vrml", tmp_path / "killed.wrl", "--fps", "1000")
    place = (tmp_path / "killed.wrl").read_text(encoding="utf-8").partition("DEF trunk_place")[2].partition("\n")[0]
    keys, _, values = place.partition("keyValue")
    assert len(keys.partition("key [")[2].strip("] ").split()) == 50
    last = [float(word) for word in values.strip("[] }").split(",")[-1].split()]
    assert last == pytest.approx(sim.poses()["trunk"][0], abs=1e-6)


def test_frames_are_the_samples_nearest_to_a_films_times(tmp_path: Path) -> None:
    run = recorded(inclined_plane.simulation(), tmp_path / "run.h5", 100)  # 0.5 s at 200 samples a second
    film = run.resample(30.0)
    assert film.n_frames == 16
    assert np.abs(film.time - np.arange(16) / 30.0).max() <= 0.0025 + 1e-12
    assert np.array_equal(film.positions[-1], run.positions[np.searchsorted(run.time, film.time[-1] - 1e-9)])
    assert np.array_equal(run.resample(1e6).time, run.time)
    assert run.resample(1e-3).n_frames == 1
    for fps in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(OptionError, match="fps"):
            run.resample(fps)


def dropped_rover() -> Simulation:
    sim = placed(Simulation(RoverModel(), Plane(), time_step=0.002), y=0.6)
    sim.set_wheel_torques(np.full(6, 15.0))
    return sim


def test_forces_and_torques_of_a_thinned_run_are_means_of_all_steps(tmp_path: Path) -> None:
    """Rows at 25 a second held the forces of one step in twenty, and pages took one row in several."""
    record_run(dropped_rover(), 1.2, tmp_path / "steps.h5", None)
    record_run(dropped_rover(), 1.2, tmp_path / "rows.h5", 25.0)
    steps, rows = (read_run(tmp_path / f"{name}.h5") for name in ("steps", "rows"))
    for name in ("wheel_forces", "motor_torques"):
        means = steps.trajectory[name][1:].reshape(30, 20, 6, -1).mean(axis=1)
        np.testing.assert_allclose(rows.trajectory[name][1:].reshape(means.shape), means, rtol=1e-9, atol=1e-9)

    resampled = steps.resample(10.0)
    impact = int(np.argmax(steps.trajectory["wheel_forces"][:, 0, 0]))
    frame = int(np.argmin(np.abs(resampled.time - steps.time[impact])))
    near = np.abs(steps.time - resampled.time[frame]) <= 0.1 + 1e-6
    loads = rover_curves(resampled)["charts"][0]["values"][0]
    assert loads[frame] == pytest.approx(steps.trajectory["wheel_forces"][near, 0, 0].mean(), abs=0.5)
    scene = rover_scene(resampled, follow=True)
    (forces,) = (channel.values for channel in scene.channels if channel.name == "forces")
    share = steps.model.mass * 9.81 / 6
    near = np.abs(steps.time - resampled.time[frame]) <= 0.05 + 1e-6
    assert share * forces[frame, 0, 4] == pytest.approx(steps.trajectory["wheel_forces"][near, 0, 0].mean(), rel=0.02)
    hits = [event for event in scene.facts["events"] if "hits with" in event["name"]]
    assert any(abs(event["time"] - steps.time[impact]) < 0.01 for event in hits)


def test_a_run_without_rover_ground_or_samples_is_refused(tmp_path: Path) -> None:
    sim = Simulation(RoverModel())
    sampler = RoverSampler(sim.model)

    whole = describe(sim, "whole")
    for what, facts, terrain, rows in (
        ("rover", {"title": "no model"}, sim.terrain, 1),
        ("ground", whole, None, 1),
        ("samples", whole, sim.terrain, 0),
    ):
        with Recorder(tmp_path / f"{what}.h5", sampler.channels, facts, terrain=terrain) as recorder:
            for _ in range(rows):
                recorder.append(sampler.row(sim))
        with pytest.raises(RecordingError, match=f"contains no {what}"):
            read_run(tmp_path / f"{what}.h5")


FIGURES = (
    "figure-6.2-wheel-traces.png",
    "figure-6.3-contact-distances.png",
    "figure-6.4-reaction-force.png",
    "figure-6.5-steering-angles.png",
    "section-6.1-beside-siconos.png",
    "section-6.2-wheel-traces.png",
    "section-6.2-contact-distances.png",
    "section-6.2-reaction-forces.png",
)


@pytest.mark.nightly("tests/cli/test_run.py::test_the_run_lands_where_siconos_does")
def test_the_scene_is_recorded_and_drawn(tmp_path: Path) -> None:
    output = output_of("report", "--figures", "--duration", "12", "--output", tmp_path)
    trajectory = read_trajectory(tmp_path / "trajectory.h5")
    assert trajectory.attributes["complete"]
    assert trajectory.attributes["solver"]["gravity"] == list(GRAVITY)
    assert trajectory["time"][-1] == pytest.approx(12.0)
    for name in FIGURES:
        head = (tmp_path / name).read_bytes()[:24]
        assert head.startswith(b"\x89PNG")
        width, height = struct.unpack(">II", head[16:24])
        assert width >= 1200
        assert height >= 600
        assert name in output
    assert "from Siconos" in output


def test_the_run_lands_where_siconos_does(tmp_path: Path) -> None:
    # Without stabilisation the scheme is Siconos' own, so at its step the two differ by impact times alone.
    inclined_plane.run(tmp_path / "run.h5", duration=10.0, time_step=0.005, variant="newton", stabilisation="none")
    rows = distance_to_siconos(read_trajectory(tmp_path / "run.h5"))
    assert [step for step, _, _ in rows] == [0.005, 0.0002]
    assert rows[0][2] < 0.001  # m; 0.2 mm when written
    assert rows[1][2] < 0.01  # m, the tolerance at 5 ms


def test_the_scene_starts_as_the_reference_does() -> None:
    # The gaps at the start, from the Siconos run: they fix plane, wheel radius, geometry and attitude.
    reference = reference_data()["siconos"][0]
    assert inclined_plane.simulation().wheel_gaps == pytest.approx(np.array(reference["gap"][0]), abs=1e-6)


def test_the_rover_drives_over_the_rug(tmp_path: Path) -> None:
    result = sphere_rug.run(tmp_path / "rug.h5", duration=20.0)
    trajectory = read_trajectory(result.path)
    assert trajectory.attributes["scene"]["terrain"]["kind"] == "sphere_field"
    assert trajectory["q"][0, :3] == pytest.approx(sphere_rug.start)
    assert np.isfinite(trajectory["q"]).all()
    assert result.first_contact is not None
    assert result.unconverged_steps == 0
    assert result.smallest_gap > -0.01  # m


def test_gaps_on_the_rug_are_those_of_points_on_the_rim() -> None:
    sim = sphere_rug.simulation()
    field = sim.terrain
    turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
    for _ in range(5):
        sim.step(250)
        poses = sim.poses()
        for wheel, gap in zip(sim.model.to_dict()["wheels"], sim.wheel_gaps, strict=True):
            centre, rotation = poses[wheel["solid"]]
            rim = centre + WHEEL_RADIUS * np.stack((np.cos(turn), np.sin(turn)), axis=1) @ rotation[:, :2].T
            near = field.centres[np.linalg.norm(field.centres - centre, axis=1) < 1.5]
            distance = np.linalg.norm(rim[:, None] - near, axis=2).min() - 0.5
            assert gap == pytest.approx(distance, abs=1e-7)


def test_without_matplotlib_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "pip install 'rover-gym[demo]'" in error_of("report", "--figures", "--duration", "0.1", "--output", tmp_path)
