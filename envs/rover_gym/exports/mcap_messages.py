"""The messages of an MCAP log, in Foxglove's schemas; the IMU's in that of ROS 2, which Foxglove has none for.

The simulator's world has y up. The frame `map` has z up, as viewers expect; `world` stands in it, and the solids in
`world`.
"""

from __future__ import annotations

import io
import struct
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.exports.axes import MAP_FROM_WORLD
from rover_gym.extras import MissingExtraError, require
from rover_gym.replay.rotation import quaternions

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rover_gym.rendering.appearance import Colour

Array = npt.NDArray[np.float64]

MAP, WORLD = "map", "world"
#: R_BS: from the axes of a solid as logged (REP 103: x forward, y left, z up) to its own (x forward, y up, z right).
SOLID_FROM_LOGGED = MAP_FROM_WORLD.T
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


def imu(nanoseconds: int, frame: str, rotation: Array, angular_velocity: Array, acceleration: Array) -> bytes:
    """`sensor_msgs/msg/Imu` in CDR.

    Args:
        nanoseconds: Time.
        frame: The frame of the two vectors.
        rotation: From that frame to the map, (3, 3).
        angular_velocity: rad/s, (3,).
        acceleration: What an accelerometer feels: acceleration less gravity, m/s², (3,).
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
