"""Specifications of environments as JSON: how their arguments are written, and read back.

An object is written as a mapping of one entry, the name of its class with its fields, for example
`{"Soil": {"name": "mine", "law": "bekker", ...}}`. Environments take such mappings for models, terrains, soils and
sensors. Arrays of more than `LISTED` numbers, or with numbers that are not finite, are written as
their bytes.
"""

from __future__ import annotations

import base64
import binascii
import copy
import dataclasses
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec, WrapperSpec

from rover_gym.core import (
    HeightField,
    OptionError,
    Plane,
    RoverGymError,
    RoverModel,
    SoftGround,
    SphereField,
    Terrain,
    TerrainError,
    TriangleMesh,
    Union,
)
from rover_gym.core.validation import known_keys, mapping, refuse
from rover_gym.ground.sand.soils import Soil

#: Longest array that is written as a list.
LISTED = 100

#: Key of an array that is written as its bytes, and the types that it may have.
ARRAY, TYPES = "array", ("float32", "float64", "uint32", "int64")

#: Arguments of the constructor of each ground, and the attributes that have their values.
GROUNDS: Mapping[str, tuple[type[Terrain], Mapping[str, str]]] = {
    "Plane": (Plane, {"normal": "normal", "offset": "offset"}),
    "SphereField": (
        SphereField,
        {"centres": "centres", "radii": "radii", "ground": "ground", "material": "material"},
    ),
    "HeightField": (
        HeightField,
        {
            "heights": "grid",
            "spacing": "spacing",
            "origin": "origin",
            "material": "material",
            "map_frame": "map_frame",
        },
    ),
    "TriangleMesh": (TriangleMesh, {"vertices": "vertices", "triangles": "triangles", "material": "material"}),
    "SoftGround": (SoftGround, {"surface": "surface", "soil": "soil", "rut_cell": "rut_cell"}),
    "Union": (Union, {"parts": "parts"}),
}


class RoverSpec(EnvSpec):
    """A specification whose `to_json` writes models, terrains, soils and sensors, or says what it cannot write."""

    def to_json(self) -> str:
        """The specification as JSON, from which `EnvSpec.from_json` and `gymnasium.make` make the same environment.

        Raises:
            OptionError: An argument, such as a function, cannot be written; `field` names it.
        """
        plain = copy.copy(self)
        plain.kwargs = {name: as_json(name, value) for name, value in self.kwargs.items()}
        plain.additional_wrappers = tuple(map(_plain_wrapper, self.additional_wrappers))
        return EnvSpec.to_json(plain)


def _plain_wrapper(wrapper: WrapperSpec) -> WrapperSpec:
    kwargs = wrapper.kwargs
    if kwargs is None:
        return wrapper
    named = {name: as_json(f"{wrapper.name}.{name}", value) for name, value in kwargs.items()}
    return dataclasses.replace(wrapper, kwargs=named)


def rover_spec(spec: EnvSpec | None) -> RoverSpec | None:
    """A copy of a specification with the `to_json` of `RoverSpec`."""
    if spec is None or isinstance(spec, RoverSpec):
        return spec
    made = copy.copy(spec)
    made.__class__ = RoverSpec
    return made  # type: ignore[return-value] # it is one now


def as_json(field: str, value: object) -> Any:  # noqa: RET503 - `refuse` does not return
    """A value of an argument in the types that JSON has.

    Args:
        field: Its name, for messages.
        value: A number, a text, a path, an array, a model, a terrain, a soil, a sensor, or lists and mappings of them.

    Raises:
        OptionError: It is, or contains, anything else.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    if isinstance(value, np.ndarray):
        return _array_as_json(field, value)
    if isinstance(value, (list, tuple)):
        return [as_json(f"{field}[{i}]", one) for i, one in enumerate(value)]
    if isinstance(value, Mapping):
        return {str(name): as_json(f"{field}.{name}", one) for name, one in value.items()}
    kind = type(value).__name__
    if isinstance(value, RoverModel):
        return {kind: as_json(field, value.to_dict())}
    if isinstance(value, Terrain) and kind in GROUNDS:
        attributes = GROUNDS[kind][1]
        return {kind: {name: as_json(f"{field}.{name}", getattr(value, of)) for name, of in attributes.items()}}
    if dataclasses.is_dataclass(value) and type(value).__module__.startswith("rover_gym."):
        fields = (one.name for one in dataclasses.fields(value) if one.init)
        return {kind: {name: as_json(f"{field}.{name}", getattr(value, name)) for name in fields}}
    refuse(OptionError, field, value, f"{kind} cannot be written as JSON: make the environment without it")


def _array_as_json(field: str, value: npt.NDArray[Any]) -> Any:
    if value.dtype.name not in TYPES:
        refuse(OptionError, field, value, f"an array of {value.dtype.name} cannot be written as JSON")
    if value.size <= LISTED and np.isfinite(value).all():
        return value.tolist()
    own = value.astype(value.dtype.newbyteorder("<"))
    data = base64.b64encode(own.tobytes()).decode("ascii")
    return {ARRAY: {"type": value.dtype.name, "shape": list(value.shape), "base64": data}}


def array_from_json(field: str, value: object) -> Any:
    """An array that `as_json` has written as its bytes; any other value unchanged.

    Raises:
        OptionError: The entries do not describe an array.
    """
    if not (isinstance(value, Mapping) and value.keys() == {ARRAY}):
        return value
    given = mapping(f"{field}.{ARRAY}", value[ARRAY])
    known_keys(f"{field}.{ARRAY}", given, ("type", "shape", "base64"))
    if given.get("type") not in TYPES:
        refuse(OptionError, f"{field}.{ARRAY}.type", given.get("type"), f"must be one of {', '.join(TYPES)}")
    try:
        data = base64.b64decode(given["base64"], validate=True)
        kind = np.dtype(given["type"])
        return np.frombuffer(data, kind.newbyteorder("<")).reshape(given["shape"]).astype(kind)
    except (KeyError, TypeError, ValueError, binascii.Error) as error:
        refuse(OptionError, field, value, f"is no array: {error}")


def named_object(value: object) -> tuple[str, Any] | None:
    """Class name and fields of an object that `as_json` has written; None for any other value."""
    if isinstance(value, Mapping) and len(value) == 1:
        ((name, fields),) = value.items()
        if isinstance(name, str):
            return name, fields
    return None


def terrain_from_json(field: str, value: object) -> Any:
    """The terrain that a mapping describes, see `as_json`; any other value unchanged.

    Raises:
        TerrainError: The mapping describes no terrain.
        OptionError: A field is unknown, or its array is damaged.
    """
    found = named_object(value)
    if found is None:
        return value
    name, fields = found
    if name not in GROUNDS:
        refuse(TerrainError, field, name, f"unknown class of a terrain; known are {', '.join(GROUNDS)}")
    cls, attributes = GROUNDS[name]
    given = _fields(f"{field}.{name}", fields, attributes)
    for part in ("ground", "surface"):
        if part in given:
            given[part] = terrain_from_json(f"{field}.{name}.{part}", given[part])
    if isinstance(given.get("parts"), list):
        given["parts"] = [terrain_from_json(f"{field}.{name}.parts[{i}]", one) for i, one in enumerate(given["parts"])]
    return _made(cls, f"{field}.{name}", given, TerrainError)


def soil_from_json(field: str, value: object) -> Any:
    """The soil that a mapping describes, see `as_json`; any other value unchanged.

    Raises:
        OptionError: The mapping describes no soil.
    """
    found = named_object(value)
    if found is None:
        return value
    name, fields = found
    if name != "Soil":
        refuse(OptionError, field, name, "unknown class of a soil; known is Soil")
    given = _fields(f"{field}.{name}", fields, [one.name for one in dataclasses.fields(Soil)])
    return _made(Soil, f"{field}.{name}", given, OptionError)


def model_from_json(value: object) -> Any:
    """The model that a mapping describes, see `as_json`; any other value unchanged.

    Raises:
        ModelError: The mapping describes no model.
    """
    found = named_object(value)
    return RoverModel.from_dict(found[1]) if found is not None and found[0] == "RoverModel" else value


def _fields(field: str, fields: object, known: Iterable[str]) -> dict[str, Any]:
    given = mapping(field, fields)
    known_keys(field, given, known)
    return {name: array_from_json(f"{field}.{name}", one) for name, one in given.items()}


def _made(make: Callable[..., Any], field: str, given: Mapping[str, Any], error: type[RoverGymError]) -> Any:
    """An object with these fields; a missing one is refused like a wrong one."""
    try:
        return make(**given)
    except RoverGymError:
        raise
    except (TypeError, ValueError) as wrong:
        refuse(error, field, given, str(wrong))
