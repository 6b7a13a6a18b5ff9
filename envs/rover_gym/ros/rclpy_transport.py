"""A ROS 2 node by `rclpy`, where a ROS installation is sourced: with its middleware, whichever that is."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from rover_gym.core import OptionError, RoverGymError
from rover_gym.core.validation import refuse
from rover_gym.ros.transport import Delivery, ParameterValue, Publish, same_type

#: Callbacks that are handled at once.
MOST = 100


class RclpyTransport:
    """A node of `rclpy`; `Transport` has its methods.

    Args:
        name: Name of the node.
        namespace: Its namespace, from "/".

    Attributes:
        missing: Types of topics whose package is not installed; nothing is published there.

    Raises:
        OptionError: There is no rclpy: no ROS installation is sourced.
    """

    def __init__(self, name: str, namespace: str = "/") -> None:
        try:
            self._ros = import_module("rclpy")
        except ImportError as error:
            refuse(OptionError, "middleware", "rclpy", f"cannot be imported ({error}); source a ROS installation")
        self._qos = import_module("rclpy.qos")
        self._context = self._ros.Context()
        self._ros.init(context=self._context)
        self._node: Any = self._ros.create_node(name, namespace=namespace, context=self._context)
        self._executor = import_module("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.missing: list[str] = []

    def publisher(self, topic: str, kind: str, delivery: Delivery) -> Publish:
        """Opens a topic."""
        try:
            message = _class_of(kind)
        except ModuleNotFoundError:
            self.missing.append(kind)
            return lambda _data: None
        publish: Publish = self._node.create_publisher(message, topic, self._profile(delivery)).publish
        return publish

    def subscribe(self, topic: str, kind: str, take: Callable[[bytes], None]) -> None:
        """Calls a function in `spin` with each message of a topic."""
        profile = self._profile(Delivery(reliable=False, depth=MOST))
        self._node.create_subscription(_class_of(kind), topic, take, profile, raw=True)

    def serve_trigger(self, name: str, act: Callable[[], str]) -> None:
        """Offers a `std_srvs/srv/Trigger`."""
        self._serve(name, "Trigger", lambda _request: act())

    def serve_switch(self, name: str, act: Callable[[bool], str]) -> None:
        """Offers a `std_srvs/srv/SetBool`."""
        self._serve(name, "SetBool", lambda request: act(request.data))

    def serve_parameters(
        self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]
    ) -> None:
        """Declares the node's parameters."""
        result = import_module("rcl_interfaces.msg").SetParametersResult

        def take(given: Any) -> Any:
            try:
                for one in given:
                    if one.name in values:
                        change(one.name, same_type(one.name, one.value, values[one.name]))
            except RoverGymError as error:
                return result(successful=False, reason=str(error))
            return result(successful=True)

        for name, value in values.items():
            self._node.declare_parameter(name, value)
        self._node.add_on_set_parameters_callback(take)

    def spin(self, seconds: float) -> None:
        """Waits for messages and requests for a time, s, at most, and handles all that have come."""
        end = time.perf_counter() + seconds
        self._executor.spin_once(timeout_sec=seconds)
        for _ in range(MOST):  # `spin_once` handles one callback and does not say whether there was one
            self._executor.spin_once(timeout_sec=0.0)
            if time.perf_counter() >= end:
                break

    def close(self) -> None:
        """Leaves the network."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._ros.shutdown(context=self._context)

    def _serve(self, name: str, kind: str, act: Callable[[Any], str]) -> None:
        def answer(request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, act(request)
            except (RoverGymError, OSError) as error:
                response.success, response.message = False, str(error)
            return response

        self._node.create_service(getattr(import_module("std_srvs.srv"), kind), name, answer)

    def _profile(self, delivery: Delivery) -> Any:
        qos = self._qos
        return qos.QoSProfile(
            depth=delivery.depth,
            reliability=getattr(qos.ReliabilityPolicy, "RELIABLE" if delivery.reliable else "BEST_EFFORT"),
            durability=getattr(qos.DurabilityPolicy, "TRANSIENT_LOCAL" if delivery.latched else "VOLATILE"),
        )


def _class_of(kind: str) -> Any:
    package, space, name = kind.split("/")
    return getattr(import_module(f"{package}.{space}"), name)
