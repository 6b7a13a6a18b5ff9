"""Recording: a transport that also writes what it publishes to a bag, MCAP in the folder that `ros2 bag` expects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.ros import messages

if TYPE_CHECKING:
    from rover_gym.ros.transport import Delivery, ParameterValue, Publish, Transport


class BagTransport:
    """A transport whose published messages go into a bag, too, at the time of `/clock`; `Transport` has its methods.

    Args:
        inner: The transport.
        folder: Folder of the bag, which must not exist.

    Raises:
        OptionError: The folder exists.
        OSError: It cannot be created.
    """

    def __init__(self, inner: Transport, folder: Path) -> None:
        if folder.exists():
            refuse(OptionError, "bag", str(folder), "exists already")
        bags = require("rosbags.rosbag2", "ros")
        folder.parent.mkdir(parents=True, exist_ok=True)
        self._bag: Any = bags.Writer(folder, version=9, storage_plugin=bags.StoragePlugin.MCAP)
        self._bag.open()
        self.inner, self._now = inner, 0

    def publisher(self, topic: str, kind: str, delivery: Delivery) -> Publish:
        """Opens a topic."""
        publish = self.inner.publisher(topic, kind, delivery)
        channel = self._bag.add_connection(
            topic, kind, typestore=messages.definitions(), offered_qos_profiles=[_profile(delivery)]
        )

        def write(data: bytes) -> None:
            publish(data)
            if topic == "/clock":
                clock = messages.decode(data, kind).clock
                self._now = clock.sec * 10**9 + clock.nanosec
            self._bag.write(channel, self._now, data)

        return write

    def subscribe(self, topic: str, kind: str, take: Callable[[bytes], None]) -> None:
        """Calls a function in `spin` with each message of a topic."""
        self.inner.subscribe(topic, kind, take)

    def serve_trigger(self, name: str, act: Callable[[], str]) -> None:
        """Offers a service without an argument."""
        self.inner.serve_trigger(name, act)

    def serve_switch(self, name: str, act: Callable[[bool], str]) -> None:
        """Offers a service with a flag."""
        self.inner.serve_switch(name, act)

    def serve_parameters(
        self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]
    ) -> None:
        """Offers the node's parameters."""
        self.inner.serve_parameters(values, change)

    def spin(self, seconds: float) -> None:
        """Waits for messages and requests, and handles all that have come."""
        self.inner.spin(seconds)

    def close(self) -> None:
        """Ends the bag and leaves the network."""
        self._bag.close()
        self.inner.close()


def _profile(delivery: Delivery) -> Any:
    """The quality of service that `ros2 bag play` offers again."""
    kinds = require("rosbags.interfaces", "ros")
    forever = kinds.QosTime(2147483647, 4294967295)
    return kinds.Qos(
        kinds.QosHistory.KEEP_LAST,
        delivery.depth,
        kinds.QosReliability.RELIABLE if delivery.reliable else kinds.QosReliability.BEST_EFFORT,
        kinds.QosDurability.TRANSIENT_LOCAL if delivery.latched else kinds.QosDurability.VOLATILE,
        forever,
        forever,
        kinds.QosLiveliness.AUTOMATIC,
        forever,
        avoid_ros_namespace_conventions=False,
    )
