"""Damaged files: what a disk, a broken transfer or an unkind hand makes of a sound one.

Every function takes a generator, so that a find comes back with its seed, and returns a new value. The result is
usually, but not always, unlike the given one.

rng = np.random.default_rng(7)
damaged = mutate_bytes(rng, path.read_bytes())
"""

from __future__ import annotations

import copy
import io
import json
import re
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
from forged import without_checksum

from torture.hostile import NUMBERS, TEXTS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import h5py

#: Deeper than Python's recursion limit, and than a parser's that calls itself.
DEEP = 100_000

METRES = np.bytes_(b"m")

UNKIND_BYTES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\xff\xff\xff\xff", b"\xff" * 8, b"\x00" * 8, b"{", b'"', b"\n")


def mutate_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """Flips, cuts, repeats, moves or overwrites parts of a file, one to four times."""
    result = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        change = _BYTE_CHANGES[rng.integers(len(_BYTE_CHANGES))]
        change(rng, result)
    return bytes(result)


def mutate_json(rng: np.random.Generator, text: str) -> str:
    """Changes the value that a JSON text holds, its text, or both."""
    kind = rng.integers(10)
    if kind == 0:
        return mutate_bytes(rng, text.encode()).decode("utf-8", errors="replace")
    if kind == 1:
        depth = int(rng.choice([100, 2000, DEEP]))
        opening, closing = ("[", "]") if rng.random() < 0.5 else ('{"a":', "}")
        return opening * depth + ("" if rng.random() < 0.5 else "0" + closing * depth)
    if kind == 2:
        return "".join(str(TEXTS[rng.integers(len(TEXTS))]) for _ in range(2))
    value = mutate_value(rng, json.loads(text))
    for _ in range(rng.integers(0, 3)):
        value = mutate_value(rng, value)
    # A lone surrogate stays an escape, as JSON allows; Python writes NaN and Infinity, which its reader takes.
    return json.dumps(value)


def mutate_value(rng: np.random.Generator, value: Any) -> Any:
    """A copy of a JSON value with one entry, anywhere in it, changed, dropped, doubled or renamed."""
    root = [copy.deepcopy(value)]  # in a list, so that the value itself has a place too
    places = list(_places(root))
    where, key = places[rng.integers(len(places))]
    kind = rng.integers(6)
    if kind == 0 and where is not root:
        del where[key]
    elif kind == 1 and isinstance(where, dict):
        where[str(key) + "_"] = where.pop(key)
    elif kind == 2:
        where[key] = [where[key]] * int(rng.integers(0, 4))
    elif kind == 3:
        other, other_key = places[rng.integers(len(places))]
        where[key] = copy.deepcopy(other[other_key])
    else:
        where[key] = _unkind(rng)
    return root[0]


def mutate_xml(rng: np.random.Generator, text: str) -> str:
    """Changes attributes and elements of an XML text, or the text itself."""
    if rng.random() < 0.2:
        return mutate_bytes(rng, text.encode()).decode("utf-8", errors="replace")
    if rng.random() < 0.05:
        return text.replace(">", ">" + "<a>" * int(rng.choice([10, 300, DEEP])), 1)
    for _ in range(rng.integers(1, 4)):
        attributes = list(re.finditer(r'(?<=[\w:]=")[^"]*(?=")', text))
        elements = list(re.finditer(r"<(\w+)[^<>]*/>", text))
        kind = rng.integers(5)
        if kind < 3 and attributes:
            place = attributes[rng.integers(len(attributes))]
            other = attributes[rng.integers(len(attributes))][0]
            unkind = str(NUMBERS[rng.integers(len(NUMBERS))])
            words = TEXTS[rng.integers(len(TEXTS))].encode("utf-8", "replace").decode()
            numbers = " ".join([unkind] * int(rng.integers(1, 5)))
            value = (other, numbers, words)[rng.integers(3)]
            text = text[: place.start()] + value + text[place.end() :]
        elif elements:
            place = elements[rng.integers(len(elements))]
            other = elements[rng.integers(len(elements))][0]
            value = ("", place[0] * 2, other)[rng.integers(3)]
            text = text[: place.start()] + value + text[place.end() :]
    return text


def mutate_npz(rng: np.random.Generator, data: bytes) -> bytes:
    """Changes an archive of arrays: one of them, its header, its name, how it is packed, or the bytes of all."""
    if rng.random() < 0.3:
        return mutate_bytes(rng, data)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    names = sorted(members)
    name = names[rng.integers(len(names))]
    kind = rng.integers(6)
    if kind == 0:
        del members[name]
    elif kind == 1:
        members["../" + name] = members.pop(name)
    elif kind == 2:
        members[name] = mutate_bytes(rng, members[name])
    elif kind == 3:
        shape = rng.choice([0, 1, 7, 10**12, 2**62], size=rng.integers(0, 4))
        header = {"descr": str(rng.choice(["<f4", "<f8", "|O", "<U9", "|V0"])), "fortran_order": False}
        members[name] = _npy_header({**header, "shape": tuple(map(int, shape))}) + members[name][128:]
    elif kind == 4:
        array = mutate_array(rng, np.load(io.BytesIO(members[name]), allow_pickle=False))
        members[name] = _npy(array)
    else:
        members[f"{name}.{rng.integers(100)}"] = b"\x00" * 10_000_000  # packs to nothing
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return target.getvalue()


def mutate_array(rng: np.random.Generator, array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """An array of another shape, type or size, or with an odd entry."""
    kind = rng.integers(6)
    if kind == 0:
        return array.reshape(-1)
    if kind == 1:
        return array[..., None]
    if kind == 2:
        return array.astype(str(rng.choice(["f2", "f8", "i8", "?", "c16", "U8", "S4", "O"])))
    if kind == 3:
        return array[: len(array) // 2] if array.ndim else np.empty(0)
    if kind == 4:
        return np.concatenate([array, array]) if array.ndim else np.array([array, array])
    result = np.array(array, dtype=np.float64)
    if result.size:
        result.flat[rng.integers(result.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0])
    return result


def mutate_hdf5(rng: np.random.Generator, path: Path, elsewhere: Path) -> None:
    """Changes an HDF5 file in place: a data set, an attribute, a link, or its bytes.

    Args:
        rng: The generator.
        path: The file, which is sound.
        elsewhere: A file whose content must never show up in what is read from `path`.
    """
    if rng.random() < 0.4:
        path.write_bytes(mutate_bytes(rng, path.read_bytes()))
        return
    import h5py  # noqa: PLC0415 - optional, as it is in the package

    with h5py.File(path, "r+") as file:
        if rng.random() < 0.7:  # otherwise the checksum tells it before anything else does
            without_checksum(file)
        owners = [file, *(item for item in file.values() if isinstance(item, h5py.Group))]
        owner = owners[rng.integers(len(owners))]
        names = sorted(owner)
        if not names or rng.random() < 0.3:
            _mutate_attributes(rng, owner)
        else:
            _HDF5_CHANGES[rng.integers(len(_HDF5_CHANGES))](rng, owner, names[rng.integers(len(names))], elsewhere)


def _flip(rng: np.random.Generator, data: bytearray) -> None:
    for _ in range(rng.integers(1, 9)):
        if data:
            data[rng.integers(len(data))] ^= 1 << rng.integers(8)


def _cut(rng: np.random.Generator, data: bytearray) -> None:
    del data[rng.integers(len(data) + 1) :]


def _remove(rng: np.random.Generator, data: bytearray) -> None:
    start = rng.integers(len(data) + 1)
    del data[start : start + rng.integers(1, 200)]


def _overwrite(rng: np.random.Generator, data: bytearray) -> None:
    start, unkind = rng.integers(len(data) + 1), UNKIND_BYTES[rng.integers(len(UNKIND_BYTES))]
    data[start : start + len(unkind)] = unkind


def _overwrite_head(rng: np.random.Generator, data: bytearray) -> None:
    start, length = rng.integers(min(len(data), 2048) + 1), rng.integers(1, 17)
    data[start : start + length] = rng.bytes(length)


def _double(rng: np.random.Generator, data: bytearray) -> None:
    start = int(rng.integers(len(data) + 1))
    piece = data[start : start + rng.integers(1, 500)]
    data[start:start] = piece


def _move(rng: np.random.Generator, data: bytearray) -> None:
    start, target = rng.integers(len(data) + 1, size=2)
    length = rng.integers(1, 100)
    data[target : target + length] = data[start : start + length]


_BYTE_CHANGES: tuple[Callable[[np.random.Generator, bytearray], None], ...]
_BYTE_CHANGES = (_flip, _cut, _remove, _overwrite, _overwrite_head, _double, _move)


def _places(value: Any) -> Any:
    """All entries below a value as (container, key), without recursion."""
    waiting = [value]
    while waiting:
        container = waiting.pop()
        keys = list(container) if isinstance(container, dict) else range(len(container))
        for key in keys:
            yield container, key
            if isinstance(container[key], dict | list):
                waiting.append(container[key])


def _unkind(rng: np.random.Generator) -> Any:
    kind = rng.integers(4)
    if kind == 0:
        return TEXTS[rng.integers(len(TEXTS))]
    if kind == 1:
        return [None, True, False, [], {}, [[]], {"": None}][rng.integers(7)]
    if kind == 2:
        return [NUMBERS[rng.integers(len(NUMBERS))]] * int(rng.choice([0, 1, 3, 1000]))
    return NUMBERS[rng.integers(len(NUMBERS))]


def _npy(array: np.ndarray[Any, Any]) -> bytes:
    target = io.BytesIO()
    np.save(target, array, allow_pickle=True)
    return target.getvalue()


def _npy_header(header: dict[str, Any]) -> bytes:
    text = repr(header).ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def _mutate_attributes(rng: np.random.Generator, owner: h5py.Group) -> None:
    names = sorted(owner.attrs)
    if not names:
        return
    name = names[rng.integers(len(names))]
    kind = rng.integers(4)
    if kind == 0:
        del owner.attrs[name]
        return
    value = owner.attrs[name]
    text = value.decode(errors="replace") if isinstance(value, bytes) else value
    if kind == 1 and isinstance(text, str) and text[:1] in ("{", "["):
        text = mutate_json(rng, text)
    elif kind == 2:
        owner.attrs[name] = np.array(rng.choice([np.nan, -1.0, 1e300, 7.0]))
        return
    else:
        text = TEXTS[rng.integers(len(TEXTS))]
    data = text.encode("utf-8", errors="replace")[:60_000]
    if rng.random() < 0.8:
        owner.attrs.create(name, np.bytes_(data or b" "))
    else:  # of no fixed length
        owner.attrs[name] = data.replace(b"\x00", b"").decode(errors="replace")


def _hdf5_drop(_rng: np.random.Generator, owner: h5py.Group, name: str, _elsewhere: Path) -> None:
    del owner[name]


def _hdf5_array(rng: np.random.Generator, owner: h5py.Group, name: str, _elsewhere: Path) -> None:
    item = owner[name]
    values = item[()] if hasattr(item, "shape") else np.arange(3.0)
    del owner[name]
    changed = mutate_array(rng, np.asarray(values))
    if changed.dtype.kind in "OU":
        changed = changed.astype("S8")
    data = owner.create_dataset(name, data=changed)
    if rng.random() < 0.7:
        data.attrs["unit"] = METRES


def _hdf5_huge(rng: np.random.Generator, owner: h5py.Group, name: str, _elsewhere: Path) -> None:
    """Two thousand million rows that take no space on the disk."""
    del owner[name]
    shape = (2 * 10**9, *((3,) * int(rng.integers(0, 3))))
    owner.create_dataset(name, shape=shape, chunks=(1000, *shape[1:]), dtype="f8").attrs["unit"] = METRES


def _hdf5_bomb(_rng: np.random.Generator, owner: h5py.Group, name: str, _elsewhere: Path) -> None:
    del owner[name]
    zeros = np.zeros(2_000_000)
    owner.create_dataset(name, data=zeros, compression="gzip", chunks=(1_000_000,)).attrs["unit"] = METRES


def _hdf5_outside(rng: np.random.Generator, owner: h5py.Group, name: str, elsewhere: Path) -> None:
    """The data are another file's: by external storage, by a link, or by a virtual data set."""
    import h5py  # noqa: PLC0415 - as above

    item = owner[name]
    shape = item.shape if isinstance(item, h5py.Dataset) and None not in item.shape else (1,)
    del owner[name]
    kind = rng.integers(4)
    if kind == 0:
        size = int(np.prod(shape, dtype=np.int64)) * 8
        owner.create_dataset(name, shape=shape, dtype="f8", external=[(str(elsewhere), 0, max(size, 8))])
    elif kind == 1:
        owner[name] = h5py.ExternalLink(str(elsewhere), "/")
    elif kind == 2:
        owner[name] = h5py.SoftLink("/" + str(rng.choice(["", name, "nowhere", "time"])))
    else:
        layout = h5py.VirtualLayout(shape=shape or (1,), dtype="f8")
        layout[...] = h5py.VirtualSource(str(elsewhere), "secret", shape=shape or (1,))
        owner.create_virtual_dataset(name, layout)


def _hdf5_kind(rng: np.random.Generator, owner: h5py.Group, name: str, _elsewhere: Path) -> None:
    """Another kind of thing under the name: a group, a loop, a type, nothing, text, ragged rows."""
    import h5py  # noqa: PLC0415 - as above

    del owner[name]
    kind = rng.integers(6)
    if kind == 0:
        owner.create_group(name)
    elif kind == 1:
        owner[name] = owner  # a hard link to the folder itself
    elif kind == 2:
        owner[name] = np.dtype("f8")
    elif kind == 3:
        owner.create_dataset(name, data=h5py.Empty("f8"))
    elif kind == 4:
        owner.create_dataset(name, data=np.array(["text"] * 3, dtype=h5py.string_dtype()))
    else:
        owner.create_dataset(name, shape=(3,), dtype=h5py.vlen_dtype(np.float64))


_HDF5_CHANGES: tuple[Callable[[np.random.Generator, h5py.Group, str, Path], None], ...]
_HDF5_CHANGES = (_hdf5_drop, _hdf5_array, _hdf5_huge, _hdf5_bomb, _hdf5_outside, _hdf5_kind)
