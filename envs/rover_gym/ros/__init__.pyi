from .bag import BagTransport as BagTransport
from .cyclone_transport import CycloneTransport as CycloneTransport
from .middleware import open_transport as open_transport
from .node import NodeOptions as NodeOptions, RosNode as RosNode
from .node_rovers import DrivenRover as DrivenRover, NodeRover as NodeRover, RecordedRover as RecordedRover
from .odometry import WheelOdometry as WheelOdometry
from .rclpy_transport import RclpyTransport as RclpyTransport
from .transport import Delivery as Delivery, Transport as Transport
