"""MCAP logs are read back with the format's own readers, and survive a kill and a full disk."""

import io
import json
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from commands import error_of, output_of
from recordings import recorded
from rovers import placed, standing

from rover_gym import Plane, RoverModel, Simulation, SphereField
from rover_gym.envs.sensors import ColourCamera, DepthCamera, Mount, SegmentationCamera
from rover_gym.record import RecordingError, RoverSampler, read_run

pytest.importorskip("mcap.reader")
pytest.importorskip("foxglove_schemas_protobuf")

from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_ros2.decoder import DecoderFactory as CdrFactory

from rover_gym.exports import McapWriter, write_mcap
from rover_gym.show.replay.overlays import sensor_of

GROUND = SphereField([[1.0, 0.1, -0.5], [2.0, 0.0, 0.7]], [0.2, 0.3], Plane((-0.1, 1.0, 0.05), 0.0))
PICTURE = np.zeros((32, 48, 3), np.uint8)
PICTURE[:, :24, 0] = 250

#: Ends while it logs: killed by itself, or by the limit on the size of files that stands for a full disk.
LOGGING = """
import os, resource, signal, sys
from rover_gym import RoverModel, Simulation
from rover_gym.exports import McapWriter
from rover_gym.record import RoverSampler

if sys.argv[2] == "full":
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (120_000, 120_000))
sim = Simulation(RoverModel())
sampler = RoverSampler(sim.model)
log = McapWriter(sys.argv[1], sim.model, sim.terrain)
for i in range(2000):
    sim.step()
    log.append(sampler.row(sim))
    if i == 300 and sys.argv[2] == "kill":
        log.flush()
        os.kill(os.getpid(), signal.SIGKILL)
"""


def quick_run(path: Path, n: int = 30) -> Path:
    sim = placed(Simulation(RoverModel(), GROUND, gravity=(0.0, -3.7, 0.0)), y=0.5)
    sim.set_wheel_torques(np.arange(6.0))
    sim.step()
    recorded(sim, path, n - 1, scene={"goal": (3.0, -1.0)})
    return path


def json_decoder(encoding: str, _schema: Any) -> Callable[[bytes], Any] | None:
    return json.loads if encoding == "json" else None


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Times in ns and messages by topic."""
    found = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory(), CdrFactory(), Mock(decoder_for=json_decoder)])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.name
            found[channel.topic].append((message.log_time, decoded))
    return found


def log_of(path: Path, **arguments: Any) -> McapWriter:
    return McapWriter(path, RoverModel(), Plane((0.0, 1.0, 0.0), 0.0), **arguments)


def row_at(time: float) -> dict[str, Any]:
    return {"time": time, "q": np.zeros(21), "v": np.zeros(21)}


def turned(rotation: Any, vector: np.ndarray) -> np.ndarray:
    """A vector rotated by a quaternion: v + 2 u x (u x v + w v)."""
    u = np.array([rotation.x, rotation.y, rotation.z])
    return vector + 2.0 * np.cross(u, np.cross(u, vector) + rotation.w * vector)


#: R_BS of REP 103 (x forward, y left, z up) and a solid (x forward, y up, z right).
REP_103 = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def rep_103(vector: Any) -> Any:
    """A vector of REP 103 in a solid's own axes."""
    return np.asarray(REP_103 @ np.asarray(vector))


def test_frames_have_x_forward_and_z_up(tmp_path: Path) -> None:
    """Frames of solids had y up. ROS programs expect REP 103, where y is left and z up."""
    model = RoverModel()
    sim = standing(model)
    sampler = RoverSampler(model)
    with McapWriter(tmp_path / "rest.mcap", model, sim.terrain) as log:
        for _ in range(40):
            log.append(sampler.row(sim))
            sim.step(5)
        log.imu(sim.time, np.eye(3), [0.0, 0.2, 0.0], [0.0, 9.81, 0.0])
    found = read(tmp_path / "rest.mcap")
    frames = {one.child_frame_id: one for one in found["/tf"][-1][1].transforms}
    for axis, direction in (([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])):
        in_world = turned(frames["trunk"].rotation, np.array(axis))
        assert in_world == pytest.approx(direction, abs=1e-2)
        in_map = turned(frames["world"].rotation, in_world)
        assert in_map == pytest.approx(axis, abs=1e-2)
    for topic in ("/imu", "/imu/sensor"):
        force = found[topic][-1][1].linear_acceleration
        assert [force.x, force.y, force.z] == pytest.approx([0.0, 0.0, 9.81], abs=0.05)
    turn = found["/imu/sensor"][0][1]
    assert turn.angular_velocity.z == 0.2
    assert turned(turn.orientation, np.array([0.0, 0.0, 1.0])) == pytest.approx([0.0, 0.0, 1.0])
    (trunk,) = (entity for entity in found["/scene"][0][1].entities if entity.id == "rover/trunk")
    points = np.array([[p.x, p.y, p.z] for part in trunk.triangles for p in part.points])
    assert np.ptp(points[:, 2]) < np.ptp(points[:, 0])


def test_a_recording_comes_back_in_the_common_schemas(tmp_path: Path) -> None:
    run = read_run(quick_run(tmp_path / "run.h5"))
    found = read(write_mcap(run, tmp_path / "run.mcap"))
    assert found.keys() == {"/tf", "/joint_states", "/imu", "/scene", "/wheels", "/signals"}
    assert [stamp for stamp, _ in found["/tf"]] == np.round(run.time * 1e9).astype(int).tolist()
    for i, (_, message) in enumerate(found["/tf"]):
        frames = {one.child_frame_id: one for one in message.transforms}
        assert frames.keys() == {"world", *run.model.solid_names}
        up = turned(frames["world"].rotation, np.array([0.0, 1.0, 0.0]))
        assert up == pytest.approx([0.0, 0.0, 1.0])  # the map's z is up
        for k, name in enumerate(run.model.solid_names):
            origin, arm = frames[name].translation, np.array([0.3, -0.2, 0.1])
            assert frames[name].parent_frame_id == "world"
            assert [origin.x, origin.y, origin.z] == pytest.approx(run.positions[i, k], abs=1e-15)
            own = run.rotations[i, k] @ rep_103(arm)
            assert turned(frames[name].rotation, arm) == pytest.approx(own, abs=1e-12)
    for i, (_, message) in enumerate(found["/joint_states"]):
        joints = {joint.name: joint for joint in message.joints}
        assert [joint.position for joint in message.joints] == run.trajectory["q"][i, 6:].tolist()
        assert [joint.velocity for joint in message.joints] == run.trajectory["v"][i, 6:].tolist()
        assert joints["wheel_FR"].effort == -run.trajectory["motor_torques"][i, 1]  # the joint turns about its axle
        assert not joints["front_axle"].HasField("effort")


def test_the_imu_feels_gravity_and_the_change_of_velocity(tmp_path: Path) -> None:
    run = read_run(quick_run(tmp_path / "run.h5"))
    found = read(write_mcap(run, tmp_path / "run.mcap"))["/imu"]
    assert len(found) == run.n_frames - 1
    v, h = run.trajectory["v"], 0.005
    for i, (_, message) in enumerate(found, 1):
        turn = run.rotations[i, 0]
        felt = (turn @ REP_103).T @ ((v[i, :3] - v[i - 1, :3]) / h + [0.0, 3.7, 0.0])
        rates, force = message.angular_velocity, message.linear_acceleration
        assert [force.x, force.y, force.z] == pytest.approx(felt, abs=1e-9)
        assert [rates.x, rates.y, rates.z] == pytest.approx((turn @ REP_103).T @ v[i, 3:6], abs=1e-12)
        ahead = turn @ [1.0, 0.0, 0.0]
        assert turned(message.orientation, np.array([1.0, 0.0, 0.0])) == pytest.approx([ahead[0], -ahead[2], ahead[1]])
        up = turn @ [0.0, 1.0, 0.0]
        assert turned(message.orientation, np.array([0.0, 0.0, 1.0])) == pytest.approx([up[0], -up[2], up[1]])
        assert message.header.frame_id == "trunk"
    assert abs(found[0][1].linear_acceleration.z) < 1e-3  # it falls, and its wheels begin to turn


def test_the_scene_shows_rover_rocks_and_goal(tmp_path: Path) -> None:
    run = read_run(quick_run(tmp_path / "run.h5", n=2))
    ((_, scene),) = read(write_mcap(run, tmp_path / "run.mcap"))["/scene"]
    entities = {entity.id: entity for entity in scene.entities}
    assert {"ground", "rocks", "goal", "rover/trunk", "rover/wheel_FL"} <= entities.keys()
    assert [ball.size.x for ball in entities["rocks"].spheres] == [0.4, 0.6]
    assert entities["rover/trunk"].frame_id == "trunk"
    assert entities["rover/trunk"].frame_locked
    surface = entities["ground"].triangles[0]
    heights = [-(-0.1 * p.x + 0.05 * p.z) for p in surface.points]
    assert [p.y for p in surface.points] == pytest.approx(heights, abs=1e-9)
    assert max(surface.indices) < len(surface.points)


def test_the_rest_of_a_row_is_json(tmp_path: Path) -> None:
    run = read_run(quick_run(tmp_path / "run.h5"))
    found = read(write_mcap(run, tmp_path / "run.mcap"))
    for i, (_, wheels) in enumerate(found["/wheels"]):
        assert list(wheels) == run.model.wheel_names
        assert wheels["FR"]["torque"] == 1.0
        assert wheels["BL"]["normal_force"] == run.trajectory["wheel_forces"][i, 3, 0]
    assert [one["potential_energy"] for _, one in found["/signals"]] == run.trajectory["potential_energy"].tolist()


def test_images_and_points_come_back(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    points = np.array([[1.0, 2.0, 3.0], [np.nan, 0.0, 0.0], [-4.0, 5.5, 0.25]])
    with log_of(tmp_path / "a.mcap", epoch=1e9) as log:
        log.points(0.5, points, frame="trunk")
        log.image(0.5, PICTURE)
    found = read(tmp_path / "a.mcap")
    ((stamp, cloud),) = found["/points"]
    assert stamp == 1_000_000_000_500_000_000
    assert np.frombuffer(cloud.data, "<f4").reshape(-1, 3).tolist() == (points[[0, 2]] @ REP_103).tolist()
    assert [(field.name, field.offset) for field in cloud.fields] == [("x", 0), ("y", 4), ("z", 8)]
    ((_, picture),) = found["/camera"]
    pixels = np.asarray(image.open(io.BytesIO(picture.data))).astype(int)
    assert pixels.shape == PICTURE.shape
    assert np.abs(pixels[:, :20] - PICTURE[:, :20]).max() < 10


def test_a_run_renders_its_images(tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules")
    run = read_run(quick_run(tmp_path / "run.h5", n=41))
    found = read(write_mcap(run, tmp_path / "run.mcap", images=True, fps=10.0))
    assert [round(stamp / 1e6) for stamp, _ in found["/camera"]] == [5, 105, 205]


def test_a_run_shows_what_cameras_on_it_see(tmp_path: Path) -> None:
    """Colours, labels and depths of a camera whose frame looks along z, x to the right, with its calibration."""
    image = pytest.importorskip("PIL.Image")
    view: dict[str, Any] = {"width": 32, "height": 24, "mount": Mount(position=(0.5, 1.0, -0.2), pitch_deg=-30.0)}
    depth = DepthCamera(**view)
    cameras = [ColourCamera(**view), SegmentationCamera(**view), depth, ColourCamera(name="wide", fisheye=True)]
    run = read_run(quick_run(tmp_path / "run.h5", n=41))
    found = read(write_mcap(run, tmp_path / "run.mcap", cameras=cameras, fps=10.0))
    assert [round(stamp / 1e6) for stamp, _ in found["/colour/image"]] == [5, 105, 205]
    picture = np.asarray(image.open(io.BytesIO(found["/colour/image"][0][1].data)))
    assert picture.shape == (24, 32, 3)
    assert picture.std() > 5.0
    labels, depths = found["/segmentation/image"][0][1], found["/depth/image"][0][1]
    assert (labels.encoding, labels.step, depths.encoding, depths.step) == ("mono8", 32, "32FC1", 128)
    assert set(labels.data) <= {0, 1, 2, 3}
    ((_, lens),) = found["/colour/calibration"]
    assert (lens.distortion_model, list(lens.D)) == ("plumb_bob", [0.0] * 5)
    assert found["/wide/calibration"][0][1].distortion_model == "kannala_brandt"
    # The ray of a pixel, from its number and the calibration, ends on the ground.
    metres = np.frombuffer(depths.data, "<f4").reshape(24, 32)
    frames = [one for _, message in found["/tf"] for one in message.transforms]
    mounted = next(one for one in frames if one.child_frame_id == "colour")
    trunk = next(one for one in frames if one.child_frame_id == mounted.parent_frame_id)
    world = next(one for one in frames if one.child_frame_id == "world")
    on_ground = np.frombuffer(labels.data, np.uint8).reshape(24, 32) == SegmentationCamera.GROUND
    assert on_ground.any()
    for row, column in np.argwhere(on_ground & (metres < depth.max_range))[::20]:
        z = float(metres[row, column])
        point = z * np.array([(column - lens.K[2]) / lens.K[0], (row - lens.K[5]) / lens.K[4], 1.0])
        for frame in (mounted, trunk, world):
            origin = np.array([frame.translation.x, frame.translation.y, frame.translation.z])
            point = turned(frame.rotation, point) + origin
        assert point @ [-0.1, -0.05, 1.0] == pytest.approx(0.0, abs=0.01), "on the plane of GROUND, seen with z up"


@pytest.mark.parametrize("end", ["kill", "full"])
def test_what_was_written_stays_readable(end: str, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    done = subprocess.run([sys.executable, "-c", LOGGING, str(path), end], check=False, capture_output=True, text=True)
    found = read(path)
    if end == "kill":
        assert done.returncode == -signal.SIGKILL
        assert len(found["/tf"]) == 301
    else:
        assert "the recording stopped: File too large; " in done.stderr
        n = sum(map(len, found.values()))
        assert f" {n} messages are on the disk" in done.stderr
        assert n > 100
    with path.open("rb") as stream:  # readers that read from the start find an end, too
        assert sum(1 for _ in NonSeekingReader(stream).iter_messages()) == sum(map(len, found.values()))


def test_a_finished_log_has_an_index(tmp_path: Path) -> None:
    with log_of(tmp_path / "a.mcap", attributes={"title": "indexed", "seed": 3}) as log:
        for i in range(400):
            log.append(row_at(0.01 * i))
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary.statistics.message_count == 1 + 2 * 400 + 399
        assert len(summary.chunk_indexes) > 2
        (facts,) = reader.iter_metadata()
    assert (facts.name, facts.metadata["title"], facts.metadata["seed"]) == ("rover_gym", "indexed", "3")


@pytest.mark.parametrize(
    ("misuse", "message"),
    [
        (lambda log: log.append({**row_at(0.0), "q": np.full(21, np.nan)}), "q: must be finite"),
        (lambda log: log.append({**row_at(0.0), "q": np.zeros(20)}), r"q: must have the shape \(21,\)"),
        (lambda log: log.append({"time": 0.0, "q": np.zeros(21)}), "row: must hold v"),
        (lambda log: log.append({**row_at(0.0), "v": "fast"}), "v: must be numbers"),
        (lambda log: log.append(row_at(-1.0)), "time: must be from"),
        (lambda log: log.append(row_at(np.inf)), "time: must be finite"),
        (lambda log: log.points(0.0, np.zeros((3, 2))), "points: must have the shape"),
        (lambda log: log.points(0.0, np.zeros((1, 3)), topic="/tf"), "topic: has messages of type foxglove.Frame"),
        (lambda log: log.image(0.0, PICTURE.astype(float)), "pixels: must be"),
        (lambda log: log.camera(0.0, ColourCamera(width=3, height=2), PICTURE), "reading: must be of the camera"),
        (lambda log: log.camera(0.0, ColourCamera(image="normalised"), PICTURE), "camera.image: must be"),
        (lambda log: log.imu(0.0, np.eye(3), np.zeros(3), np.full(3, np.nan)), "acceleration: must be finite"),
    ],
)
def test_bad_input_is_refused_and_the_log_goes_on(
    misuse: Callable[[McapWriter], None], message: str, tmp_path: Path
) -> None:
    with log_of(tmp_path / "a.mcap") as log:
        log.append(row_at(0.0))
        with pytest.raises(RecordingError, match=message):
            misuse(log)
        log.append(row_at(0.1))
    assert len(read(tmp_path / "a.mcap")["/tf"]) == 2


def test_a_log_has_one_writer_and_one_end(tmp_path: Path) -> None:
    log = log_of(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="is in use"):
        log_of(tmp_path / "a.mcap")
    log.close()
    log.close()
    with pytest.raises(RecordingError, match="is closed"):
        log.append(row_at(0.0))


def test_the_command_writes_beside_the_run(tmp_path: Path) -> None:
    path = quick_run(tmp_path / "run.h5", n=3)
    output_of("export", "mcap", path, "--camera")
    found = read(tmp_path / "run.mcap")
    assert len(found["/tf"]) == 3 + 1  # the camera's
    assert found["/colour/calibration"][0][1].width == 320
    assert "--output: would replace the run itself" in error_of("export", "mcap", path, "--output", path)
    assert read_run(path).n_frames == 3


def test_a_recorded_laser_and_depth_were_only_numbers_in_the_log(tmp_path: Path) -> None:
    """Recorded with `rover drive --sensor`, they are point clouds on the ground."""
    output_of("drive", "--time-limit", "0.1", "--sensor", "laser", "--sensor", "depth", "--output", tmp_path)
    write_mcap(read_run(tmp_path / "episode-0.h5"), tmp_path / "log.mcap")
    topics = read(tmp_path / "log.mcap")
    run = read_run(tmp_path / "episode-0.h5")
    for name in ("laser", "depth"):
        clouds = [message for _, message in topics[f"/{name}/points"]]
        assert len(clouds) == run.n_frames
        points = np.frombuffer(clouds[0].data, np.float32).reshape(-1, 3)
        seen = np.count_nonzero(run.trajectory.data[name][0] < sensor_of(name, run.model).max_range)
        assert len(points) == seen > 10
        # The trunk is level at the start, z up: all hits lie on the plane under it.
        np.testing.assert_allclose(points[:, 2], -run.trajectory.data["q"][0, 1], atol=0.02)
    assert name not in topics["/signals"][0][1]
