"""The middleware of a node, by its name."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.ros.cyclone_transport import CycloneTransport
from rover_gym.ros.rclpy_transport import RclpyTransport

if TYPE_CHECKING:
    from rover_gym.ros.transport import Transport

MIDDLEWARES = ("auto", "cyclonedds", "rclpy")


def open_transport(middleware: str, name: str, namespace: str = "/") -> Transport:
    """A node of the middleware that is there.

    Args:
        middleware: "rclpy" for the ROS that is sourced, "cyclonedds" for the package that needs none, "auto" for the
            first that is installed.
        name: Name of the node.
        namespace: Its namespace.

    Raises:
        OptionError: `middleware` is none of these, or a name is no ROS name.
        MissingExtraError: What it needs is not installed.
    """
    if middleware not in MIDDLEWARES:
        refuse(OptionError, "middleware", middleware, f"must be one of {', '.join(MIDDLEWARES)}")
    check_name("name", name)
    for part in namespace.strip("/").split("/") if namespace.strip("/") else ():
        check_name("namespace", part)
    space = "/" + namespace.strip("/")
    if middleware == "rclpy" or (middleware == "auto" and importlib.util.find_spec("rclpy") is not None):
        return RclpyTransport(name, space)
    return CycloneTransport(name, space)


def check_name(field: str, name: str) -> None:
    """Refuses a name that ROS does not take: letters, digits and underscores, no digit first."""
    if not (name.isascii() and name.isidentifier()):
        refuse(OptionError, field, name, "must be letters, digits and underscores, and not begin with a digit")
