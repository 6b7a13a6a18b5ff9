"""The files of a policy: read whole, never larger than a policy can be, and refused by name."""

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from rover_gym.mechanics import OptionError, RoverGymError
from rover_gym.validation import refuse

# A training file of another make is refused, not misread.
FORMAT = 1


class PolicyError(OptionError):
    """A policy's folder holds no sound policy, or not one for this environment."""


def refuse_field(path: Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file: names it, and in it the field that is not as it must be."""
    refuse(PolicyError, f"{path}: {field}", value, reason)


@contextmanager
def intact(path: Path) -> Iterator[None]:
    """Turns whatever a damaged file makes a library raise into an error that names the file."""
    try:
        yield
    except (RoverGymError, OSError):
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        refuse(PolicyError, "policy", str(path), reason)


def read_bytes(path: Path, at_most: int) -> bytes:
    """All of a file.

    Raises:
        PolicyError: It is no regular file, or larger than `at_most` bytes.
        OSError: It is not there or may not be read.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # to open a pipe would wait for its writer
        refuse(PolicyError, "policy", str(path), "must be a regular file")
    if status.st_size > at_most:
        refuse_field(path, "size", status.st_size, f"must be at most {at_most} bytes")
    return path.read_bytes()


def is_there(path: Path) -> bool:
    """Whether a file of that name exists; False for a name that no file can have."""
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long, or that no file can have
        return False
