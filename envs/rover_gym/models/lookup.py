"""A model by a name of the gallery or by a file of any known kind."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from rover_gym.core import ModelError, RoverModel
from rover_gym.core.validation import refuse
from rover_gym.models.model_paths import checked_path, is_urdf

if TYPE_CHECKING:
    from rover_gym.models.import_report import ImportReport

#: A model, a name of the gallery or a file, as `as_model` takes it.
ModelLike: TypeAlias = RoverModel | str | os.PathLike[str]

#: Kinds of files by their endings.
KINDS = {".toml": "TOML", ".urdf": "URDF", ".xml": "MJCF", ".mjcf": "MJCF"}


def open_model(name: object, field: str = "model") -> RoverModel:
    """The model of the gallery with this name, or the one in this file.

    Args:
        name: A name of `RoverModel.names`, or a path that ends in .toml, .urdf, .xml or .mjcf. An .xml whose root is
            <robot> is a URDF.
        field: Name of the argument, for messages.

    Returns:
        The model.

    Raises:
        ModelError: There is no such model, or the file does not contain a model.
        OSError: The file cannot be read.
    """
    if not isinstance(name, (str, os.PathLike)):
        refuse(ModelError, field, name, "must be a name or a path")
    path = Path(os.fsdecode(name))
    match _kind(path):
        case "URDF":
            return RoverModel.from_urdf(path)
        case "MJCF":
            return RoverModel.from_mjcf(path)
        case "TOML":
            return RoverModel.from_file(path)
    if str(path) not in RoverModel.names():
        known = f"a name ({', '.join(RoverModel.names())}) or a file that ends in {', '.join(KINDS)}"
        refuse(ModelError, field, str(path), f"must be {known}")
    return RoverModel.named(str(path))


def as_model(field: str, value: object) -> RoverModel:
    """The model that an argument means.

    Args:
        field: Name of the argument.
        value: A model, a name of the gallery, or a file, as `open_model` takes it.

    Raises:
        ModelError: It is none of these, or the file does not contain a model.
        OSError: The file cannot be read.
    """
    if isinstance(value, RoverModel):
        return value
    if not isinstance(value, (str, os.PathLike)):
        refuse(ModelError, field, value, "must be a RoverModel, a name of the gallery or a file")
    return open_model(value, field)


def read_robot(path: object, **options: Any) -> tuple[RoverModel, ImportReport]:
    """Reads a URDF or an MJCF, whichever the file is.

    Args:
        path: A path that ends in .urdf, .xml or .mjcf. An .xml whose root is <robot> is a URDF.
        **options: Those of `read_urdf` or `read_mjcf`.

    Returns:
        The model and the import report.

    Raises:
        ModelError: The file is of another kind, or cannot be read as a robot.
        OSError: The file cannot be read.
    """
    from rover_gym.models.reading import read_mjcf, read_urdf  # noqa: PLC0415 - most models come from the gallery

    place = checked_path(path)
    kind = _kind(place)
    if kind not in ("URDF", "MJCF"):
        refuse(ModelError, "path", str(place), "must end in .urdf, .xml or .mjcf: only URDF and MJCF are imported")
    return read_urdf(place, **options) if kind == "URDF" else read_mjcf(place, **options)


def _kind(path: Path) -> str | None:
    kind = KINDS.get(path.suffix.lower())
    return "URDF" if kind == "MJCF" and is_urdf(path) else kind
