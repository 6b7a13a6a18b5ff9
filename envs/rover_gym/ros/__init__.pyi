from .bag import BagTransport as BagTransport
from .cyclone_transport import CycloneTransport as CycloneTransport
from .node import NodeOptions as NodeOptions, RosNode as RosNode
from .odometry import WheelOdometry as WheelOdometry
from .rclpy_transport import RclpyTransport as RclpyTransport
from .sources import LiveSource as LiveSource, RecordedSource as RecordedSource, Source as Source
from .transport import Delivery as Delivery, Transport as Transport, open_transport as open_transport
