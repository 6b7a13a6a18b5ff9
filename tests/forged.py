"""Recordings and saved states that a test changes, whose checksums must not tell it."""

import zlib
from typing import Any

from rover_gym.record.checksums import CHECKSUM


def without_checksum(file: Any) -> None:
    """Makes an open HDF5 file one of version 3, which has no checksum, so that changes are read."""
    file.attrs["format_version"] = 3
    if CHECKSUM in file.attrs:
        del file.attrs[CHECKSUM]


def sealed(body: bytes) -> bytes:
    """The bytes of a snapshot or an episode with the checksum that belongs to them."""
    return body + zlib.crc32(body).to_bytes(4, "little")
