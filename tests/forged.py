"""Recordings that a test changes."""

from typing import Any

from rover_gym.record.checksums import CHECKSUM


def without_checksum(file: Any) -> None:
    """Makes an open HDF5 file one of version 3, which has no checksum, so that changes are read."""
    file.attrs["format_version"] = 3
    if CHECKSUM in file.attrs:
        del file.attrs[CHECKSUM]
