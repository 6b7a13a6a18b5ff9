from .camera import Camera as Camera
from .colour_camera import ColourCamera as ColourCamera
from .depth_camera import DepthCamera as DepthCamera, LaserScanner as LaserScanner
from .inertial_unit import InertialUnit as InertialUnit
from .segmentation_camera import SegmentationCamera as SegmentationCamera
from .sensor import Mount as Mount, Sensor as Sensor
from .sensor_suite import (
    SensorObservation as SensorObservation,
    SensorSuite as SensorSuite,
    make_grains_rover as make_grains_rover,
    make_rover as make_rover,
)
from .wheel_encoders import HeadingSensor as HeadingSensor, MotorSensors as MotorSensors, WheelEncoders as WheelEncoders
