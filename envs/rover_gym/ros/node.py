"""A rover as a ROS 2 node: it steps in real time, faster, or as a client asks, and publishes after each step.

node = RosNode(DrivenRover(LiveRover()), open_transport("auto", "rover"))
node.run(until=10.0)
node.close()
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt

from rover_gym.core import CommandError, ModelError
from rover_gym.core.validation import number, refuse, whole
from rover_gym.envs.sensors.sensor_suite import SensorSuite, SuiteState
from rover_gym.envs.start import MAX_DIFFICULTY, drive_signs
from rover_gym.models.file_writing import IGNORABLE, urdf_tree
from rover_gym.ros import messages, rover_frames as frames
from rover_gym.ros.driving import JointCommand, TwistCommand
from rover_gym.ros.odometry import WheelOdometry
from rover_gym.ros.sensor_topics import SensorTopics
from rover_gym.ros.transport import CLOCK, LATCHED, SENSOR, STATE
from rover_gym.ros.wheel_loads import wheel_links, wheel_wrenches

if TYPE_CHECKING:
    from rover_gym.envs.sensors.sensor_suite import SensorLike
    from rover_gym.ros.driving import Command
    from rover_gym.ros.node_rovers import NodeRover
    from rover_gym.ros.transport import ParameterValue, Publish, Transport

Array = npt.NDArray[np.float64]

#: A command older than this is over, and the rover stops or its own driver goes on, s of simulated time.
HOLD = 0.5
#: A loop that is behind by more gives the time up instead of hurrying after it, s.
MOST_DEBT = 0.25
#: Longest wait for messages while the time stands still, s.
IDLE = 0.02
#: Most steps of one call of the service `step`.
MOST_STEPS = 100_000
#: Variances of wheel odometry: pose and velocity along x, y, z and about them. Slip is not known.
ODOM_POSE = (1e-2, 1e-2, 1e-1, 1e-4, 1e-4, 1e-2)
ODOM_TWIST = (1e-3, 1e-3, messages.UNKNOWN, messages.UNKNOWN, messages.UNKNOWN, 1e-3)
EXACT = (0.0,) * 6

#: Types of topics that are there for every rover.
TOPICS = {
    "/clock": ("rosgraph_msgs/msg/Clock", CLOCK),
    "/tf": ("tf2_msgs/msg/TFMessage", STATE),
    "/tf_static": ("tf2_msgs/msg/TFMessage", LATCHED),
    "robot_description": ("std_msgs/msg/String", LATCHED),
    "joint_states": ("sensor_msgs/msg/JointState", STATE),
    "odom": ("nav_msgs/msg/Odometry", STATE),
    "ground_truth/odom": ("nav_msgs/msg/Odometry", STATE),
    "goal": ("geometry_msgs/msg/PoseStamped", LATCHED),
}


@dataclass(frozen=True)
class NodeOptions:
    """How a node runs.

    Attributes:
        sensors: Sensors of the rover; those of `rover_gym.envs.sensors` that ROS has messages for.
        pace: Simulated over wall time; 0 for as fast as it goes.
        paused: Whether the time stands still at first, until a client steps it or lets it go.
        localise: Whether the transform from `map` to `odom` is published, by which the rover is where it is; a node
            that estimates its place publishes it instead.
        seed: Of the next reset.
        difficulty: Of the next reset.
    """

    sensors: Sequence[SensorLike] = ()
    pace: float = 1.0
    paused: bool = False
    localise: bool = True
    seed: int = 0
    difficulty: float = 0.5

    def __post_init__(self) -> None:
        number("pace", self.pace, at_least=0.0, at_most=1000.0)
        _check_parameter("seed", self.seed)
        _check_parameter("difficulty", self.difficulty)


@dataclass
class _Commanded:
    """The last command, and the time from which on it is over, s."""

    command: Command | None = None
    until: float = -math.inf


@dataclass
class _Sensed:
    """The sensors of a drive."""

    suite: SensorSuite
    state: SuiteState
    topics: dict[str, SensorTopics]
    #: Samples that are not yet published, with the times at which they were taken, s.
    taken: dict[str, list[tuple[Any, float]]] = field(default_factory=dict)


class RosNode:
    """Publishes a rover, and takes commands and requests.

    Topics are those of `TOPICS`, a wrench a wheel in `wheels/NAME/wrench`, and those of the sensors. Commands come on
    `cmd_vel` (`geometry_msgs/msg/Twist`), `cmd_vel_stamped` (`TwistStamped`) and `joint_commands`
    (`sensor_msgs/msg/JointState`: velocity or effort of wheels, position of joints that steer). Services are `reset`,
    `pause`, `step`, `snapshot` and `restore` below the node's name, its parameters `seed`, `difficulty` and `steps`.

    Stamps are simulated time, as in `/clock`, which never goes back: a reset goes on with the time of before.

    Args:
        source: The rover.
        transport: The middleware.
        name: The node's name, under which its services are.
        namespace: Of its topics.
        options: How it runs.
        tell: Called with messages for the user.

    Attributes:
        now: Time of the last message, ns.
        steps: Steps that have been taken.

    Raises:
        RoverGymError: A sensor does not fit the rover, or ROS has no message for it.
    """

    def __init__(
        self,
        source: NodeRover,
        transport: Transport,
        *,
        name: str = "rover",
        namespace: str = "/",
        options: NodeOptions | None = None,
        tell: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self._source, self._transport, self._tell = source, transport, tell
        self.options = NodeOptions() if options is None else options
        self._prefix = namespace.rstrip("/")
        self._paused, self._stopping = self.options.paused, False
        self._parameters: dict[str, ParameterValue] = {
            "seed": self.options.seed,
            "difficulty": self.options.difficulty,
            "steps": 1,
        }
        self._commanded = _Commanded()
        self._snapshot: Any = None
        self.now, self.steps = 0, 0
        self._begun = False
        self._publishers: dict[str, Publish] = {
            topic: transport.publisher(self._global(topic), kind, delivery)
            for topic, (kind, delivery) in TOPICS.items()
        }
        self._open_sensors()
        self._open_commands()
        self._open_services(f"{self._prefix}/{name}")
        self._begin()

    def run(self, until: float = math.inf) -> None:
        """Steps and publishes until `stop` is called, or until a simulated time since the start, s."""
        due = time.perf_counter()
        while not self._stopping and 1e-9 * self.now < until:
            if self._paused or self._source.ended:
                self._transport.spin(IDLE)
                due = time.perf_counter()
                continue
            self.step()
            if self.options.pace == 0.0:
                self._transport.spin(0.0)
                continue
            due += self._source.dt / self.options.pace
            due = max(due, time.perf_counter() - MOST_DEBT)
            self._wait(due)

    def stop(self) -> None:
        """Ends `run`; for any thread and for signals."""
        self._stopping = True

    def close(self) -> None:
        """Leaves the network."""
        self._transport.close()

    def step(self) -> None:
        """Takes a step and publishes; where the drive has ended, the time stops."""
        before = self._source.time
        if self._ended():
            return
        valid = before < self._commanded.until
        command = self._commanded.command if valid else self._at_rest
        self._source.step(command)
        self.now += round(1e9 * (self._source.time - before))
        self.steps += 1
        self._publish_clock()
        self._sense()
        self._publish(self._source.time - before)
        if self._ended():
            self._tell(f"the drive has ended ({self._ended()}): call the service reset")

    def _ended(self) -> str:
        return self._source.ended

    def _wait(self, due: float) -> None:
        """Handles messages until a time of the clock, at least once."""
        left = due - time.perf_counter()
        self._transport.spin(max(0.0, left))
        while not self._stopping and (left := due - time.perf_counter()) > 0.0:
            self._transport.spin(left)

    @property
    def _at_rest(self) -> Command | None:
        """What drives without a command: the rover's own driver, or nothing."""
        return None if self._source.drives_itself else TwistCommand()

    def _global(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{self._prefix}/{topic}"

    def _open_sensors(self) -> None:
        source = self._source
        self._sensed: _Sensed | None = None
        if self.options.sensors:
            suite = SensorSuite(list(self.options.sensors), source.model, source.dt)
            topics = {
                name: SensorTopics(self._transport, sensor, self._prefix) for name, sensor in suite.sensors.items()
            }
            state = suite.begin(source.moment(), np.zeros(1, np.uint64))
            self._sensed = _Sensed(suite, state, topics)
        for wheel in source.model.wheel_names:
            topic = f"wheels/{wheel}/wrench"
            self._publishers[topic] = self._transport.publisher(
                self._global(topic), "geometry_msgs/msg/WrenchStamped", SENSOR
            )

    def _open_commands(self) -> None:
        kinds: dict[str, tuple[str, Callable[[Any], Command]]] = {
            "cmd_vel": ("geometry_msgs/msg/Twist", _twist),
            "cmd_vel_stamped": ("geometry_msgs/msg/TwistStamped", lambda message: _twist(message.twist)),
            "joint_commands": ("sensor_msgs/msg/JointState", self._joint_command),
        }
        for topic, (kind, read) in kinds.items():
            self._transport.subscribe(self._global(topic), kind, self._taker(kind, read))

    def _taker(self, kind: str, read: Callable[[Any], Command]) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            try:
                command = read(messages.decode(data, kind))
                self._source.check(command)
            except CommandError as error:
                self._tell(str(error))
                return
            self._commanded = _Commanded(command, self._source.time + HOLD)

        return take

    def _joint_command(self, message: Any) -> JointCommand:
        model = self._source.model
        wheels = [model.dof_names[i] for i in model.wheel_joint_indices]
        signs = dict(zip(wheels, drive_signs(model), strict=True))
        found: dict[str, dict[str, float]] = {"speeds": {}, "torques": {}, "angles": {}}
        for i, name in enumerate(message.name):
            for part, values in (
                ("angles", message.position),
                ("speeds", message.velocity),
                ("torques", message.effort),
            ):
                is_wheel = part != "angles"
                if i < len(values) and math.isfinite(values[i]) and (name in signs) == is_wheel:
                    found[part][name] = float(values[i] * signs.get(name, 1.0))
            if name not in signs:
                found["angles"].setdefault(name, 0.0)
        return JointCommand(**found)

    def _open_services(self, base: str) -> None:
        transport = self._transport
        transport.serve_trigger(f"{base}/reset", self._reset)
        transport.serve_switch(f"{base}/pause", self._pause)
        transport.serve_trigger(f"{base}/step", self._step_on)
        transport.serve_trigger(f"{base}/snapshot", self._keep)
        transport.serve_trigger(f"{base}/restore", self._restore)
        transport.serve_parameters(dict(self._parameters), self._change)

    def _change(self, name: str, value: ParameterValue) -> None:
        _check_parameter(name, value)
        self._parameters[name] = value

    def _reset(self) -> str:
        seed, difficulty = self._parameters["seed"], self._parameters["difficulty"]
        self._source.reset(int(seed), float(difficulty))
        self._begin()
        return f"seed {seed}, difficulty {difficulty:g}"

    def _pause(self, on: bool) -> str:
        if not on and self._source.ended:
            refuse(CommandError, "pause", on, f"the drive has ended ({self._source.ended}); call reset")
        self._paused = on
        return f"{'paused' if on else 'running'} at {self._source.time:.3f} s"

    def _step_on(self) -> str:
        if self._source.ended:
            refuse(CommandError, "step", self._source.ended, "ended the drive; call reset")
        self._paused = True
        for _ in range(int(self._parameters["steps"])):
            self.step()
        return f"{self._source.time:.3f} s"

    def _keep(self) -> str:
        self._snapshot = self._source.snapshot()
        return f"kept {self._source.time:.3f} s"

    def _restore(self) -> str:
        if self._snapshot is None:
            refuse(CommandError, "snapshot", None, "must be taken first")
        self._source.restore(self._snapshot)
        self._begin()
        return f"back at {self._source.time:.3f} s"

    def _begin(self) -> None:
        """Publishes what stays for a drive, and its first state, a step later: no two messages have the same stamp."""
        source = self._source
        self.now += round(1e9 * source.dt) if self._begun else 0
        self._begun = True
        self._commanded = _Commanded()
        self._odometry, self._links = WheelOdometry(source.model), wheel_links(source.model)
        sensors = [] if self._sensed is None else list(self._sensed.suite.sensors.values())
        self._frames = frames.RoverFrames(source.model, sensors)
        self._goal: tuple[float, float] | None = None
        if self._sensed is not None:
            row = np.array([int(self._parameters["seed"]), source.episodes], np.uint64)
            self._sensed.state = self._sensed.suite.begin(source.moment(), row)
            self._sensed.taken = {
                name: [(own.reading, source.time)] for name, own in self._sensed.state.sensors.items()
            }
        self._publish_clock()
        pairs, places, turns = zip(*self._frames.fixed, strict=True)
        self._send("/tf_static", messages.transforms(self.now, pairs, np.array(places), np.array(turns)))
        self._send("robot_description", messages.make("std_msgs/msg/String", data=self._description()))
        self._publish(0.0)

    def _description(self) -> str:
        """The rover's URDF; "" where the format cannot express it."""
        try:
            return ET.tostring(urdf_tree(self._source.model, IGNORABLE), encoding="unicode")
        except ModelError as error:
            self._tell(f"robot_description is empty: {error}")
            return ""

    def _sense(self) -> None:
        """Takes the samples that are due, and notes when each was taken."""
        if self._sensed is None:
            return
        suite, state, time_now = self._sensed.suite, self._sensed.state, self._source.time
        suite.advance(state, self._source.moment())
        for name, own in state.sensors.items():
            if own.sampled == time_now:
                newest = own.waiting[-1][1] if own.waiting else own.reading
                self._sensed.taken[name].append((newest, time_now))

    def _send(self, topic: str, message: Any) -> None:
        self._publishers[topic](messages.encode(message))

    def _publish_clock(self) -> None:
        self._send("/clock", messages.make("rosgraph_msgs/msg/Clock", clock=messages.time_of(self.now)))

    def _publish(self, period: float) -> None:
        source, simulation, stamp = self._source, self._source.simulation, self.now
        place, attitude = frames.base_pose(simulation)
        self._odometry.advance(simulation.q, attitude, period)
        self._publish_transforms(place, attitude)
        self._publish_joints()
        self._publish_odometry(place, attitude)
        loads = wheel_wrenches(simulation, self._links)
        for wheel, link, load in zip(source.model.wheel_names, self._links, loads, strict=True):
            self._send(f"wheels/{wheel}/wrench", messages.wrench(stamp, link, *load))
        self._publish_readings()
        if source.goal is not None and source.goal != self._goal:
            self._goal = source.goal
            self._publish_goal(*source.goal)

    def _publish_transforms(self, place: Array, attitude: Array) -> None:
        places, turns = self._frames.moving(self._source.simulation)
        own = self._odometry
        pairs, first, second = [(frames.ODOM, frames.BASE)], [own.place], [own.rotation]
        if self.options.localise:
            back = attitude @ own.rotation.T
            pairs, first, second = (
                [(frames.MAP, frames.ODOM), *pairs],
                [place - back @ own.place, *first],
                [back, *second],
            )
        found = messages.transforms(
            self.now, [*pairs, *self._frames.pairs], np.concatenate((first, places)), np.concatenate((second, turns))
        )
        self._send("/tf", found)

    def _publish_joints(self) -> None:
        simulation, model = self._source.simulation, self._source.model
        efforts = np.zeros(model.nv)
        efforts[model.wheel_joint_indices] = simulation.motor_torques * drive_signs(model)
        names = model.dof_names[6:]
        self._send(
            "joint_states",
            messages.joint_state(self.now, names, simulation.q[6:], simulation.v[6:], efforts[6:]),
        )

    def _publish_odometry(self, place: Array, attitude: Array) -> None:
        own, simulation = self._odometry, self._source.simulation
        forward, left, turn = own.velocity
        rolled = np.array([forward, left, 0.0, 0.0, 0.0, turn])
        self._send(
            "odom",
            messages.odometry(
                self.now, (frames.ODOM, frames.BASE), own.place, own.rotation, rolled, (ODOM_POSE, ODOM_TWIST)
            ),
        )
        moved = frames.ros_vector(simulation.v[:6].reshape(2, 3)) @ attitude
        self._send(
            "ground_truth/odom",
            messages.odometry(self.now, (frames.MAP, frames.BASE), place, attitude, moved.ravel(), (EXACT, EXACT)),
        )

    def _publish_readings(self) -> None:
        if self._sensed is None:
            return
        moment = self._source.moment()
        for name, own in self._sensed.state.sensors.items():
            taken = self._sensed.taken[name]
            due = next((i for i, (reading, _) in enumerate(taken) if reading is own.reading), None)
            if due is None:
                continue
            reading, at = taken[due]
            del taken[: due + 1]
            sensor = self._sensed.suite.sensors[name]
            mount = getattr(sensor, "mount", None)
            attitude = np.eye(3) if mount is None else frames.ros_rotation(moment.frame(mount)[1])
            stamp = self.now - round(1e9 * (self._source.time - at))
            interval = self._source.dt if sensor.rate is None else 1.0 / sensor.rate
            self._sensed.topics[name].publish(reading.astype(sensor.reading_type), stamp, attitude, interval)

    def _publish_goal(self, x: float, z: float) -> None:
        place = frames.ros_vector(np.array([x, 0.0, z]))
        self._send(
            "goal",
            messages.make(
                "geometry_msgs/msg/PoseStamped",
                header=messages.header(self.now, frames.MAP),
                pose=messages.pose(place, np.eye(3)),
            ),
        )


def _twist(message: Any) -> TwistCommand:
    return TwistCommand(message.linear.x, message.linear.y, message.angular.z)


def _check_parameter(name: str, value: object) -> None:
    """Refuses a value that a parameter of the node does not take."""
    if name == "seed":
        whole(name, value, at_most=2**31 - 1)
    elif name == "difficulty":
        number(name, value, at_least=0.0, at_most=MAX_DIFFICULTY)
    elif name == "steps":
        whole(name, value, at_least=1, at_most=MOST_STEPS)
    else:
        refuse(CommandError, "name", name, "must be seed, difficulty or steps")
