"""The services of a node's parameters, as `ros2 param` and clients of `rcl_interfaces` call them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rover_gym.core import CommandError, RoverGymError
from rover_gym.core.validation import refuse
from rover_gym.ros import messages
from rover_gym.ros.transport import ParameterValue, same_type

#: Number and field of each type in `rcl_interfaces/msg/ParameterValue`.
TYPES: dict[type, tuple[int, str]] = {
    bool: (1, "bool_value"),
    int: (2, "integer_value"),
    float: (3, "double_value"),
    str: (4, "string_value"),
}
UNSET = 0


class Parameters:
    """The parameters of a node, and the functions of its services: from a request to the fields of the answer.

    Args:
        values: The first values.
        change: Called with a name and a value, of the old one's type, before it is taken; may raise `RoverGymError`.
    """

    def __init__(self, values: Mapping[str, ParameterValue], change: Callable[[str, ParameterValue], None]) -> None:
        self._values, self._change = dict(values), change

    def services(self) -> dict[str, Callable[[Any], dict[str, Any]]]:
        """The functions by the type of the service."""
        kinds = {
            "ListParameters": self._listed,
            "GetParameters": lambda request: {"values": [self._value(name) for name in request.names]},
            "GetParameterTypes": self._types,
            "DescribeParameters": lambda request: {"descriptors": [self._described(name) for name in request.names]},
            "SetParameters": lambda request: {"results": [self._set(one) for one in request.parameters]},
        }
        return {f"rcl_interfaces/srv/{kind}": answer for kind, answer in kinds.items()}

    def _listed(self, _request: Any) -> dict[str, Any]:
        kind = "rcl_interfaces/msg/ListParametersResult"
        return {"result": messages.make(kind, names=sorted(self._values), prefixes=[])}

    def _number(self, name: str) -> int:
        return TYPES[type(self._values[name])][0] if name in self._values else UNSET

    def _types(self, request: Any) -> dict[str, Any]:
        return {"types": np.array([self._number(name) for name in request.names], np.uint8)}

    def _value(self, name: str) -> Any:
        found = value_message()
        if name in self._values:
            found.type, field = TYPES[type(self._values[name])]
            setattr(found, field, self._values[name])
        return found

    def _described(self, name: str) -> Any:
        return messages.make(
            "rcl_interfaces/msg/ParameterDescriptor",
            name=name,
            type=self._number(name),
            description="",
            additional_constraints="",
            read_only=False,
            dynamic_typing=False,
            floating_point_range=[],
            integer_range=[],
        )

    def _set(self, parameter: Any) -> Any:
        kind = "rcl_interfaces/msg/SetParametersResult"
        try:
            self._take(parameter.name, parameter.value)
        except RoverGymError as error:
            return messages.make(kind, successful=False, reason=str(error))
        return messages.make(kind, successful=True, reason="")

    def _take(self, name: str, given: Any) -> None:
        if name not in self._values:
            refuse(CommandError, "name", name, f"must be one of {', '.join(sorted(self._values))}")
        fields = dict(TYPES.values())
        value = getattr(given, fields[given.type]) if given.type in fields else None
        if value is None:
            refuse(CommandError, name, given.type, "must be a flag, a number or a text")
        value = same_type(name, value, self._values[name])
        self._change(name, value)
        self._values[name] = value


def value_message() -> Any:
    """A `rcl_interfaces/msg/ParameterValue` that is not set."""
    return messages.make(
        "rcl_interfaces/msg/ParameterValue",
        type=UNSET,
        bool_value=False,
        integer_value=0,
        double_value=0.0,
        string_value="",
        byte_array_value=np.zeros(0, np.uint8),
        bool_array_value=np.zeros(0, np.bool_),
        integer_array_value=np.zeros(0, np.int64),
        double_array_value=np.zeros(0, np.float64),
        string_array_value=[],
    )
