"""A ROS 2 node over Cyclone DDS, by the package `cyclonedds`, where no ROS is installed.

Names, types and the discovery of nodes are those of ROS 2's DDS middlewares: the topic `/odom` is `rt/odom`, its type
`nav_msgs/msg/Odometry` is `nav_msgs::msg::dds_::Odometry_`, and a participant tells on `ros_discovery_info` which
nodes it has with which endpoints. Requests and answers of services begin with the client's number and that of the
request, as rmw_cyclonedds has them; clients of Fast DDS expect them elsewhere in the packet, where the package cannot
write, and get no answer.
"""

from __future__ import annotations

import os
import types as python_types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from rover_gym.core import OptionError, RoverGymError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.ros import messages
from rover_gym.ros.parameter_services import Parameters
from rover_gym.ros.transport import Delivery, ParameterValue, Publish

#: Before the request or the answer of a service: the client and the request.
SERVICE_HEAD = "uint64 client\nint64 sequence\n"
SERVICE = Delivery(depth=10)
COMMANDS = Delivery(reliable=False, depth=100)
#: Most messages of a topic that are handled at once.
MOST = 100
#: Types of the definitions that are no messages.
BASE_TYPES = {"bool": "bool", "byte": "uint8", "octet": "uint8", "char": "uint8"}
#: Types of these vendors' nodes are matched by name alone (Connext, Fast DDS, GurumDDS, RustDDS, Dust DDS): Fast DDS
#: describes sequences otherwise than Cyclone DDS understands, and ROS compares no more than names either.
BY_NAME = "<Compatibility><IgnoreTypeInformation>1.1,1.15,1.17,1.18,1.20</IgnoreTypeInformation></Compatibility>"
#: Only this machine: the loopback interface, without multicast.
LOCAL = (
    "<General><Interfaces><NetworkInterface address='127.0.0.1' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
)


def dds(part: str) -> Any:
    """A module of the package `cyclonedds`.

    Raises:
        MissingExtraError: It is not installed.
    """
    return require(f"cyclonedds.{part}", "ros")


class CycloneTransport:
    """A node of Cyclone DDS; `Transport` has its methods.

    The variables of ROS choose the network: `ROS_DOMAIN_ID`, and `ROS_AUTOMATIC_DISCOVERY_RANGE` of "LOCALHOST" or
    `ROS_LOCALHOST_ONLY` of "1" for this machine alone. `CYCLONEDDS_URI` adds to them.

    Args:
        name: Name of the node.
        namespace: Its namespace, from "/".

    Raises:
        OptionError: `ROS_DOMAIN_ID` is no number from 0 to 232.
        MissingExtraError: cyclonedds or rosbags is not installed.
    """

    def __init__(self, name: str, namespace: str = "/") -> None:
        self._full_name = f"{namespace.rstrip('/')}/{name}"
        domain = _domain_id()
        config = f"<CycloneDDS><Domain id='any'>{BY_NAME}{LOCAL if _is_local() else ''}</Domain></CycloneDDS>"
        of_user = os.environ.get("CYCLONEDDS_URI", "")
        self._domain = dds("domain").Domain(domain, f"{config},{of_user}" if of_user else config)
        self._participant = dds("domain").DomainParticipant(domain, self._qos(None, f"enclave={namespace};"))
        self._waiting = dds("core").WaitSet(self._participant)
        self._readers: list[tuple[Any, Callable[[Any], None]]] = []
        self._endpoints: dict[str, list[Any]] = {"reader": [], "writer": []}
        self._kept: list[Any] = []
        self._name, self._namespace = name, namespace
        self._graph = self._writer("ros_discovery_info", _type_of(GRAPH), Delivery(latched=True, depth=1))
        self._announce()

    def publisher(self, topic: str, kind: str, delivery: Delivery) -> Publish:
        """Opens a topic."""
        sample = _type_of(kind)
        writer = self._writer(f"rt{topic}", sample, delivery, messages.definitions().hash_rihs01(kind))
        self._add("writer", writer)
        return lambda data: writer.write(sample(data))

    def subscribe(self, topic: str, kind: str, take: Callable[[bytes], None]) -> None:
        """Calls a function in `spin` with each message of a topic."""
        reader = self._reader(f"rt{topic}", _type_of(kind), COMMANDS, messages.definitions().hash_rihs01(kind))
        self._listen(reader, lambda sample: take(sample.data))

    def serve_trigger(self, name: str, act: Callable[[], str]) -> None:
        """Offers a `std_srvs/srv/Trigger`."""
        self._serve(name, "std_srvs/srv/Trigger", lambda _request: _outcome(act))

    def serve_switch(self, name: str, act: Callable[[bool], str]) -> None:
        """Offers a `std_srvs/srv/SetBool`."""
        self._serve(name, "std_srvs/srv/SetBool", lambda request: _outcome(lambda: act(bool(request.data))))

    def serve_parameters(
        self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]
    ) -> None:
        """Offers the services of a node's parameters."""
        for kind, answer in Parameters(values, change).services().items():
            verb = kind.rpartition("/")[2]
            name = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in verb)[1:]
            self._serve(f"{self._full_name}/{name}", kind, answer)

    def spin(self, seconds: float) -> None:
        """Waits for messages and requests for a time, s, at most, and handles all that have come."""
        if seconds > 0.0:
            self._waiting.wait(int(seconds * 1e9))
        for reader, take in self._readers:
            for sample in reader.take(MOST):
                if sample.sample_info.valid_data:
                    take(sample)

    def close(self) -> None:
        """Leaves the network."""
        self._readers.clear()
        self._endpoints.clear()
        self._kept.clear()
        del self._graph, self._waiting, self._participant, self._domain

    def _serve(self, name: str, kind: str, answer: Callable[[Any], dict[str, Any]]) -> None:
        request, reply = (_type_of(f"{kind}_{part}") for part in ("Request", "Response"))
        writer = self._writer(f"rr{name}Reply", reply, SERVICE)
        reader = self._reader(f"rq{name}Request", request, SERVICE)

        def take(sample: Any) -> None:
            asked = messages.decode(sample.data, f"{kind}_Request")
            given = messages.make(f"{kind}_Response", client=asked.client, sequence=asked.sequence, **answer(asked))
            writer.write(reply(messages.encode(given)))

        self._listen(reader, take)
        self._add("writer", writer)

    def _listen(self, reader: Any, take: Callable[[Any], None]) -> None:
        core = dds("core")
        condition = core.ReadCondition(reader, core.SampleState.Any | core.ViewState.Any | core.InstanceState.Any)
        self._waiting.attach(condition)
        self._kept.append(condition)
        self._readers.append((reader, take))
        self._add("reader", reader)

    def _writer(self, topic: str, sample: Any, delivery: Delivery, type_hash: str = "") -> Any:
        qos = self._qos(delivery, f"typehash={type_hash};" if type_hash else "")
        writer: Any = dds("pub").DataWriter(self._participant, self._topic(topic, sample), qos)
        return writer

    def _reader(self, topic: str, sample: Any, delivery: Delivery, type_hash: str = "") -> Any:
        qos = self._qos(delivery, f"typehash={type_hash};" if type_hash else "")
        reader: Any = dds("sub").DataReader(self._participant, self._topic(topic, sample), qos)
        return reader

    def _topic(self, topic: str, sample: Any) -> Any:
        return dds("topic").Topic(self._participant, topic, sample)

    def _qos(self, delivery: Delivery | None, data: str) -> Any:
        core = dds("core")
        policy = core.Policy
        found = [policy.Userdata(data.encode())] if data else []
        if delivery is not None:
            patience = dds("util").duration(milliseconds=100)
            found += [
                policy.Reliability.Reliable(patience) if delivery.reliable else policy.Reliability.BestEffort,
                policy.Durability.TransientLocal if delivery.latched else policy.Durability.Volatile,
                policy.History.KeepLast(delivery.depth),
                policy.DataRepresentation(use_cdrv0_representation=True),
            ]
        return core.Qos(*found)

    def _add(self, side: str, endpoint: Any) -> None:
        self._endpoints[side].append(endpoint)
        self._announce()

    def _announce(self) -> None:
        """Tells other nodes which node has which endpoints."""
        gids = {side: [_gid(one) for one in endpoints] for side, endpoints in self._endpoints.items()}
        node = messages.make(
            "rmw_dds_common/msg/NodeEntitiesInfo",
            node_namespace=self._namespace,
            node_name=self._name,
            reader_gid_seq=gids["reader"],
            writer_gid_seq=gids["writer"],
        )
        told = messages.make(GRAPH, gid=_gid(self._participant), node_entities_info_seq=[node])
        self._graph.write(_type_of(GRAPH)(messages.encode(told)))


GRAPH = "rmw_dds_common/msg/ParticipantEntitiesInfo"


def _outcome(act: Callable[[], str]) -> dict[str, Any]:
    """Success and message of a service."""
    try:
        return {"success": True, "message": act()}
    except (RoverGymError, OSError) as error:
        return {"success": False, "message": str(error)}


def _gid(entity: Any) -> Any:
    return messages.make("rmw_dds_common/msg/Gid", data=np.frombuffer(entity.guid.bytes, np.uint8))


def _domain_id() -> int:
    given = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not given.isdigit() or int(given) > 232:
        refuse(OptionError, "ROS_DOMAIN_ID", given, "must be a whole number from 0 to 232")
    return int(given)


def _is_local() -> bool:
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return reach == "LOCALHOST" or os.environ.get("ROS_LOCALHOST_ONLY") == "1"


@cache
def _type_of(kind: str) -> Any:
    """The class of a type's samples, which hold a message in CDR; its fields are there for type checks of DDS."""
    found = _struct(kind)
    found.__idl__.populate()

    def hold(self: Any, data: bytes = b"") -> None:
        self.data = data

    def read(cls: Any, data: bytes, /, **_: Any) -> Any:
        return cls(data)

    def written(self: Any, **_: Any) -> bytes:
        held: bytes = self.data
        return held

    found.__init__, found.serialize = hold, written
    found.deserialize = found.deserialize_key = classmethod(read)
    return found


@cache
def _struct(kind: str) -> Any:
    """The structure of a message, as a class of `cyclonedds.idl`."""
    _define_service(kind)
    package, space, name = kind.split("/")
    fields = {field: _field(shape) for field, shape in messages.definitions().fielddefs[kind][1]}
    made = python_types.new_class(
        name,
        (dds("idl").IdlStruct,),
        {"typename": f"{package}.{space}.dds_.{name}_"},
        lambda body: body.update(__annotations__=fields),
    )
    return dataclass(made)


def _define_service(kind: str) -> None:
    """Adds the request and the answer of a service to the definitions."""
    service, _, part = kind.rpartition("_")
    store = messages.definitions()
    if service in messages.SERVICES and kind not in store.types:
        text = messages.SERVICES[service][part == "Response"]
        (defined,) = require("rosbags.typesys", "ros").get_types_from_msg(SERVICE_HEAD + text, kind).values()
        store.register({kind: defined})


def _field(shape: Any) -> Any:
    """The type of a field: a plain one, a structure, or several of them."""
    sort, what = shape
    types = dds("idl.types")
    if sort.name == "BASE":
        name = BASE_TYPES.get(what[0], what[0])
        return {"bool": bool, "string": str}.get(name) or getattr(types, name)
    if sort.name == "NAME":
        return _struct(what)
    entry, size = _field(what[0]), what[1]
    if sort.name == "ARRAY":
        return types.array[entry, size]
    return types.sequence[entry, size] if size else types.sequence[entry]
