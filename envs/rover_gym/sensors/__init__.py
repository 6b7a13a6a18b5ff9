"""Simulated sensors of the rover, as observations for policies and other programs (`docs/sensors.md`)."""

from rover_gym.sensors.depth_camera import DepthCamera, LaserScanner
from rover_gym.sensors.inertial_unit import InertialUnit
from rover_gym.sensors.sensor import Mount, Sensor
from rover_gym.sensors.sensor_suite import (
    RoverCourseVectorEnv,
    RoverGrainsVectorEnv,
    SensorObservation,
    SensorSuite,
    SensorVectorObservation,
    make_course_vector,
    make_grains_rover,
    make_grains_vector,
    make_rover,
    make_rover_vector,
)
from rover_gym.sensors.wheel_encoders import HeadingSensor, MotorSensors, WheelEncoders

__all__ = [
    "DepthCamera",
    "HeadingSensor",
    "InertialUnit",
    "LaserScanner",
    "MotorSensors",
    "Mount",
    "RoverCourseVectorEnv",
    "RoverGrainsVectorEnv",
    "Sensor",
    "SensorObservation",
    "SensorSuite",
    "SensorVectorObservation",
    "WheelEncoders",
    "make_course_vector",
    "make_grains_rover",
    "make_grains_vector",
    "make_rover",
    "make_rover_vector",
]
