from .camera import Camera
from .colour_camera import ColourCamera
from .depth_camera import DepthCamera, LaserScanner
from .inertial_unit import InertialUnit
from .sensor import Mount, Sensor
from .sensor_suite import SensorObservation, SensorSuite, make_grains_rover, make_rover
from .wheel_encoders import HeadingSensor, MotorSensors, WheelEncoders

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
