"""A node of ROS 2 itself: rclpy over Fast DDS, from wheels. It drives a rover, and prints what it has heard as JSON.

    .venv-ros/bin/python tests/ros/peer.py SECONDS [--services]

It lists topics and nodes, commands a twist twenty times a second, counts the messages of topics and which are missing
between two, and times them. With `--services` it pauses the rover, steps it and resets it first.
"""

import itertools
import json
import sys
import time
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan, PointCloud2
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

RELIABLE = QoSProfile(depth=10_000)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Type and quality of service of each topic that is heard.
HEARD = {
    "/odom": (Odometry, RELIABLE),
    "/ground_truth/odom": (Odometry, RELIABLE),
    "/joint_states": (JointState, RELIABLE),
    "/clock": (Clock, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)),
    "/robot_description": (String, LATCHED),
    "/imu/data": (Imu, qos_profile_sensor_data),
    "/scan": (LaserScan, qos_profile_sensor_data),
    "/depth/image_raw": (Image, qos_profile_sensor_data),
    "/depth/camera_info": (CameraInfo, qos_profile_sensor_data),
    "/depth/points": (PointCloud2, qos_profile_sensor_data),
}
COUNTED = ("/odom", "/ground_truth/odom", "/joint_states")
FORWARD, TURN = 0.4, 0.1


class Heard:
    """The messages of a topic."""

    def __init__(self) -> None:
        self.last: Any = None
        self.stamps: list[int] = []
        self.sent: list[int] = []
        self.received: list[int] = []

    def take(self, message: Any, info: Any) -> None:
        """Notes a message, when it was sent and when it came, ns."""
        self.last = message
        self.sent.append(info["source_timestamp"])
        self.received.append(info["received_timestamp"])
        if hasattr(message, "header"):
            stamp = message.header.stamp
            self.stamps.append(stamp.sec * 10**9 + stamp.nanosec)

    def facts(self) -> dict[str, Any]:
        """Number, missing messages, latency and deviation of the intervals, ms."""
        steps = np.diff(self.stamps)
        period = int(np.median(steps)) if len(steps) else 0
        late = (np.array(self.received) - np.array(self.sent)) / 1e6
        return {
            "n": len(self.received),
            "missing": int(sum(round(step / period) - 1 for step in steps)) if period else 0,
            "latency_ms": [float(x) for x in np.percentile(late, (50, 99, 100))] if len(late) else [],
            "jitter_ms": float(np.std(np.diff(self.received)) / 1e6) if len(late) > 1 else 0.0,
        }


def called(node: Any, kind: Any, name: str, **request: Any) -> Any:
    """Calls a service and waits for its answer."""
    client = node.create_client(kind, name)
    assert client.wait_for_service(10.0), name
    answer = client.call_async(kind.Request(**request))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=20.0)
    return answer.result()


def use_services(node: Any) -> dict[str, Any]:
    """Pauses the rover, steps it, and resets it with another seed."""
    found = {
        "pause": called(node, SetBool, "/rover/pause", data=True),
        "step": called(node, Trigger, "/rover/step"),
        "snapshot": called(node, Trigger, "/rover/snapshot"),
        "restore": called(node, Trigger, "/rover/restore"),
    }
    seed = Parameter(name="seed", value=ParameterValue(type=2, integer_value=5))
    wrong = Parameter(name="difficulty", value=ParameterValue(type=3, double_value=9.0))
    results = called(node, SetParameters, "/rover/set_parameters", parameters=[seed, wrong]).results
    found |= {
        "reset": called(node, Trigger, "/rover/reset"),
        "run": called(node, SetBool, "/rover/pause", data=False),
    }
    answers: dict[str, Any] = {name: [one.success, one.message] for name, one in found.items()}
    return answers | {"parameters": [[one.successful, one.reason] for one in results]}


def main(seconds: float, *, services: bool) -> None:
    """Drives for a time, s."""
    rclpy.init()
    node = rclpy.create_node("peer")
    heard = {topic: Heard() for topic in HEARD}
    for topic, (kind, qos) in HEARD.items():
        node.create_subscription(kind, topic, heard[topic].take, qos)
    commands = node.create_publisher(Twist, "/cmd_vel", 10)
    end = time.monotonic() + 30.0
    while not heard["/odom"].last and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    found: dict[str, Any] = {"answers": use_services(node) if services else {}}
    twist = Twist()
    twist.linear.x, twist.angular.z = FORWARD, TURN
    node.create_timer(0.05, lambda: commands.publish(twist))
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    found["topics"] = dict(node.get_topic_names_and_types())
    found["nodes"] = list(itertools.starmap("{1}{0}".format, node.get_node_names_and_namespaces()))
    found["services"] = dict(node.get_service_names_and_types())
    found["heard"] = {topic: one.facts() for topic, one in heard.items()}
    found |= last_values(heard)
    print(json.dumps(found))  # noqa: T201 - for the test that runs this program


def last_values(heard: dict[str, Heard]) -> dict[str, Any]:
    """Velocities, depths and the description that came last."""
    depth, truth, odom = (heard[topic].last for topic in ("/depth/image_raw", "/ground_truth/odom", "/odom"))
    pixels = np.array(depth.data, np.uint8).view(np.float32) if depth else np.zeros(1)
    return {
        "truth": [truth.twist.twist.linear.x, truth.twist.twist.angular.z],
        "odom": [odom.twist.twist.linear.x, odom.twist.twist.angular.z],
        "place": [odom.pose.pose.position.x, odom.pose.pose.position.y],
        "depth": [depth.encoding if depth else "", float(np.nanmin(pixels)), len(pixels)],
        "description": heard["/robot_description"].last.data[:6] if heard["/robot_description"].last else "",
    }


main(float(sys.argv[1]), services="--services" in sys.argv)
