"""The checksums of a recording: of all its attributes, and of all rows that a reader takes whole.

HDF5 has checksums of most of its own structure and, where a writer wants them, of the chunks of data sets. Long
attributes have none, nor has the index of the chunks. The root attribute `checksum` has three whole numbers: the number
of rows, the CRC-32 of the attributes and the CRC-32 of the data.
"""

from __future__ import annotations

import json
import math
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import h5py

#: The attribute, and the version of the format from which on every file has it.
CHECKSUM, SINCE = "checksum", 4


def raw_attribute(item: Any, key: str, most: int) -> npt.NDArray[Any]:
    """An attribute as the file holds it.

    Raises:
        ValueError: It is of a kind that no recording has, or larger than `most` bytes.
    """
    kind = item.attrs.get_id(key)
    if kind.dtype.kind not in "biufS" or math.prod(kind.shape or ()) * kind.dtype.itemsize > most:
        raise ValueError(f"the attribute {key} is none of a recording")
    value = np.empty(kind.shape or (), kind.dtype)
    kind.read(value)
    return value


def sum_of_attributes(file: h5py.File, most: int = 1 << 31) -> int:
    """CRC-32 of the names, types and values of all attributes of a file, except the checksum itself.

    Args:
        file: The file.
        most: Most bytes of an attribute.

    Raises:
        ValueError: An attribute is of a kind that no recording has, or larger.
    """
    total = 0
    for path, item in _items("", file):
        for key in sorted(item.attrs):
            if (path, key) != ("", CHECKSUM):
                value = raw_attribute(item, key, most)
                head = json.dumps([path, key, value.dtype.str, value.shape])
                total = zlib.crc32(value.tobytes(), zlib.crc32(head.encode(), total))
    return total


def _items(path: str, group: Any) -> Iterator[tuple[str, Any]]:
    """The group and everything in it, in the order of their names; links are left out."""
    yield path, group
    for name in sorted(group):
        if type(group.get(name, getlink=True)).__name__ != "HardLink":
            continue
        item = group[name]
        if hasattr(item, "keys") and path.count("/") == 0:
            yield from _items(f"{path}/{name}", item)
        elif hasattr(item, "shape"):
            yield f"{path}/{name}", item


def sum_of_array(values: npt.NDArray[Any], before: int = 0) -> int:
    """CRC-32 of an array's bytes, continued from that of the rows before."""
    plain = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return zlib.crc32(plain.tobytes(), before)


def checksum(rows: int, attributes: int, arrays: Mapping[str, int]) -> npt.NDArray[np.int64]:
    """The value of the attribute: arrays by name, with their CRC-32 of the first `rows` rows."""
    text = json.dumps(sorted(arrays.items()))
    return np.array([rows, attributes, zlib.crc32(text.encode())], dtype=np.int64)
