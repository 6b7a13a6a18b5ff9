"""Reads trajectories, and checks everything in a file before it is used."""

from __future__ import annotations

import itertools
import json
import math
import stat
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
import numpy.typing as npt

from rover_gym.core import RoverGymError, Terrain, Union
from rover_gym.core.validation import refuse
from rover_gym.record.channels import (
    FORMAT,
    FRAMES,
    OBJECTS,
    READ_VERSIONS,
    SIGNATURE,
    TERRAIN,
    RecordingError,
    file_path,
    refuse_field,
    sound,
)
from rover_gym.record.checksums import CHECKSUM, SINCE, checksum, sum_of_array, sum_of_attributes
from rover_gym.record.steady_file import FileInUseError, lock
from rover_gym.record.stored_terrain import MATERIALS, Stored, is_stored, stored_parts

if TYPE_CHECKING:
    from collections.abc import Mapping

    import h5py


#: Largest ratio of decompressed data to file size: admits compressed files, refuses decompression bombs.
LARGEST_EXPANSION = 100
#: Largest such ratio of packed data sets: what deflate can reach, since a bed at rest repeats its rows.
LARGEST_PACKING = 1032
#: Most bytes of frames that one call reads.
MOST_BYTES = 1 << 32


@dataclass(frozen=True)
class Trajectory:
    """A recorded run in memory.

    Attributes:
        data: The data sets by name, (n, ...) float64.
        units: The units of the data sets, by name.
        attributes: Metadata of the run, with JSON values decoded.
        terrain: The ground; None if the file holds none.
        original: Of a run with fewer samples than its file: the whole run, and the indices of these samples in it.
    """

    data: Mapping[str, npt.NDArray[np.float64]]
    units: Mapping[str, str]
    attributes: Mapping[str, Any]
    terrain: Terrain | None = None
    original: tuple[Trajectory, npt.NDArray[np.int64]] | None = None

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        """The data set of a name.

        Raises:
            RecordingError: The run holds no data set of this name.
        """
        if name not in self.data:
            refuse(RecordingError, name, sorted(self.data), "there is no such data set in the run; it contains")
        return self.data[name]

    @property
    def scene(self) -> Mapping[str, Any]:
        """What was simulated, as the attribute `scene` says it; empty if it says nothing."""
        scene = self.attributes.get("scene")
        return scene if isinstance(scene, dict) else {}

    def at(self, rows: npt.NDArray[np.int64]) -> Trajectory:
        """Some samples of the run, by their indices `(n,)`; `original` keeps all of them."""
        whole, kept = (self, rows) if self.original is None else (self.original[0], self.original[1][rows])
        return replace(self, data={name: values[rows] for name, values in self.data.items()}, original=(whole, kept))


def read_trajectory(path: str | Path) -> Trajectory:
    """Reads a file that `Recorder` wrote, complete or not.

    Everything must lie in the file itself: links, external storage and virtual data sets are refused. So is data that
    takes more than `LARGEST_EXPANSION` times the size of the file.

    Raises:
        RecordingError: The file is not a valid trajectory of this format and version, or is being recorded.
        OSError: The file does not exist or may not be read.
    """
    import h5py  # noqa: PLC0415 - slow to load

    path = file_path(path)
    size = check_bytes(path)
    with sound(path), h5py.File(path, "r") as file:
        return _Reader(h5py, path, size).trajectory(file)


def read_frames(path: str | Path, name: str, rows: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
    """Reads rows of a packed data set of a file that `Recorder` wrote, complete or not.

    Args:
        path: The file.
        name: Name of the packed channel.
        rows: Indices of the rows, increasing; all by default.

    Returns:
        (n_rows, ...) float32.

    Raises:
        RecordingError: The file holds no such data set or is damaged, a row is out of range, or the rows take more
            than `MOST_BYTES`.
        OSError: The file does not exist or may not be read.
    """
    import h5py  # noqa: PLC0415 - slow to load

    path = file_path(path)
    size = check_bytes(path)
    with sound(path), h5py.File(path, "r") as file:
        return _Reader(h5py, path, size).frames(file, name, rows)


class _Reader:
    """Reads one file, and checks every item first."""

    def __init__(self, h5py: Any, path: Path, size: int) -> None:
        self._h5py, self._path, self._size = h5py, path, size
        self._room = LARGEST_EXPANSION * size  # bytes that may still be read
        self._sums: dict[str, int] = {}  # of the ground's data sets

    def trajectory(self, file: h5py.File) -> Trajectory:
        if "format" not in file.attrs or "format_version" not in file.attrs:
            refuse(RecordingError, "path", str(self._path), f"is not a {FORMAT}")
        version = self._attribute(file, "format_version")
        if version not in READ_VERSIONS:
            read = " and ".join(map(str, READ_VERSIONS))
            reason = f"is a {FORMAT} of version {version}, this rover-gym reads {read}: record it again"
            refuse(RecordingError, "path", str(self._path), reason)
        if self._attribute(file, "format") != FORMAT:
            refuse(RecordingError, "path", str(self._path), f"is not a {FORMAT}")
        sets, terrain = {}, None
        for name in file:
            item = self._item(file, name)
            if isinstance(item, self._h5py.Dataset):
                self._check(name, item, least_dimensions=1)
                sets[name] = item
            elif name == TERRAIN:
                terrain = self._terrain(item)
        if not sets:
            refuse_field(self._path, "file", None, "holds no data set")
        rows = min(len(data) for data in sets.values())  # a kill during a flush leaves some data sets longer
        stated = self._stated(file, version)
        if stated is not None:
            if not 0 <= stated[0] <= rows:
                self._refuse_sum()
            rows = int(stated[0])
        units = {name: self._attribute(data, "unit") for name, data in sets.items()}
        for name, unit in units.items():
            if not isinstance(unit, str):
                refuse_field(self._path, f"{name}.unit", unit, "must be text")
        attributes = {key: self._decoded(key, self._attribute(file, key)) for key in file.attrs if key != CHECKSUM}
        arrays = {name: np.asarray(data[:rows], dtype=np.float64) for name, data in sets.items()}
        if stated is not None:
            sums = self._sums | {name: sum_of_array(values) for name, values in arrays.items()}
            if not np.array_equal(stated, checksum(rows, sum_of_attributes(file, self._size), sums)):
                self._refuse_sum()
        return Trajectory(data=arrays, units=units, attributes=attributes, terrain=terrain)

    def _stated(self, file: h5py.File, version: object) -> npt.NDArray[np.int64] | None:
        """The file's checksum; None for a file of a version that has none."""
        if version < SINCE:  # type: ignore[operator]
            return None
        stated = np.asarray(self._attribute(file, CHECKSUM))
        if stated.shape != (3,) or stated.dtype != np.int64:
            self._refuse_sum()
        return stated

    def _refuse_sum(self) -> NoReturn:
        reason = "does not fit: the file is damaged, or another program has changed it"
        refuse_field(self._path, CHECKSUM, "another one", reason)

    def frames(self, file: h5py.File, name: str, rows: npt.ArrayLike | None) -> npt.NDArray[np.float32]:
        if FRAMES not in file or name not in self._item(file, FRAMES):
            refuse_field(self._path, f"{FRAMES}/{name}", "nothing", "is not in the file")
        data, field = self._item(file[FRAMES], name), f"{FRAMES}/{name}"
        if not isinstance(data, self._h5py.Dataset) or data.chunks is None:
            refuse_field(self._path, field, type(data).__name__, "must be a data set in chunks")
        self._room = LARGEST_PACKING * self._size
        self._check(field, data, least_dimensions=1, single=True)
        wanted = np.arange(len(data)) if rows is None else np.asarray(rows, dtype=np.int64).reshape(-1)
        if len(wanted) and not (wanted[0] >= 0 and wanted[-1] < len(data) and (np.diff(wanted) > 0).all()):
            refuse_field(self._path, f"{field}, rows", wanted[-1], f"must increase, from 0 to less than {len(data)}")
        shape = (len(wanted), *data.shape[1:])
        if 4 * math.prod(shape) > MOST_BYTES:
            refuse_field(self._path, field, shape, f"take more than {MOST_BYTES >> 30} GiB: read fewer, of the shape")
        result = np.empty(shape, dtype=np.float32)
        step = data.chunks[0]  # a chunk is unpacked once
        for first in range(0, len(data), step):
            low, high = np.searchsorted(wanted, (first, first + step))
            if low < high:
                begin, end = wanted[low], wanted[high - 1] + 1
                result[low:high] = data[begin:end][wanted[low:high] - begin]
        return result

    def _item(self, group: h5py.Group, name: str) -> Any:
        """The item of a name; links and data outside the file are refused."""
        field = f"{group.name.strip('/')}/{name}".strip("/")
        link = group.get(name, getlink=True)
        if not isinstance(link, self._h5py.HardLink):
            refuse_field(self._path, field, type(link).__name__, "must be in the file itself, and not a link")
        item = group[name]
        if isinstance(item, self._h5py.Dataset) and (item.external or item.is_virtual):
            kind = "external storage" if item.external else "a virtual data set"
            refuse_field(self._path, field, kind, "must be in the file itself")
        return item

    def _check(self, field: str, data: h5py.Dataset, *, least_dimensions: int = 0, single: bool = False) -> None:
        """Checks that a data set is an array of float64, or float32 if `single`, no larger than the file can hold."""
        sizes, words = ((4, 8), "float32 or float64") if single else ((8,), "float64")
        size = data.dtype.itemsize
        if data.shape is None or data.dtype.kind != "f" or size not in sizes:
            refuse_field(self._path, field, str(data.dtype), f"must be an array of {words}")
        if not least_dimensions <= len(data.shape) <= 3:
            refuse_field(self._path, field, data.shape, f"must have {least_dimensions} to 3 dimensions")
        self._take(field, data.shape, size)
        if data.chunks is not None:
            self._take(f"{field}, one chunk", data.chunks, size)
            self._check_chunks(field, data)

    def _check_chunks(self, field: str, data: h5py.Dataset) -> None:
        """Refuses chunks of impossible offset or size: HDF5 reads a checksum even from a chunk too short for one."""
        whole = math.prod(data.chunks) * data.dtype.itemsize + 4 * data.fletcher32
        packed = data.compression is not None
        wrong: list[int] = []
        places: set[tuple[int, ...]] = set()

        def look(chunk: Any) -> None:
            fits = 4 < chunk.size <= self._size if packed else chunk.size == whole
            if not fits or chunk.byte_offset + chunk.size > self._size:
                wrong.append(chunk.size)
            if chunk.filter_mask == 0:  # no filter was left out, so that the checksum is read
                places.add(chunk.chunk_offset)

        data.id.chunk_iter(look)
        if wrong:
            refuse_field(self._path, field, wrong[0], "has a chunk that is not in the file, of so many bytes")
        steps = [range(0, n, step) for n, step in zip(data.shape, data.chunks, strict=True)]
        if len(places) < math.prod(map(len, steps)) or not places >= set(itertools.product(*steps)):
            refuse_field(self._path, field, len(places), "lacks chunks, or their checksums; it has")

    def _take(self, field: str, shape: tuple[int, ...], itemsize: int) -> None:
        size = math.prod(shape) * itemsize
        if size > self._room:
            reason = f"is too large for a file of this size, {size} bytes, with the shape"
            refuse_field(self._path, field, shape, reason)
        self._room -= size

    def _attribute(self, item: Any, key: str) -> Any:
        """An attribute's value, a string, a number or an array of them; None if it does not exist."""
        if key not in item.attrs:
            return None
        kind = item.attrs.get_id(key)
        field = f"{item.name.strip('/')}.{key}".strip(".")
        # Text of variable length is stored elsewhere in the file, and HDF5 trusts its stated length.
        if kind.dtype.kind not in "biufS":
            refuse_field(self._path, field, str(kind.dtype), "must be numbers or text of a fixed length")
        self._take(field, kind.shape or (), kind.dtype.itemsize)
        value = item.attrs[key]
        if isinstance(value, bytes):
            return value.decode()
        if isinstance(value, np.ndarray) and value.dtype.kind == "S":
            return [entry.decode() for entry in value.ravel().tolist()]
        return value.item() if isinstance(value, np.generic) else value

    def _decoded(self, key: str, value: Any) -> Any:
        """Decodes a value that was stored as JSON."""
        if not isinstance(value, str) or key == "title":
            return value
        if value[:1] in ("{", "["):
            try:
                result = json.loads(value)
                if "\\u" in value:
                    json.dumps(result, ensure_ascii=False).encode()  # refuse lone surrogates
            except (ValueError, RecursionError) as error:
                refuse_field(self._path, key, value[:40], f"is not JSON ({error}), beginning with")
            if isinstance(result, dict) or key not in OBJECTS:
                return result
        if key in OBJECTS:
            refuse_field(self._path, key, value[:40], "must be a JSON object, beginning with")
        return value

    def _terrain(self, group: h5py.Group) -> Terrain:
        given = {}
        for name in group:
            if is_stored(name):
                data = self._item(group, name)
                if not isinstance(data, self._h5py.Dataset):
                    refuse_field(self._path, f"{TERRAIN}/{name}", "a group", "must be an array of floats")
                self._check(f"{TERRAIN}/{name}", data, single=name.endswith("_heights"))
                values = np.asarray(data[()], dtype=f"f{data.dtype.itemsize}")
                self._sums[f"{TERRAIN}/{name}"] = sum_of_array(values)
                given[name] = Stored(values, {key: self._attribute(data, key) for key in MATERIALS})
        try:
            parts = stored_parts(given)
            if len(parts) > 1:
                return Union(parts)
        except (RoverGymError, ValueError, TypeError, KeyError, IndexError) as error:
            refuse_field(self._path, TERRAIN, sorted(given), f"is not a valid ground ({error}), from")
        if not parts:
            refuse_field(self._path, TERRAIN, sorted(given), "holds neither a plane nor spheres nor a surface")
        return parts[0]


def check_bytes(path: Path) -> int:
    """Makes the checks that do not need HDF5, and returns the file's size."""
    if not stat.S_ISREG(path.stat().st_mode):  # `stat` raises for a missing file; opening a pipe would wait
        refuse(RecordingError, "path", str(path), "is not a regular file")
    with path.open("rb") as file:
        try:
            lock(file.fileno(), shared=True)
        except FileInUseError:
            refuse(RecordingError, "path", str(path), "is still being recorded: close the recorder before reading it")
        begin = file.read(len(SIGNATURE))
    if begin != SIGNATURE:
        refuse(RecordingError, "path", str(path), f"is not a {FORMAT}: not an HDF5 file")
    return path.stat().st_size
