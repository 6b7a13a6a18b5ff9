"""Sensors from mappings, as the JSON of an environment's specification has them: `{"LaserScanner": {"rays": 90}}`."""

import inspect
from dataclasses import fields
from importlib import import_module
from typing import Any

from rover_gym.core import OptionError
from rover_gym.core.validation import known_keys, mapping, refuse
from rover_gym.envs.sensors.sensor import Mount, Sensor
from rover_gym.envs.spec_json import named_object


def sensor_classes() -> dict[str, type[Sensor]]:
    """The classes of sensors that this room offers, by name."""
    room = import_module("rover_gym.envs.sensors")
    offered = {name: getattr(room, name) for name in room.__all__ if name[0].isupper()}
    return {name: cls for name, cls in offered.items() if issubclass(cls, Sensor) and not inspect.isabstract(cls)}


def sensor_of(field: str, value: object) -> Sensor:
    """The sensor that is given, or that a mapping of its class name to its fields describes.

    Args:
        field: Name of the argument, for messages.
        value: A sensor, or such a mapping.

    Raises:
        OptionError: It is neither, or a field is unknown or out of range.
    """
    if isinstance(value, Sensor):
        return value
    found = named_object(value)
    if found is None:
        refuse(OptionError, field, value, "must be a sensor of rover_gym.envs.sensors, or its class and fields")
    name, given = found
    known = sensor_classes()
    if name not in known:
        refuse(OptionError, field, name, f"unknown class of a sensor; known are {', '.join(known)}")
    return known[name](**_arguments(f"{field}.{name}", known[name], given))


def _arguments(field: str, cls: type[Sensor | Mount], value: object) -> dict[str, Any]:
    """The fields of a mapping, with lists as tuples and mounts as `Mount`."""
    given = mapping(field, value)
    known_keys(field, given, [one.name for one in fields(cls)])
    arguments = {name: tuple(one) if isinstance(one, list) else one for name, one in given.items()}
    mount = named_object(arguments.get("mount"))
    if mount is not None and mount[0] == Mount.__name__:
        arguments["mount"] = Mount(**_arguments(f"{field}.mount.{Mount.__name__}", Mount, mount[1]))
    return arguments
