"""What files of trajectories are: their format, and how one that is not sound is refused."""

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
#: Of HDF5's own format: the oldest whose descriptions carry checksums; every HDF5 since 2008 reads it.
LIBRARY = "v108"
TERRAIN = "terrain"  # the group that holds the ground
OBJECTS = ("scene", "solver")  # attributes that are JSON objects
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # an HDF5 file begins so


class RecordingError(RoverGymError, ValueError):
    """A file is no sound trajectory of this format, does not hold what was asked of it, or cannot be written."""


def import_h5py() -> Any:
    """The module h5py.

    Raises:
        MissingExtraError: It is not installed.
    """
    return require("h5py", "demo")


def refuse_field(path: str | Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file: names it, and in it the field that is not as it must be."""
    refuse(RecordingError, f"{path}: {field}", value, reason)


def file_path(path: str | Path) -> Path:
    """A path that a file can have.

    Raises:
        RecordingError: No file can.
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
    """Turns whatever a damaged file makes a library raise into an error that names the file.

    Args:
        path: The file.
        field: What is read from it.
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
