"""Simulated sensors of the rover, as observations for policies and other programs (`docs/sensors.md`)."""

from rover_gym.envs.sensors.camera import Camera
from rover_gym.envs.sensors.colour_camera import ColourCamera
from rover_gym.envs.sensors.depth_camera import DepthCamera, LaserScanner
from rover_gym.envs.sensors.inertial_unit import InertialUnit
from rover_gym.envs.sensors.sensor import Mount, Sensor
from rover_gym.envs.sensors.sensor_suite import (
    SensorObservation,
    SensorSuite,
    make_grains_rover,
    make_rover,
)
from rover_gym.envs.sensors.wheel_encoders import HeadingSensor, MotorSensors, WheelEncoders

__all__ = [
    "Camera",
    "ColourCamera",
    "DepthCamera",
    "HeadingSensor",
    "InertialUnit",
    "LaserScanner",
    "MotorSensors",
    "Mount",
    "Sensor",
    "SensorObservation",
    "SensorSuite",
    "WheelEncoders",
    "make_grains_rover",
    "make_rover",
]
