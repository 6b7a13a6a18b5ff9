"""A model by a name of the gallery or by a file of any known kind."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from rover_gym.mechanics import ModelError, RoverModel
from rover_gym.models.robot_tree import is_urdf
from rover_gym.validation import refuse

#: Kinds of files by their endings.
READERS = {".toml": "from_file", ".urdf": "from_urdf", ".xml": "from_mjcf", ".mjcf": "from_mjcf"}


def open_model(name: object, **options: Any) -> RoverModel:
    """The model of the gallery with this name, or the one in this file.

    Args:
        name: A name of `RoverModel.names`, or a path that ends in .toml, .urdf, .xml or .mjcf. An .xml whose root is
            <robot> is a URDF.
        **options: Those of `RoverModel.from_urdf` or `RoverModel.from_mjcf`.

    Returns:
        The model.

    Raises:
        ModelError: There is no such model, the file is none, or options are given for what takes none.
        OSError: The file cannot be read.
    """
    if not isinstance(name, (str, os.PathLike)):
        refuse(ModelError, "model", name, "must be a name or a path")
    text = os.fsdecode(name)
    path = Path(text)
    kind = READERS.get(path.suffix.lower())
    if kind == "from_mjcf" and is_urdf(path):
        kind = "from_urdf"
    if options and kind not in ("from_urdf", "from_mjcf"):
        refuse(ModelError, "model", text, f"only URDF and MJCF take {', '.join(options)}")
    if kind is not None:
        model: RoverModel = getattr(RoverModel, kind)(path, **options)
        return model
    if text not in RoverModel.names():
        known = f"a name ({', '.join(RoverModel.names())}) or a file that ends in {', '.join(READERS)}"
        refuse(ModelError, "model", text, f"must be {known}")
    return RoverModel.named(text)
