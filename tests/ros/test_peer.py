"""A node of ROS 2 itself lists the topics, drives the rover, reads odometry and images, and calls its services."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

import rover_gym

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

#: The virtual environment of ROS's own packages, beside that of the tests as `make ros-peer` makes it.
PEER = Path(os.environ.get("ROVER_GYM_ROS", f"{sys.prefix}-ros")) / "bin" / "python"
PROGRAM = Path(__file__).parent / "peer.py"
RUN = "from rover_gym.cli import main; main()"
PACKAGE = Path(rover_gym.__file__).parent.parent
#: Packages that rclpy's environment lacks.
OURS = os.pathsep.join(map(str, (PACKAGE, *(path for path in sys.path if path.endswith("site-packages")))))
#: Only this machine, and a domain of each test's own.
LOCAL = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "PYTHONPATH": OURS}
DEPTH = '{"DepthCamera": {"rate": 10.0}}'
NODE = ["ros", "--rate", "100", "--sensor", "imu", "--sensor", '{"LaserScanner": {"rate": 10.0}}', "--sensor", DEPTH]

needs_peer = pytest.mark.skipif(not PEER.exists(), reason=f"{PEER} is not there: make ros-peer")


@contextmanager
def node(middleware: str, domain: int, *options: str) -> Iterator[dict[str, str]]:
    """A rover as a node of its own process; gives the environment of its peers."""
    environment = os.environ | LOCAL | {"ROS_DOMAIN_ID": str(domain)}
    python = str(PEER) if middleware == "rclpy" else sys.executable
    command = [python, "-c", RUN, *NODE, "--middleware", middleware, *options]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = process.stdout.readline()
        assert line == "ros: node /rover, a step every 0.01 s (Ctrl-C ends it)\n", process.stderr.read()
        yield {name: value for name, value in environment.items() if name != "PYTHONPATH"}
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30.0)
        assert process.returncode == 0, errors
    finally:
        process.kill()
        process.wait()


def heard(environment: dict[str, str], seconds: float, *options: str) -> dict[str, Any]:
    """What the peer reports."""
    done = subprocess.run(
        [str(PEER), str(PROGRAM), str(seconds), *options],
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds + 120.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def check(found: dict[str, Any]) -> None:
    """Checks what must be true however long the peer drives."""
    assert "/rover" in found["nodes"]
    assert found["topics"]["/tf"] == ["tf2_msgs/msg/TFMessage"]
    assert found["topics"]["/wheels/FL/wrench"] == ["geometry_msgs/msg/WrenchStamped"]
    assert found["services"]["/rover/reset"] == ["std_srvs/srv/Trigger"]
    for topic in ("/odom", "/ground_truth/odom", "/joint_states"):
        assert found["heard"][topic]["n"] > 20
        assert found["heard"][topic]["missing"] == 0, topic
    for topic in ("/clock", "/imu/data", "/scan", "/depth/image_raw", "/depth/camera_info", "/depth/points"):
        assert found["heard"][topic]["n"] > 0, topic
    assert found["truth"] == pytest.approx([0.4, 0.1], abs=0.05)
    assert found["odom"] == pytest.approx([0.4, 0.1], abs=0.05)
    encoding, nearest, size = found["depth"]
    assert (encoding, size) == ("32FC1", 64 * 48)
    assert 0.1 < nearest < 5.0
    assert found["description"] == "<robot"


LONG = pytest.mark.takes_long("two processes that import NumPy and one that simulates, over the network")


#: Prints the parameters of nodes as ROS reads them from a file.
PARAMETERS = """
import json, sys, rclpy
from rclpy.node import Node
rclpy.init(args=["--ros-args", "--params-file", sys.argv[1]])
for name, namespace in json.loads(sys.argv[2]):
    node = Node(name, namespace=namespace, automatically_declare_parameters_from_overrides=True)
    print(json.dumps({key: one.value for key, one in node.get_parameters_by_prefix("").items()}))
"""


@needs_peer
@LONG
def test_ros_reads_the_parameters_of_nav2() -> None:
    file = PROGRAM.parents[2] / "docs" / "ros" / "nav2.yaml"
    written = yaml.safe_load(file.read_text(encoding="utf-8"))
    nodes = [(name, name if name in part else "") for name, part in written.items()]
    command = [str(PEER), "-c", PARAMETERS, str(file), json.dumps(nodes)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for line, (name, part) in zip(done.stdout.splitlines(), written.items(), strict=True):
        own, read = part.get(name, part)["ros__parameters"], json.loads(line)
        assert read.items() >= dict(flat(own)).items()
        for kind in ("planner", "controller", "goal_checker", "progress_checker", "behavior", ""):
            for plugin in own.get(f"{kind}_plugins".lstrip("_"), []):
                assert "::" in read[f"{plugin}.plugin"]


def flat(tree: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """The leaves of a tree by their names with dots."""
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{above}{name}.")
        else:
            yield above + name, value


@needs_peer
@LONG
def test_a_node_of_ros_drives_the_rover_over_cyclone_dds() -> None:
    with node("cyclonedds", 61) as environment:
        check(heard(environment, 4.0))


@needs_peer
@LONG
def test_a_node_of_ros_calls_the_services_of_rclpy() -> None:
    """Over Fast DDS, the default of ROS, whose clients the package `cyclonedds` cannot answer."""
    with node("rclpy", 62) as environment:
        found = heard(environment, 4.0, "--services")
    answers = found["answers"]
    assert answers["parameters"][0] == [True, ""]
    assert answers["parameters"][1][0] is False
    assert "difficulty" in answers["parameters"][1][1]
    assert answers["reset"] == [True, "seed 5, difficulty 0.5"]
    assert all(answers[name][0] for name in ("pause", "step", "snapshot", "restore", "run"))
    assert found["heard"]["/odom"]["missing"] == 0
    assert found["truth"] == pytest.approx([0.4, 0.1], abs=0.05)


@needs_peer
@pytest.mark.nightly("tests/ros/test_peer.py::test_a_node_of_ros_drives_the_rover_over_cyclone_dds")
@pytest.mark.timeout(1200)
def test_nothing_is_lost_in_ten_minutes() -> None:
    with node("cyclonedds", 63) as environment:
        found = heard(environment, 600.0)
    check(found)
    print({topic: found["heard"][topic] for topic in ("/odom", "/joint_states", "/imu/data", "/scan")})  # noqa: T201
