"""The topics of sensors: each reading as the messages of its kind of sensor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.envs.sensors import Camera, DepthCamera, InertialUnit, LaserScanner, Sensor
from rover_gym.ros import messages, rover_frames as frames
from rover_gym.ros.transport import SENSOR

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rover_gym.ros.transport import Publish, Transport

Array = npt.NDArray[np.float64]

#: Topics of each kind of sensor, below its name, and their types.
IMU_TOPICS = {"data": "sensor_msgs/msg/Imu", "data_raw": "sensor_msgs/msg/Imu"}
CAMERA_TOPICS = {"image_raw": "sensor_msgs/msg/Image", "camera_info": "sensor_msgs/msg/CameraInfo"}
POINTS = {"points": "sensor_msgs/msg/PointCloud2"}
SCAN = {"": "sensor_msgs/msg/LaserScan"}


def topics_of(sensor: Sensor) -> dict[str, str]:
    """The topics of a sensor below its name, and their types.

    Raises:
        OptionError: ROS has no message for this kind of sensor.
    """
    if isinstance(sensor, InertialUnit):
        return IMU_TOPICS
    if isinstance(sensor, LaserScanner):
        return (SCAN if len(sensor.elevations_deg) == 1 else {}) | POINTS
    if isinstance(sensor, Camera):
        measures = isinstance(sensor, DepthCamera) and sensor.image is None
        return CAMERA_TOPICS | (POINTS if measures else {})
    return refuse(OptionError, "sensors", sensor, "has no ROS message; inertial units, scanners and cameras have")


class SensorTopics:
    """Publishes the readings of a sensor.

    Args:
        transport: Of the node.
        sensor: The sensor.
        prefix: Of the topics, such as "/rover".
    """

    def __init__(self, transport: Transport, sensor: Sensor, prefix: str) -> None:
        self.sensor = sensor
        base = f"{prefix}/{sensor.name}"
        self._publish: dict[str, Publish] = {
            topic: transport.publisher(f"{base}/{topic}".rstrip("/"), kind, SENSOR)
            for topic, kind in topics_of(sensor).items()
        }

    def publish(self, reading: npt.NDArray[Any], nanoseconds: int, attitude: Array, interval: float) -> None:
        """Publishes a reading.

        Args:
            reading: As the sensor gives it.
            nanoseconds: When it was taken.
            attitude: From the sensor's frame to the map, (3, 3), where it is an inertial unit.
            interval: Since the reading before, s.
        """
        for topic, message in _messages(self.sensor, reading, nanoseconds, attitude, interval):
            if topic in self._publish:
                self._publish[topic](messages.encode(message))


def _messages(
    sensor: Sensor, reading: npt.NDArray[Any], stamp: int, attitude: Array, interval: float
) -> Iterator[tuple[str, Any]]:
    link = frames.link_name(sensor)
    if isinstance(sensor, InertialUnit):
        felt = frames.ros_vector(reading.reshape(2, 3)).ravel()
        noises = (sensor.accelerometer_noise, sensor.gyroscope_noise)
        variances = (noises[0] ** 2 / interval, noises[1] ** 2 / interval)
        yield "data_raw", messages.imu(stamp, link, felt, variances, None)
        yield "data", messages.imu(stamp, link, felt, variances, attitude)
    elif isinstance(sensor, LaserScanner):
        ranges = ros_ranges(reading, sensor.max_range)
        begin = math.radians(sensor.begin_deg)
        step = (math.radians(sensor.end_deg) - begin) / sensor.rays
        reach = (sensor.min_range, sensor.max_range)
        if len(ranges) == 1:
            yield "", messages.laser_scan(stamp, link, (begin, step), reach, ranges[0])
        yield "points", messages.point_cloud(stamp, link, _points(ranges, sensor.directions))
    elif isinstance(sensor, Camera):
        yield from _camera_messages(sensor, reading, stamp)


def _camera_messages(sensor: Camera, reading: npt.NDArray[Any], stamp: int) -> Iterator[tuple[str, Any]]:
    optical = frames.optical_name(sensor)
    picture, encoding = ros_picture(sensor, reading)
    yield "image_raw", messages.image(stamp, optical, picture, encoding)
    focal = 0.5 * sensor.width / math.tan(0.5 * math.radians(sensor.view_deg))
    yield "camera_info", messages.camera_info(stamp, optical, (sensor.width, sensor.height), focal)
    if encoding == "32FC1":
        points = _points(picture, sensor.directions) @ frames.LINK_FROM_OPTICAL
        yield "points", messages.point_cloud(stamp, optical, points)


def ros_ranges(reading: npt.NDArray[Any], max_range: float) -> npt.NDArray[np.float32]:
    """Distances with infinity where there is nothing, and nan where nothing was measured (REP 117, REP 118)."""
    found = reading.astype(np.float32)
    found[found >= np.float32(max_range)] = np.inf
    found[found == 0.0] = np.nan
    return found


def ros_picture(sensor: Camera, reading: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], str]:
    """An image as ROS has it, and its encoding: depths in m, or grey or colours of 8 bits."""
    if isinstance(sensor, DepthCamera) and sensor.image is None:
        return ros_ranges(reading, sensor.max_range), "32FC1"
    if sensor.image == "channels_first":
        reading = np.moveaxis(reading, 0, -1)
    levels = reading if sensor.image == "uint8" else np.rint(255.0 * reading)
    return levels.astype(np.uint8), "rgb8" if reading.shape[-1] == 3 else "mono8"


def _points(distances: npt.NDArray[Any], directions: Array) -> Array:
    """(n, 3) hits in the sensor's frame, in the axes of REP 103, m."""
    seen = np.isfinite(distances)
    found: Array = frames.ros_vector(distances[seen][:, None] * directions[seen])
    return found
