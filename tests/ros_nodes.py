"""A node without a network: what it publishes is kept, and its functions are called as a client would."""

from collections.abc import Callable, Mapping
from typing import Any

from rover_gym.core import RoverGymError
from rover_gym.ros import Delivery, DrivenRover, NodeOptions, RosNode, messages
from rover_gym.ros.transport import ParameterValue, Publish
from rover_gym.show.live import LiveChoices, LiveRover, LiveScene

FREQUENCY = 50.0


class KeptTransport:
    """A transport that keeps messages, decoded, by topic."""

    def __init__(self) -> None:
        self.kinds: dict[str, str] = {}
        self.deliveries: dict[str, Delivery] = {}
        self.messages: dict[str, list[Any]] = {}
        self.takers: dict[str, tuple[str, Callable[[bytes], None]]] = {}
        self.services: dict[str, Callable[..., str]] = {}

    def publisher(self, topic: str, kind: str, delivery: Delivery) -> Publish:
        """Keeps the messages of a topic."""
        self.kinds[topic], self.deliveries[topic] = kind, delivery
        kept = self.messages.setdefault(topic, [])
        return lambda data: kept.append(messages.decode(data, kind))

    def subscribe(self, topic: str, kind: str, take: Callable[[bytes], None]) -> None:
        """Keeps what takes the messages of a topic."""
        self.takers[topic] = kind, take

    def serve_trigger(self, name: str, act: Callable[[], str]) -> None:
        """Keeps a service."""
        self.services[name] = act

    def serve_switch(self, name: str, act: Callable[[bool], str]) -> None:
        """Keeps a service."""
        self.services[name] = act

    def serve_parameters(
        self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]
    ) -> None:
        """Keeps the parameters."""
        self.values, self.change = values, change

    def spin(self, seconds: float) -> None:
        """Waits for nothing."""

    def close(self) -> None:
        """Leaves nothing."""

    def send(self, topic: str, message: Any) -> None:
        """Sends the node a message."""
        self.takers[topic][1](messages.encode(message))

    def call(self, service: str, *given: Any) -> tuple[bool, str]:
        """Calls a service; returns success and message."""
        try:
            return True, self.services[service](*given)
        except RoverGymError as error:
            return False, str(error)

    def last(self, topic: str) -> Any:
        """The last message of a topic."""
        return self.messages[topic][-1]


def live_source(scene: LiveScene | None = None, frequency: float = FREQUENCY, **choices: Any) -> DrivenRover:
    """A rover that drives at a control frequency."""
    return DrivenRover(LiveRover(scene, LiveChoices(arguments={"control_frequency": frequency}, **choices)))


def node_of(
    scene: LiveScene | None = None,
    *,
    tell: Callable[[str], None] = lambda _text: None,
    grounds: Mapping[str, Any] | None = None,
    models: Mapping[str, Any] | None = None,
    **options: Any,
) -> tuple[RosNode, KeptTransport]:
    """A node of a rover in a scene, whose ground and model may be given by name."""
    given = {"grounds": grounds, "models": models}
    source = live_source(scene, **{name: own for name, own in given.items() if own is not None})
    transport = KeptTransport()
    return RosNode(source, transport, options=NodeOptions(pace=0.0, **options), tell=tell), transport


def drive(
    node: RosNode, transport: KeptTransport, seconds: float, forward: float, turn: float, left: float = 0.0
) -> None:
    """Commands a twist for a time, s, again and again as its clients do."""
    for k in range(round(seconds * FREQUENCY)):
        if k % 5 == 0:
            transport.send("/cmd_vel", messages.twist((forward, left, 0.0), (0.0, 0.0, turn)))
        node.step()
