"""Reads the files of a policy, with a limit on their size and errors that name the file."""

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from rover_gym.mechanics import OptionError, RoverGymError
from rover_gym.validation import refuse

# Format version of a policy's files; other versions are refused.
FORMAT = 1


class PolicyError(OptionError):
    """A folder holds no valid policy, or a policy for another environment."""


def refuse_field(path: Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file with an error that names the file and the invalid field."""
    refuse(PolicyError, f"{path}: {field}", value, reason)


@contextmanager
def intact(path: Path) -> Iterator[None]:
    """Turns any exception that a damaged file causes into a `PolicyError` that names the file."""
    try:
        yield
    except (RoverGymError, OSError):
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        refuse(PolicyError, "policy", str(path), reason)


def read_bytes(path: Path, at_most: int) -> bytes:
    """Reads a whole file.

    Raises:
        PolicyError: The file is no regular file, or larger than `at_most` bytes.
        OSError: The file does not exist or may not be read.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # opening a pipe would wait for its writer
        refuse(PolicyError, "policy", str(path), "must be a regular file")
    if status.st_size > at_most:
        refuse_field(path, "size", status.st_size, f"must be at most {at_most} bytes")
    return path.read_bytes()


def is_there(path: Path) -> bool:
    """Whether the path exists; False for an impossible path."""
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long or impossible
        return False
