"""The node without a network: what it publishes, how it drives, and its services."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machines import mecanum
from recordings import recorded
from refusals import refused
from ros_nodes import FREQUENCY, KeptTransport, drive, live_source, node_of
from rovers import standing

from rover_gym import OptionError, Plane, RoverModel
from rover_gym.core.rotations import from_quaternion
from rover_gym.envs.sensors import (
    ColourCamera,
    DepthCamera,
    HeadingSensor,
    InertialUnit,
    LaserScanner,
    Mount,
    WheelEncoders,
)
from rover_gym.ros import NodeOptions, RecordedRover, RosNode, messages, rover_frames as frames
from rover_gym.show.live import LiveScene

pytest.importorskip("rosbags")

MODELS = RoverModel.names()
ROLLERS = "mecanum"


def nanoseconds(stamp: Any) -> int:
    return stamp.sec * 10**9 + stamp.nanosec


def velocity(transport: KeptTransport, topic: str = "/ground_truth/odom") -> tuple[float, float, float]:
    twist = transport.last(topic).twist.twist
    return twist.linear.x, twist.linear.y, twist.angular.z


def node_of_model(model: str) -> tuple[RosNode, KeptTransport]:
    """A node of a rover of the gallery, or of the platform on rollers."""
    return node_of(LiveScene(model=model), models={model: mecanum() if model == ROLLERS else RoverModel.named(model)})


@pytest.mark.parametrize("model", [*MODELS, ROLLERS])
@pytest.mark.parametrize(("forward", "turn"), [(0.2, 0.08), (-0.15, 0.05)])
def test_a_twist_means_the_same_on_every_rover(model: str, forward: float, turn: float) -> None:
    node, transport = node_of_model(model)
    drive(node, transport, 3.0, forward, turn)
    found = velocity(transport)
    assert found[0] == pytest.approx(forward, abs=0.01)
    assert found[2] == pytest.approx(turn, abs=0.01)


@pytest.mark.parametrize(("model", "turns"), [("skid-steered", True), (ROLLERS, True), ("rover", False)])
def test_a_rover_turns_on_the_spot_if_its_wheels_permit(model: str, turns: bool) -> None:
    node, transport = node_of_model(model)
    drive(node, transport, 3.0, 0.0, 0.5)
    forward, _, turn = velocity(transport)
    assert abs(forward) < 0.02
    assert turn == pytest.approx(0.5 if turns else 0.0, abs=0.02)


@pytest.mark.parametrize("model", ["four-steered", ROLLERS])
def test_a_rover_whose_wheels_all_steer_or_have_rollers_moves_sideways(model: str) -> None:
    node, transport = node_of_model(model)
    drive(node, transport, 3.0, 0.4, 0.0, left=0.2)
    assert velocity(transport) == pytest.approx((0.4, 0.2, 0.0), abs=0.01)
    assert velocity(transport, "/odom") == pytest.approx((0.4, 0.2, 0.0), abs=0.01)


def test_a_rover_without_a_command_stands_on_a_slope() -> None:
    node, transport = node_of(LiveScene(ground="hill"), grounds={"hill": Plane.tilted(math.radians(8.0), 0.0)})
    drive(node, transport, 1.0, 0.0, 0.0)
    node.run(until=3.0)
    assert abs(velocity(transport)[0]) < 0.002


def test_a_command_ends_after_half_a_second() -> None:
    node, transport = node_of()
    drive(node, transport, 2.0, 0.5, 0.0)
    node.run(until=2.4)
    assert velocity(transport)[0] == pytest.approx(0.5, abs=0.03)
    node.run(until=4.5)
    assert abs(velocity(transport)[0]) < 0.05


def joint_command(names: list[str], **values: list[float]) -> Any:
    arrays = {key: values.get(key, []) for key in ("position", "velocity", "effort")}
    return messages.joint_state(0, names, *(np.array(array, float) for array in arrays.values()))


def test_wheels_and_steering_take_commands_of_their_own() -> None:
    node, transport = node_of()
    wheels = [f"wheel_{name}" for name in ("FL", "FR", "ML", "BL", "MR", "BR")]
    nan = math.nan
    names = [*wheels, "steering_FL", "steering_FR"]
    command = joint_command(names, velocity=[4.0] * 6 + [nan] * 2, position=[nan] * 6 + [0.2, 0.2])
    for _ in range(150):
        transport.send("/joint_commands", command)
        node.step()
    state = transport.last("/joint_states")
    angle = dict(zip(state.name, state.position, strict=True))
    rate = dict(zip(state.name, state.velocity, strict=True))
    assert [rate[name] for name in wheels] == pytest.approx([4.0] * 6, abs=0.05)
    assert [angle[f"steering_{name}"] for name in ("FL", "FR", "BL")] == pytest.approx([0.2, 0.2, 0.0], abs=0.02)


def test_commands_that_cannot_be_followed_are_told_and_change_nothing() -> None:
    told: list[str] = []
    node, transport = node_of(tell=told.append)
    drive(node, transport, 2.0, 0.5, 0.0)
    transport.send("/cmd_vel", messages.twist((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0)))
    transport.send("/joint_commands", joint_command(["elbow"], position=[0.1]))
    transport.send("/joint_commands", joint_command(["wheel_FL"], velocity=[1.0], effort=[5.0]))
    assert told[0] == "forward: must be finite, got nan"
    assert "elbow" in told[1]
    assert "steering_FL" in told[1]
    assert told[2].startswith("torques: must not be given together with speeds")
    node.step()
    assert velocity(transport)[0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("model", MODELS)
def test_wheel_odometry_follows_the_rover(model: str) -> None:
    node, transport = node_of(LiveScene(model=model))
    starts = [transport.last(topic).pose.pose.position for topic in ("/odom", "/ground_truth/odom")]
    drive(node, transport, 5.0, 0.2, 0.08)
    ways = []
    for topic, start in zip(("/odom", "/ground_truth/odom"), starts, strict=True):
        place = transport.last(topic).pose.pose.position
        ways.append(math.dist((place.x, place.y), (start.x, start.y)))
    assert ways[0] == pytest.approx(ways[1], rel=0.01)
    assert ways[1] > 0.8


def chain(transport: KeptTransport, to: str, start: str = frames.MAP) -> tuple[np.ndarray, np.ndarray]:
    """Place and rotation of a frame in another, by the transforms."""
    known = {one.child_frame_id: one for topic in ("/tf", "/tf_static") for one in transport.last(topic).transforms}
    place, turn = np.zeros(3), np.eye(3)
    while to != start:
        one = known[to]
        t, r = one.transform.translation, one.transform.rotation
        R = from_quaternion(np.array([r.w, r.x, r.y, r.z]))
        place, turn = R @ place + np.array([t.x, t.y, t.z]), R @ turn
        to = one.header.frame_id
    return place, turn


@pytest.mark.parametrize("model", MODELS)
def test_transforms_are_those_of_the_robot_description(model: str) -> None:
    urdf = pytest.importorskip("yourdfpy")
    node, transport = node_of(LiveScene(model=model, ground="hills", difficulty=0.5))
    drive(node, transport, 1.0, 0.3, 0.1)
    from lxml import etree  # noqa: PLC0415 - comes with yourdfpy

    text = transport.last("/robot_description").data
    robot = urdf.URDF(urdf.URDF._parse_robot(etree.fromstring(text.encode())), load_meshes=False)
    state = transport.last("/joint_states")
    robot.update_cfg(dict(zip(state.name, state.position, strict=True)))
    for link in robot.link_map:
        if link != "trunk" and any(one.child_frame_id == link for one in transport.last("/tf").transforms):
            expected = robot.get_transform(link, robot.base_link)
            place, turn = chain(transport, link, frames.BASE)
            assert place == pytest.approx(expected[:3, 3], abs=1e-6)
            assert turn == pytest.approx(expected[:3, :3], abs=1e-6)


def test_map_and_odometry_meet_at_the_rover() -> None:
    node, transport = node_of(LiveScene(ground="hills", difficulty=0.5))
    drive(node, transport, 2.0, 0.5, 0.1)
    place, turn = chain(transport, frames.BASE)
    pose = transport.last("/ground_truth/odom").pose.pose
    r = pose.orientation
    assert place == pytest.approx([pose.position.x, pose.position.y, pose.position.z], abs=1e-9)
    assert turn == pytest.approx(from_quaternion(np.array([r.w, r.x, r.y, r.z])), abs=1e-9)
    alone, transport = node_of(localise=False)
    alone.step()
    assert frames.ODOM not in {one.child_frame_id for one in transport.last("/tf").transforms}


def test_wheels_carry_the_rover() -> None:
    node, transport = node_of()
    node.run(until=1.0)
    weights = []
    for name in ("FL", "FR", "ML", "BL", "MR", "BR"):
        message = transport.last(f"/wheels/{name}/wrench")
        _, turn = chain(transport, message.header.frame_id)
        force = message.wrench.force
        weights.append(turn @ [force.x, force.y, force.z])
    assert sum(weights) == pytest.approx([0.0, 0.0, 960.0 * 9.81], abs=1.0)


LEVEL = Mount(position=(0.0, 1.0, 0.0))
DOWN = Mount(position=(0.5, 0.8, 0.0), pitch_deg=-90.0)


def test_sensors_publish_in_the_axes_of_ros() -> None:
    """At rest on the plane: gravity upward, the ground 1 m below the scanner, and below the camera's picture."""
    sensors = [
        InertialUnit(),
        LaserScanner(mount=LEVEL, elevations_deg=(-30.0,), rays=90),
        DepthCamera(mount=DOWN, width=8, height=6, sees_rover=False, rate=10.0),
        ColourCamera(width=8, height=6, rate=10.0),
    ]
    node, transport = node_of(sensors=sensors)
    node.run(until=1.0)
    felt = transport.last("/imu/data_raw")
    assert felt.linear_acceleration.z == pytest.approx(9.81, abs=0.05)
    assert felt.orientation_covariance[0] == -1.0
    assert transport.last("/imu/data").orientation_covariance[0] == 0.0
    scan = transport.last("/scan")
    ground = transport.last("/ground_truth/odom").pose.pose.position.z + 1.0
    assert scan.angle_min == pytest.approx(-math.pi)
    assert np.nanmax(scan.ranges) == pytest.approx(2.0 * ground, rel=1e-3)
    points = transport.last("/scan/points").data.view(np.float32).reshape(-1, 3)
    assert points[:, 2].min() == pytest.approx(-ground, abs=1e-3)
    depth, info = transport.last("/depth/image_raw"), transport.last("/depth/camera_info")
    assert (depth.encoding, depth.width, depth.height, depth.step) == ("32FC1", 8, 6, 32)
    height = transport.last("/ground_truth/odom").pose.pose.position.z + 0.8
    picture = depth.data.view(np.float32).reshape(6, 8)
    assert picture == pytest.approx(np.full((6, 8), height), abs=1e-3)
    fx, cx, cy = info.k[0], info.k[2], info.k[5]
    cloud = transport.last("/depth/points").data.view(np.float32).reshape(6, 8, 3)
    columns, rows = np.meshgrid(np.arange(8), np.arange(6))
    expected = np.stack(((columns - cx) * height / fx, (rows - cy) * height / fx, np.full((6, 8), height)), axis=2)
    assert cloud == pytest.approx(expected, abs=1e-3)
    place, turn = chain(transport, "depth_optical_frame")
    assert turn @ [0.0, 0.0, 1.0] == pytest.approx([0.0, 0.0, -1.0], abs=1e-3)  # the camera looks down
    assert place[2] == pytest.approx(height, abs=1e-3)
    colour = transport.last("/colour/image_raw")
    assert (colour.encoding, colour.step, len(colour.data)) == ("rgb8", 24, 144)
    assert len(transport.messages["/colour/image_raw"]) == 11  # ten a second and the first


def test_a_reading_has_the_time_at_which_it_was_taken() -> None:
    node, transport = node_of(sensors=[InertialUnit(latency=0.1)])
    node.run(until=1.0)
    clock = nanoseconds(transport.last("/clock").clock)
    assert clock - nanoseconds(transport.last("/imu/data_raw").header.stamp) == pytest.approx(1e8, abs=2.1e7)
    stamps = [nanoseconds(one.header.stamp) for one in transport.messages["/imu/data_raw"]]
    assert stamps == sorted(set(stamps))


@pytest.mark.parametrize("sensor", [HeadingSensor(), WheelEncoders()])
def test_sensors_without_a_message_are_refused(sensor: Any) -> None:
    with refused(OptionError, "sensors", "has no ROS message"):
        node_of(sensors=[sensor])


def test_latched_topics_and_best_effort_are_those_of_ros() -> None:
    _, transport = node_of(sensors=[InertialUnit(), LaserScanner()])
    latched = {topic for topic, one in transport.deliveries.items() if one.latched}
    assert latched == {"/tf_static", "/robot_description", "/goal"}
    lossy = {topic for topic, one in transport.deliveries.items() if not one.reliable}
    assert lossy >= {"/clock", "/imu/data", "/imu/data_raw", "/scan", "/scan/points"}
    assert not lossy & {"/tf", "/tf_static", "/odom", "/joint_states", "/ground_truth/odom"}


def test_a_reset_takes_the_parameters_and_the_clock_goes_on() -> None:
    node, transport = node_of(LiveScene(ground="rocks"))
    node.run(until=1.0)
    first = transport.last("/goal").pose.position
    transport.change("seed", 7)
    transport.change("difficulty", 0.2)
    assert transport.call("/rover/reset") == (True, "seed 7, difficulty 0.2")
    node.step()
    second = transport.last("/goal").pose.position
    assert (first.x, first.y) != (second.x, second.y)
    stamps = [nanoseconds(one.clock) for one in transport.messages["/clock"]]
    assert stamps == sorted(set(stamps))
    assert stamps[-1] == 1_040_000_000
    other, twin = node_of(LiveScene(ground="rocks", seed=7, difficulty=0.2))
    other.step()
    expected = twin.last("/goal").pose.position
    assert (second.x, second.y) == (expected.x, expected.y)


def test_parameters_out_of_their_range_are_refused() -> None:
    _, transport = node_of()
    for name, value in (("seed", -1), ("difficulty", 3.0), ("steps", 0)):
        with refused(OptionError, name):
            transport.change(name, value)
    assert transport.values == {"seed": 0, "difficulty": 0.5, "steps": 1}


def test_a_client_steps_the_time() -> None:
    node, transport = node_of(paused=True)
    transport.change("steps", 25)
    assert transport.call("/rover/step") == (True, "0.500 s")
    assert node.steps == 25
    assert transport.call("/rover/pause", False) == (True, "running at 0.500 s")
    node.run(until=0.6)
    assert node.steps == 30


def test_a_snapshot_is_restored_bit_for_bit() -> None:
    node, transport = node_of(LiveScene(ground="rocks"))
    assert transport.call("/rover/restore")[0] is False
    node.run(until=0.5)
    transport.call("/rover/snapshot")

    def drive_on() -> np.ndarray:
        drive(node, transport, 1.0, 0.5, 0.1)
        return np.array(transport.last("/joint_states").position)

    first = drive_on()
    assert transport.call("/rover/restore") == (True, "back at 0.500 s")
    assert np.array_equal(drive_on(), first)


def test_a_policy_drives_until_a_command_comes() -> None:
    node, transport = node_of(LiveScene(driver="pd"))
    node.run(until=3.0)
    assert velocity(transport)[0] > 0.5
    drive(node, transport, 2.0, 0.0, 0.0)
    assert abs(velocity(transport)[0]) < 0.1


def test_a_drive_that_has_ended_waits_for_a_reset() -> None:
    told: list[str] = []
    node, transport = node_of(tell=told.append)
    source: Any = node._source
    source.rover.ended = "roll_over"
    steps = node.steps
    node.step()
    assert node.steps == steps
    assert "call reset" in transport.call("/rover/step")[1]
    assert transport.call("/rover/pause", False)[0] is False
    assert transport.call("/rover/reset")[0]
    node.step()
    assert node.steps == steps + 1


def test_a_recording_plays(tmp_path: Path) -> None:
    simulation = standing()
    simulation.set_wheel_torques(np.full(6, 20.0))
    rover_run = recorded(simulation, tmp_path / "run.h5", rows=20, steps=10)
    transport = KeptTransport()
    node = RosNode(RecordedRover(rover_run), transport, options=NodeOptions(pace=0.0, sensors=[LaserScanner()]))
    node.run(until=rover_run.time[-1] - rover_run.time[0] - 1e-6)
    truth = transport.last("/ground_truth/odom").pose.pose.position
    x, y, z = rover_run.trajectory["q"][-1, :3]
    assert (truth.x, truth.y, truth.z) == pytest.approx((x, -z, y))
    assert len(transport.messages["/scan"]) == rover_run.n_frames
    assert transport.call("/rover/reset")[0]
    truth = transport.last("/ground_truth/odom").pose.pose.position
    assert truth.x == pytest.approx(rover_run.trajectory["q"][0, 0])


def test_time_of_the_source_is_that_of_the_frequency() -> None:
    assert live_source().dt == pytest.approx(1.0 / FREQUENCY)
