"""Paths of model files, and which kind of file stands there."""

import os
from pathlib import Path

from rover_gym.core import ModelError
from rover_gym.core.validation import refuse, regular_file


def checked_path(path: object) -> Path:
    """Checks a path given by the user.

    Raises:
        ModelError: It is not a path.
    """
    if not isinstance(path, (str, os.PathLike)):
        refuse(ModelError, "path", path, "must be a path")
    return Path(os.fsdecode(path))


def is_urdf(path: Path) -> bool:
    """Whether a file is a URDF, judged by its beginning.

    Raises:
        ModelError: It is no regular file.
        OSError: The file cannot be read.
    """
    with regular_file(path, error=ModelError).open("rb") as file:
        start = file.read(1 << 16)
    place = start.find(b"<robot")
    return place >= 0 and b"<mujoco" not in start[:place]
