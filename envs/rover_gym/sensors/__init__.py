"""Simulated sensors of the rover, as observations for policies and other programs (`docs/sensors.md`)."""

import importlib
import warnings

from rover_gym.sensors.camera import Camera
from rover_gym.sensors.colour_camera import ColourCamera
from rover_gym.sensors.depth_camera import DepthCamera, LaserScanner
from rover_gym.sensors.inertial_unit import InertialUnit
from rover_gym.sensors.sensor import Mount, Sensor
from rover_gym.sensors.sensor_suite import (
    SensorObservation,
    SensorSuite,
    make_grains_rover,
    make_rover,
)
from rover_gym.sensors.wheel_encoders import HeadingSensor, MotorSensors, WheelEncoders

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

#: Names that have moved to `rover_gym.vector`.
_MOVED = ("RoverGrainsVectorEnv", "SensorVectorObservation", "make_grains_vector", "make_rover_vector")


def __getattr__(name: str) -> object:
    if name not in _MOVED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    where = "rover_gym.vector"
    warnings.warn(f"{name} is removed in 0.3; use {where}.{name}", DeprecationWarning, stacklevel=2)
    return getattr(importlib.import_module(where), name)
