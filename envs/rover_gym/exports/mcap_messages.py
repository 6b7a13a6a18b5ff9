"""Messages of an MCAP log in Foxglove's schemas. The IMU uses the schema of ROS 2, because Foxglove has none.

The simulator's world has y up. The frame `map` has z up, as viewers expect. `world` is a child of `map`, and the solids
are children of `world`.

A chunk of messages is followed by the records that end a file, and the next chunk overwrites them. Without enough space
on the disk the file stays as the last commit left it.
"""

from __future__ import annotations

import io
import os
import struct
import weakref
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.extras import MissingExtraError, require
from rover_gym.core.rotations import quaternions
from rover_gym.core.validation import refuse
from rover_gym.exports.axes import MAP_FROM_WORLD
from rover_gym.record.channels import RecordingError, file_path
from rover_gym.record.steady_file import FileInUseError, SteadyFile

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from rover_gym.envs.sensors import Camera
    from rover_gym.show.frames.appearance import Colour


Array = npt.NDArray[np.float64]

MAP, WORLD = "map", "world"

#: R_BS: from the axes of a solid as logged (REP 103: x forward, y left, z up) to its own (x forward, y up, z right).
SOLID_FROM_LOGGED = MAP_FROM_WORLD.T

#: From the axes of a camera as logged (x right, y down, z forward) to its own (x forward, y up, z right).
CAMERA_FROM_LOGGED = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])

JPEG_QUALITY = 90

ALL = 1  # foxglove.SceneEntityDeletion.ALL

FLOAT32 = 7  # foxglove.PackedElementField.FLOAT32

IMU_NAME = "sensor_msgs/msg/Imu"

IMU_SCHEMA = """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def message(name: str) -> Any:
    """A message class of Foxglove's, such as `FrameTransforms`.

    Raises:
        MissingExtraError: foxglove-schemas-protobuf is not installed.
    """
    try:
        return getattr(import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)
    except ModuleNotFoundError as error:
        raise MissingExtraError("foxglove-schemas-protobuf", "logs") from error


def transforms(nanoseconds: int, frames: Sequence[tuple[str, str, Array, Array]]) -> Any:
    """`foxglove.FrameTransforms` of (parent, child, origin (3,) in m, rotation from child to parent (3, 3))."""
    single, found = message("FrameTransform"), message("FrameTransforms")()
    turns = quaternions(np.array([rotation for *_, rotation in frames]))
    for (parent, child, origin, _), (w, x, y, z) in zip(frames, turns, strict=True):
        one = single(parent_frame_id=parent, child_frame_id=child)
        _stamp(one.timestamp, nanoseconds)
        _point(one.translation, origin)
        one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w = x, y, z, w
        found.transforms.append(one)
    return found


def joint_states(
    nanoseconds: int, names: Sequence[str], angles: Array, rates: Array, efforts: Mapping[int, float]
) -> Any:
    """`foxglove.JointStates`: rad or m, rad/s or m/s, and N m of the joints that have a drive, by index."""
    found = message("JointStates")()
    _stamp(found.timestamp, nanoseconds)
    for i, name in enumerate(names):
        joint = found.joints.add(name=name, position=angles[i], velocity=rates[i])
        if i in efforts:
            joint.effort = efforts[i]
    return found


def scene(nanoseconds: int) -> Any:
    """An empty `foxglove.SceneUpdate`; `add_meshes` and `add_spheres` fill it."""
    found = message("SceneUpdate")()
    earlier = found.deletions.add()  # a viewer forgets what an earlier scene held
    earlier.type = ALL
    _stamp(earlier.timestamp, nanoseconds)
    return found


def add_meshes(
    scene: Any,
    nanoseconds: int,
    name: str,
    frame: str,
    meshes: Iterable[tuple[Colour, Array, npt.NDArray[np.int32]]],
) -> None:
    """Adds surfaces in a frame: colour, vertices (n, 3) in m, triangles (m, 3)."""
    entity = _entity(scene, nanoseconds, name, frame)
    for colour, vertices, triangles in meshes:
        used, corners = np.unique(triangles, return_inverse=True)
        surface = entity.triangles.add()
        _no_pose(surface.pose)
        _paint(surface.color, colour)
        for vertex in vertices[used]:
            _point(surface.points.add(), vertex)
        surface.indices.extend(corners.ravel().tolist())


def add_spheres(scene: Any, nanoseconds: int, name: str, centres: Array, radii: Array, colour: Colour) -> None:
    """Adds spheres in the world: centres (n, 3) and radii (n,), m."""
    entity = _entity(scene, nanoseconds, name, WORLD)
    for centre, radius in zip(centres, radii, strict=True):
        ball = entity.spheres.add()
        _no_pose(ball.pose)
        _point(ball.pose.position, centre)
        _point(ball.size, np.full(3, 2.0 * radius))
        _paint(ball.color, colour)


def point_cloud(nanoseconds: int, frame: str, points: Array) -> Any:
    """`foxglove.PointCloud` of points (n, 3) in a frame, m."""
    found = message("PointCloud")(frame_id=frame, point_stride=12, data=points.astype("<f4").tobytes())
    _stamp(found.timestamp, nanoseconds)
    _no_pose(found.pose)
    for i, name in enumerate("xyz"):
        found.fields.add(name=name, offset=4 * i, type=FLOAT32)
    return found


def image(nanoseconds: int, frame: str, pixels: npt.NDArray[np.uint8]) -> Any:
    """`foxglove.CompressedImage`, a JPEG of pixels (height, width, 3)."""
    picture, data = require("PIL.Image", "logs").fromarray(pixels), io.BytesIO()
    picture.save(data, "JPEG", quality=JPEG_QUALITY)
    found = message("CompressedImage")(frame_id=frame, data=data.getvalue(), format="jpeg")
    _stamp(found.timestamp, nanoseconds)
    return found


def raw_image(nanoseconds: int, frame: str, pixels: npt.NDArray[Any]) -> Any:
    """`foxglove.RawImage` of one channel (height, width): labels of uint8, or depths of float32, m."""
    height, width = pixels.shape
    encoding = "mono8" if pixels.dtype == np.uint8 else "32FC1"
    data = pixels.astype(pixels.dtype.newbyteorder("<")).tobytes()
    step = width * pixels.dtype.itemsize
    found = message("RawImage")(frame_id=frame, width=width, height=height, encoding=encoding, step=step, data=data)
    _stamp(found.timestamp, nanoseconds)
    return found


def calibration(nanoseconds: int, frame: str, camera: Camera) -> Any:
    """`foxglove.CameraCalibration` of a camera; whole pixel numbers are the pixels' centres."""
    f, x, y = camera.focal_length, 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)
    found = message("CameraCalibration")(
        frame_id=frame,
        width=camera.width,
        height=camera.height,
        distortion_model="kannala_brandt" if camera.fisheye else "plumb_bob",
        D=[*camera.distortion, 0.0, 0.0] + [0.0] * (not camera.fisheye),
        K=[f, 0.0, x, 0.0, f, y, 0.0, 0.0, 1.0],
        R=np.eye(3).ravel().tolist(),
        P=[f, 0.0, x, 0.0, 0.0, f, y, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
    _stamp(found.timestamp, nanoseconds)
    return found


def imu(nanoseconds: int, frame: str, rotation: Array, angular_velocity: Array, acceleration: Array) -> bytes:
    """`sensor_msgs/msg/Imu` in CDR.

    Args:
        nanoseconds: Time.
        frame: The frame of the two vectors.
        rotation: From that frame to the map, (3, 3).
        angular_velocity: rad/s, (3,).
        acceleration: Reading of an accelerometer: acceleration minus gravity, m/s², (3,).
    """
    w, x, y, z = quaternions(rotation)
    name = frame.encode() + b"\0"
    seconds, rest = divmod(nanoseconds, 10**9)
    head = struct.pack("<iII", seconds, rest, len(name)) + name
    head += bytes(-len(head) % 8)  # doubles stand at multiples of 8 after the four bytes that name the encoding
    unknown = [0.0] * 9  # a covariance of zeros: not known
    values = [x, y, z, w, *unknown, *angular_velocity, *unknown, *acceleration, *unknown]
    return b"\0\1\0\0" + head + struct.pack(f"<{len(values)}d", *values)


def _entity(scene: Any, nanoseconds: int, name: str, frame: str) -> Any:
    entity = scene.entities.add(id=name, frame_id=frame, frame_locked=True)
    _stamp(entity.timestamp, nanoseconds)
    return entity


def _stamp(timestamp: Any, nanoseconds: int) -> None:
    timestamp.seconds, timestamp.nanos = divmod(nanoseconds, 10**9)


def _point(place: Any, values: Array) -> None:
    place.x, place.y, place.z = (float(value) for value in values)


def _no_pose(pose: Any) -> None:
    pose.orientation.w = 1.0
    _point(pose.position, np.zeros(3))


def _paint(place: Any, colour: Colour) -> None:
    place.r, place.g, place.b = colour
    place.a = 1.0


#: Largest number of bytes lost if the process is killed.
CHUNK = 1 << 16


class McapFile:
    """Writes messages to topics. The file has no index until it is closed.

    Args:
        path: The file to create, with its folder. An existing file is replaced when this one is closed, unless it is
            being written.

    Raises:
        RecordingError: The file is in use.
        OSError: The file cannot be created.
        MissingExtraError: mcap is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        writing = require("mcap.writer", "logs")
        self._register = require("mcap_protobuf.schema", "logs").register_schema
        self.path = file_path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._disk = SteadyFile(self.path)
        except FileInUseError:
            refuse(RecordingError, "path", str(self.path), "is in use by another writer")
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from error
        self._release = weakref.finalize(self, self._disk.close)
        self._process = os.getpid()
        self._writer: Any = writing.Writer(self._disk, chunk_size=CHUNK)
        self._end = _end_of_file()
        self._channels: dict[str, tuple[int, str]] = {}
        self._committed = self._written = self._n_safe = 0
        self._tried(self._start)

    @property
    def is_open(self) -> bool:
        """Whether the file accepts messages."""
        return bool(self._release.alive)

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Registers a schema and returns its number."""
        number: int = self._writer.register_schema(name, encoding, data)
        return number

    def write(self, topic: str, nanoseconds: int, message: Any) -> None:
        """Writes a protobuf message.

        Raises:
            RecordingError: The topic has messages of another type, or the file is closed or cannot be written; it is
                then closed.
        """
        self._must_be_open()
        name = message.DESCRIPTOR.full_name
        if topic not in self._channels:
            self.add_channel(topic, name, "protobuf", self._register(self._writer, type(message)))
        self._add(topic, name, nanoseconds, message.SerializeToString())

    def add_channel(self, topic: str, name: str, encoding: str, schema: int) -> None:
        """Opens a topic for messages of a schema; `encoding` is the messages' encoding.

        Raises:
            RecordingError: The topic is already open, or the file is closed.
        """
        self._must_be_open()
        if topic in self._channels:
            refuse(RecordingError, "topic", topic, "is already open")
        self._channels[topic] = (self._writer.register_channel(topic, encoding, schema), name)

    def write_bytes(self, topic: str, nanoseconds: int, data: bytes) -> None:
        """Writes an encoded message on a topic that `add_channel` opened.

        Raises:
            RecordingError: The topic is not open, or the file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        if topic not in self._channels:
            refuse(RecordingError, "topic", topic, "is not open")
        self._add(topic, self._channels[topic][1], nanoseconds, data)

    def describe(self, name: str, facts: Mapping[str, str]) -> None:
        """Writes texts about the file.

        Raises:
            RecordingError: The file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        self._tried(lambda: self._writer.add_metadata(name, dict(facts)))

    def flush(self) -> None:
        """Writes all messages to the disk.

        Raises:
            RecordingError: The file is closed or cannot be written; it is then closed.
        """
        self._must_be_open()
        self._tried(self._writer.flush)

    def close(self) -> None:
        """Writes the remaining messages and the index. A second call does nothing.

        Raises:
            RecordingError: The disk is full; committed messages stay readable.
        """
        if self.is_open:
            self._must_be_open()
            self._tried(self._finish)
            self._disk.is_worth = True
            self._release()

    def discard(self) -> None:
        """Ends the file and removes it; an older one stays."""
        self._release.detach()
        self._disk.discard()

    def _start(self) -> None:
        self._writer.start(library="rover-gym")

    def _finish(self) -> None:
        self._writer.finish()
        self._disk.truncate()
        self._disk.commit()
        self._committed = self._disk.tell()

    def _add(self, topic: str, name: str, nanoseconds: int, data: bytes) -> None:
        channel, known = self._channels[topic]
        if name != known:
            refuse(RecordingError, "topic", topic, f"has messages of type {known}, not {name}")
        if not 0 <= nanoseconds < 1 << 64:
            refuse(RecordingError, "time", nanoseconds / 1e9, "must be from 0 to 1.8e10 s")
        self._written += 1
        self._tried(lambda: self._writer.add_message(channel, nanoseconds, data, nanoseconds))

    def _tried(self, write: Any) -> None:
        """Writes a message and commits full chunks."""
        try:
            write()
            place = self._disk.tell()
            if place > self._committed:
                self._disk.write(self._end)
                self._disk.truncate()
                self._disk.commit()
                self._disk.seek(place)
                self._committed, self._n_safe = place, self._written
                self._disk.is_worth |= self._n_safe > 0
        except OSError as error:
            replaces = self._disk.replaces
            self._release.detach()
            self._disk.give_up()
            kept = "the earlier file is as it was" if replaces else f"{self._n_safe} messages are on the disk"
            stopped = RecordingError(f"{self.path}: the recording stopped: {error.strerror or str(error)}; {kept}")
            stopped.field, stopped.value = "path", str(self.path)
            raise stopped from error

    def _must_be_open(self) -> None:
        if not self.is_open:
            refuse(RecordingError, "writer", str(self.path), "is closed, so nothing more can be written")
        if os.getpid() != self._process:
            refuse(RecordingError, "writer", str(self.path), "belongs to the process that opened it")


def _end_of_file() -> bytes:
    """The records that end a file without an index."""
    records, building = require("mcap.records", "logs"), require("mcap.data_stream", "logs")
    builder = building.RecordBuilder()
    records.DataEnd(0).write(builder)
    records.Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    ending: bytes = builder.end() + require("mcap.writer", "logs").MCAP0_MAGIC
    return ending
