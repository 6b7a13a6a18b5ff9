"""Configurations of trainings: YAML files whose keys and values are all checked, and those of the package."""

import dataclasses
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from rover_gym.core import OptionError
from rover_gym.core.validation import number, refuse
from rover_gym.envs.arguments import ARGUMENTS

T = TypeVar("T")


def environment_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Converts YAML's lists to tuples for `RoverEnv` and refuses unknown names."""
    for name in arguments:
        if name not in ARGUMENTS:
            refuse(OptionError, f"environment.{name}", name, f"unknown; known are {', '.join(sorted(ARGUMENTS))}")
    return {name: tuple(value) if isinstance(value, list) else value for name, value in arguments.items()}


def build(cls: type[T], given: object, prefix: str) -> T:
    """Builds a dataclass from a mapping."""
    if not isinstance(given, Mapping):
        refuse(OptionError, prefix.rstrip(".") or "config", given, "must be a mapping")
    assert is_dataclass(cls)  # noqa: S101 - configurations are dataclasses
    known = {entry.name: entry for entry in fields(cls)}
    hints = get_type_hints(cls)
    for name in given:
        if name not in known:
            refuse(OptionError, f"{prefix}{name}", name, f"unknown; known are {', '.join(known)}")
    for name, entry in known.items():
        if name not in given and entry.default is MISSING and entry.default_factory is MISSING:
            refuse(OptionError, f"{prefix}{name}", None, "must be given")
    values = {name: _value(hints[name], value, f"{prefix}{name}") for name, value in given.items()}
    return cls(**values)


def _value(kind: Any, given: object, name: str) -> Any:
    """Converts a value to the type of its field."""
    if isinstance(kind, types.UnionType):  # X | None
        return None if given is None else _value(get_args(kind)[0], given, name)
    if dataclasses.is_dataclass(kind):
        return build(kind, given, f"{name}.")  # type: ignore[arg-type]
    if kind is bool:
        if not isinstance(given, bool):
            refuse(OptionError, name, given, "must be true or false")
        return given
    if kind is str:
        if not isinstance(given, str):
            refuse(OptionError, name, given, "must be a text")
        return given
    if kind is int:
        whole = number(name, given)
        if not whole.is_integer():
            refuse(OptionError, name, given, "must be a whole number")
        return int(whole)
    if kind is float:
        # YAML 1.1 reads 3e-4 as a string.
        return number(name, _as_float(given))
    if not isinstance(given, Mapping):
        refuse(OptionError, name, given, "must be a mapping")
    return {key: _as_float(value) if isinstance(value, str) else value for key, value in given.items()}


def _as_float(given: object) -> object:
    try:
        return float(given) if isinstance(given, str) else given
    except ValueError:
        return given


def plain(value: Any) -> Any:
    """Converts tuples to lists, for YAML."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return value


FOLDER = Path(__file__).parents[1] / "data" / "configs"

#: Their names.
SHIPPED_CONFIGURATIONS = tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def find_configuration(config: str) -> Path:
    """The file of a configuration.

    Args:
        config: A name among `SHIPPED_CONFIGURATIONS`, or the path of a YAML file. A file wins over a name.

    Raises:
        OptionError: There is neither.
    """
    path = Path(config)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # a path that cannot be
        pass
    if config not in SHIPPED_CONFIGURATIONS:
        refuse(
            OptionError, "configuration", config, f"must be a YAML file or one of {', '.join(SHIPPED_CONFIGURATIONS)}"
        )
    return FOLDER / f"{config}.yaml"
