"""What carries a node's messages: topics, services and parameters, whatever the middleware.

Messages are bytes in CDR, as `rover_gym.ros.messages` encodes them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from rover_gym.core import CommandError
from rover_gym.core.validation import refuse

#: Publishes a message.
Publish: TypeAlias = Callable[[bytes], None]
#: Values of a node's parameters.
ParameterValue: TypeAlias = bool | int | float | str


@dataclass(frozen=True)
class Delivery:
    """Quality of service of a topic.

    Attributes:
        reliable: Whether lost messages are sent again.
        latched: Whether a subscriber that comes later gets the last messages (transient local).
        depth: How many messages are kept for subscribers.
    """

    reliable: bool = True
    latched: bool = False
    depth: int = 100


#: States of the rover; subscribers that ask for best effort get them, too.
STATE = Delivery()
#: `qos_profile_sensor_data` of ROS.
SENSOR = Delivery(reliable=False, depth=5)
#: What is published once, such as `tf_static` and `robot_description`.
LATCHED = Delivery(latched=True, depth=1)
#: `ClockQoS` of ROS.
CLOCK = Delivery(reliable=False, depth=1)
#: Commands: only the last one counts, and publishers of either reliability match.
COMMAND = Delivery(reliable=False, depth=1)


class Transport(Protocol):
    """A node of a middleware. All methods are called from one thread.

    Services are `std_srvs/srv/Trigger` and `std_srvs/srv/SetBool`. Their functions return the answer's message; a
    `RoverGymError` or `OSError` is answered with `success: false` and its text.
    """

    def publisher(self, topic: str, kind: str, delivery: Delivery) -> Publish:
        """Opens a topic, such as "/odom", for messages of a type, such as "nav_msgs/msg/Odometry"."""
        ...

    def subscribe(self, topic: str, kind: str, take: Callable[[bytes], None]) -> None:
        """Calls a function in `spin` with each message of a topic."""
        ...

    def serve_trigger(self, name: str, act: Callable[[], str]) -> None:
        """Offers a service without an argument."""
        ...

    def serve_switch(self, name: str, act: Callable[[bool], str]) -> None:
        """Offers a service with a flag."""
        ...

    def serve_parameters(
        self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]
    ) -> None:
        """Offers the node's parameters; `change` is called with a new value, of the old one's type, or raises."""
        ...

    def spin(self, seconds: float) -> None:
        """Waits for messages and requests for a time, s, at most, and handles all that have come."""
        ...

    def close(self) -> None:
        """Leaves the network."""
        ...


def same_type(name: str, value: ParameterValue, old: ParameterValue) -> ParameterValue:
    """A parameter's new value, of the old one's type; a whole number is a number, too.

    Raises:
        CommandError: It is of another type.
    """
    if isinstance(old, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not type(old):
        refuse(CommandError, name, value, f"must be of the type {type(old).__name__}")
    return value
