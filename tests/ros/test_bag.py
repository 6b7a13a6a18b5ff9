"""Recordings of a node: `rosbags` and `mcap-ros2-support` read every message of every topic."""

from pathlib import Path

import numpy as np
import pytest
from commands import error_of, output_of
from refusals import refused
from ros_nodes import KeptTransport, live_source

from rover_gym import OptionError
from rover_gym.envs.sensors import DepthCamera, InertialUnit
from rover_gym.ros import BagTransport, NodeOptions, RosNode, messages

bags = pytest.importorskip("rosbags.rosbag2")
reading = pytest.importorskip("mcap_ros2.reader")


def test_every_message_is_read_back(tmp_path: Path) -> None:
    kept = KeptTransport()
    transport = BagTransport(kept, tmp_path / "bag")
    options = NodeOptions(pace=0.0, sensors=[InertialUnit(), DepthCamera(width=8, height=6, rate=10.0)])
    node = RosNode(live_source(), transport, options=options)
    node.run(until=0.5)
    node.close()
    n = {topic: len(messages_of) for topic, messages_of in kept.messages.items()}
    found: dict[str, int] = dict.fromkeys(n, 0)
    with bags.Reader(tmp_path / "bag") as bag:
        latched = {
            one.topic for one in bag.connections if "transient_local" in str(one.ext.offered_qos_profiles).lower()
        }
        for connection, _, data in bag.messages():
            messages.decode(bytes(data), connection.msgtype)
            found[connection.topic] += 1
    assert found == n
    assert latched == {"/tf_static", "/robot_description", "/goal"}
    (path,) = (tmp_path / "bag").glob("*.mcap")
    decoded = list(reading.read_ros2_messages(str(path)))
    assert len(decoded) == sum(n.values())
    image = next(one.ros_msg for one in decoded if one.channel.topic == "/depth/image_raw")
    assert np.frombuffer(bytes(image.data), np.float32) == pytest.approx(
        kept.messages["/depth/image_raw"][0].data.view(np.float32), nan_ok=True
    )


def test_a_bag_replaces_none(tmp_path: Path) -> None:
    with refused(OptionError, "bag", "exists already"):
        BagTransport(KeptTransport(), tmp_path)


def test_the_command_refuses_by_one_line() -> None:
    assert "sensor" in error_of("ros", "--sensor", "sonar")
    assert "middleware" in error_of("ros", "--middleware", "carrier pigeon")
    assert "name" in error_of("ros", "--name", "9rover")
    assert "pace" in error_of("ros", "--pace", "-1")
    assert "--middleware" in output_of("ros", "--help")
