"""ROS 2 messages in CDR, by the definitions of the package `rosbags`; vectors and poses in the axes of REP 103."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.extras import require
from rover_gym.core.rotations import quaternions

Array = npt.NDArray[np.float64]

#: An entry of a diagonal covariance that says "do not use this"; what consumers of odometry expect.
UNKNOWN = 1e6

#: Requests and answers of the services, which `rosbags` does not define; of std_srvs and rcl_interfaces.
SERVICES = {
    "std_srvs/srv/Trigger": ("uint8 structure_needs_at_least_one_member", "bool success\nstring message"),
    "std_srvs/srv/SetBool": ("bool data", "bool success\nstring message"),
    "rcl_interfaces/srv/ListParameters": (
        "string[] prefixes\nuint64 depth",
        "rcl_interfaces/ListParametersResult result",
    ),
    "rcl_interfaces/srv/GetParameters": ("string[] names", "rcl_interfaces/ParameterValue[] values"),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
    "rcl_interfaces/srv/DescribeParameters": (
        "string[] names",
        "rcl_interfaces/ParameterDescriptor[] descriptors",
    ),
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult[] results",
    ),
}


@cache
def definitions() -> Any:
    """The definitions of all messages, a typestore of `rosbags`.

    Raises:
        MissingExtraError: rosbags is not installed.
    """
    typesys = require("rosbags.typesys", "ros")
    return typesys.get_typestore(typesys.Stores.ROS2_KILTED)


def make(kind: str, **fields: Any) -> Any:
    """A message of a type, such as "std_msgs/msg/Header"."""
    return definitions().types[kind](**fields)


def encode(message: Any) -> bytes:
    """A message in CDR, little endian, with its four bytes of encapsulation."""
    return bytes(definitions().serialize_cdr(message, message.__msgtype__))


def decode(data: bytes, kind: str) -> Any:
    """The message of a type that CDR bytes hold.

    Raises:
        Exception: The bytes are no such message.
    """
    return definitions().deserialize_cdr(data, kind)


def time_of(nanoseconds: int) -> Any:
    """`builtin_interfaces/msg/Time`."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)


def header(nanoseconds: int, frame: str) -> Any:
    """`std_msgs/msg/Header`."""
    return make("std_msgs/msg/Header", stamp=time_of(nanoseconds), frame_id=frame)


def vector(values: Sequence[float] | Array) -> Any:
    """`geometry_msgs/msg/Vector3`."""
    x, y, z = (float(value) for value in values)
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def point(values: Sequence[float] | Array) -> Any:
    """`geometry_msgs/msg/Point`."""
    x, y, z = (float(value) for value in values)
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def turn(wxyz: Array) -> Any:
    """`geometry_msgs/msg/Quaternion` of w, x, y, z."""
    w, x, y, z = (float(value) for value in wxyz)
    return make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def rotation(matrix: Array) -> Any:
    """`geometry_msgs/msg/Quaternion` of a rotation matrix (3, 3)."""
    return turn(quaternions(matrix))


def pose(place: Array, matrix: Array) -> Any:
    """`geometry_msgs/msg/Pose`."""
    return make("geometry_msgs/msg/Pose", position=point(place), orientation=rotation(matrix))


def twist(linear: Sequence[float] | Array, angular: Sequence[float] | Array) -> Any:
    """`geometry_msgs/msg/Twist`."""
    return make("geometry_msgs/msg/Twist", linear=vector(linear), angular=vector(angular))


def transforms(nanoseconds: int, pairs: Sequence[tuple[str, str]], places: Array, matrices: Array) -> Any:
    """`tf2_msgs/msg/TFMessage` of (parent, child) frames, origins (n, 3), m, and rotations (n, 3, 3)."""
    found = [
        make(
            "geometry_msgs/msg/TransformStamped",
            header=header(nanoseconds, parent),
            child_frame_id=child,
            transform=make("geometry_msgs/msg/Transform", translation=vector(place), rotation=turn(wxyz)),
        )
        for (parent, child), place, wxyz in zip(pairs, places, quaternions(matrices), strict=True)
    ]
    return make("tf2_msgs/msg/TFMessage", transforms=found)


def odometry(
    nanoseconds: int,
    frames: tuple[str, str],
    place: Array,
    matrix: Array,
    velocity: Array,
    variances: tuple[Sequence[float], Sequence[float]],
) -> Any:
    """`nav_msgs/msg/Odometry`.

    Args:
        nanoseconds: Time.
        frames: The frame of the pose, and the child, in which the velocity is.
        place: (3,), m.
        matrix: From the child to the frame, (3, 3).
        velocity: Linear, m/s, then angular, rad/s, (6,).
        variances: Diagonals (6,) of the covariances of pose and velocity.
    """
    parent, child = frames
    of_pose, of_twist = (np.diag(np.asarray(diagonal, dtype=np.float64)).ravel() for diagonal in variances)
    return make(
        "nav_msgs/msg/Odometry",
        header=header(nanoseconds, parent),
        child_frame_id=child,
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose(place, matrix), covariance=of_pose),
        twist=make(
            "geometry_msgs/msg/TwistWithCovariance", twist=twist(velocity[:3], velocity[3:]), covariance=of_twist
        ),
    )


def joint_state(nanoseconds: int, names: Sequence[str], angles: Array, rates: Array, efforts: Array) -> Any:
    """`sensor_msgs/msg/JointState`: rad or m, rad/s or m/s, N m or N."""
    return make(
        "sensor_msgs/msg/JointState",
        header=header(nanoseconds, ""),
        name=list(names),
        position=np.asarray(angles, dtype=np.float64),
        velocity=np.asarray(rates, dtype=np.float64),
        effort=np.asarray(efforts, dtype=np.float64),
    )


def imu(nanoseconds: int, frame: str, reading: Array, variances: tuple[float, float], attitude: Array | None) -> Any:
    """`sensor_msgs/msg/Imu`.

    Args:
        nanoseconds: Time.
        frame: The frame of the reading.
        reading: Specific force, m/s², and angular velocity, rad/s, (6,).
        variances: Of the two.
        attitude: From the frame to the map, (3, 3); None where it is not measured (REP 145).
    """
    unknown = np.zeros(9)
    unknown[0] = -1.0
    force, rate = (np.eye(3).ravel() * variance for variance in variances)
    return make(
        "sensor_msgs/msg/Imu",
        header=header(nanoseconds, frame),
        orientation=rotation(np.eye(3) if attitude is None else attitude),
        orientation_covariance=unknown if attitude is None else np.zeros(9),
        angular_velocity=vector(reading[3:]),
        angular_velocity_covariance=rate,
        linear_acceleration=vector(reading[:3]),
        linear_acceleration_covariance=force,
    )


def image(nanoseconds: int, frame: str, picture: npt.NDArray[Any], encoding: str) -> Any:
    """`sensor_msgs/msg/Image` of (height, width) or (height, width, channels)."""
    rows = np.ascontiguousarray(picture)
    return make(
        "sensor_msgs/msg/Image",
        header=header(nanoseconds, frame),
        height=rows.shape[0],
        width=rows.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=rows.strides[0],
        data=rows.reshape(-1).view(np.uint8),
    )


def camera_info(nanoseconds: int, frame: str, size: tuple[int, int], focal: float) -> Any:
    """`sensor_msgs/msg/CameraInfo` of a pinhole camera without distortion.

    Args:
        nanoseconds: Time.
        frame: The optical frame.
        size: Width and height, pixels.
        focal: Focal length, pixels.
    """
    width, height = size
    x, y = 0.5 * (width - 1), 0.5 * (height - 1)
    intrinsic = np.array([focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0])
    projection = np.insert(intrinsic, [3, 6, 9], 0.0)
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header(nanoseconds, frame),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=intrinsic,
        r=np.eye(3).ravel(),
        p=projection,
        binning_x=0,
        binning_y=0,
        roi=make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def laser_scan(
    nanoseconds: int, frame: str, angles: tuple[float, float], reach: tuple[float, float], ranges: Array
) -> Any:
    """`sensor_msgs/msg/LaserScan` of one ring, all rays at one time.

    Args:
        nanoseconds: Time.
        frame: The scanner's frame.
        angles: Of the first ray and from ray to ray, rad, positive to the left.
        reach: Least and greatest range, m.
        ranges: (rays,), m.
    """
    first, step = angles
    return make(
        "sensor_msgs/msg/LaserScan",
        header=header(nanoseconds, frame),
        angle_min=first,
        angle_max=first + step * (len(ranges) - 1),
        angle_increment=step,
        time_increment=0.0,
        scan_time=0.0,
        range_min=reach[0],
        range_max=reach[1],
        ranges=np.asarray(ranges, dtype=np.float32),
        intensities=np.zeros(0, np.float32),
    )


def point_cloud(nanoseconds: int, frame: str, points: Array) -> Any:
    """`sensor_msgs/msg/PointCloud2` of points (n, 3), m."""
    data = np.ascontiguousarray(points, dtype="<f4")
    fields = [
        make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=7, count=1)  # 7: FLOAT32
        for i, name in enumerate("xyz")
    ]
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header(nanoseconds, frame),
        height=1,
        width=len(data),
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * len(data),
        data=data.reshape(-1).view(np.uint8),
        is_dense=True,
    )


def wrench(nanoseconds: int, frame: str, force: Array, moment: Array) -> Any:
    """`geometry_msgs/msg/WrenchStamped` in a frame, about its origin, N and N m."""
    return make(
        "geometry_msgs/msg/WrenchStamped",
        header=header(nanoseconds, frame),
        wrench=make("geometry_msgs/msg/Wrench", force=vector(force), torque=vector(moment)),
    )
