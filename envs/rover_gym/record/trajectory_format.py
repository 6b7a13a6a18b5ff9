"""The file format of trajectories, and the errors for files that violate it."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rover_gym.extras import require
from rover_gym.mechanics import RoverGymError
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from collections.abc import Iterator


FORMAT = "rover-gym trajectory"
FORMAT_VERSION = 3
#: HDF5 format version: the oldest with checksummed metadata; every HDF5 since 2008 reads it.
LIBRARY = "v108"
TERRAIN = "terrain"  # the group that holds the ground
FRAMES = "frames"  # the group that holds the packed data sets
OBJECTS = ("scene", "solver")  # attributes that are JSON objects
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file


class RecordingError(RoverGymError, ValueError):
    """A file is no valid trajectory of this format, lacks the requested data, or cannot be written."""


def import_h5py() -> Any:
    """Imports the module h5py.

    Raises:
        MissingExtraError: h5py is not installed.
    """
    return require("h5py", "record")


def refuse_field(path: str | Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file with an error that names the file and the invalid field."""
    refuse(RecordingError, f"{path}: {field}", value, reason)


def file_path(path: str | Path) -> Path:
    """Checks that a path is a possible file path and returns it.

    Raises:
        RecordingError: No file can have this path.
    """
    try:
        result = Path(path)
        os.fsencode(result)
    except (TypeError, ValueError):
        refuse(RecordingError, "path", path, "must be the path of a file")
    if "\0" in str(result):
        refuse(RecordingError, "path", path, "must not hold the character NUL")
    return result


@contextmanager
def sound(path: str | Path, field: str = "path") -> Iterator[None]:
    """Turns any exception that a damaged file causes into a `RecordingError` that names the file.

    Args:
        path: The file.
        field: The field being read.
    """
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        if field == "path":
            refuse(RecordingError, field, str(path), reason)
        refuse_field(path, field, "what is there", reason)
