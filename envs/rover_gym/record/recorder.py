"""Records trajectories in HDF5, an open format that any language reads.

A file describes itself: each data set has the attributes `unit` and `description` (and `columns` where its columns have
names), and the file stores the scene, the ground, the seed, the versions and the solver settings. Rows are written to
the disk during the run, and the file is consistent between flushes, so a run that is killed or fills the disk loses
only its last rows. Reading checks a file's type, links, data types and sizes first.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core import Terrain
from rover_gym.core.validation import TERRAINS, checked, refuse, whole
from rover_gym.record.channels import (
    FRAMES,
    LIBRARY,
    TERRAIN,
    Channel,
    RecordingError,
    file_path,
    storable,
    versions,
    write_attribute,
    write_description,
)
from rover_gym.record.checksums import CHECKSUM, checksum, sum_of_array, sum_of_attributes
from rover_gym.record.steady_file import FileInUseError, SteadyFile, uninterrupted
from rover_gym.record.stored_terrain import write_terrain
from rover_gym.record.trajectory import read_trajectory

if TYPE_CHECKING:
    import h5py

#: Columns of a chunk of a packed data set: with the rows of a flush, about a megabyte.
PACKED_COLUMNS = 4096


class Recorder:
    """Appends rows to an HDF5 file; a context manager.

    Rows are buffered in memory and written `rows_per_flush` at a time. Between flushes the file is consistent, so a
    process killed there leaves a readable file (attribute `complete` false). A full disk ends the recording with an
    error, and the file stays as the previous flush left it. The file is locked until the recorder is closed.

    Args:
        path: The file to create, with its folder. An existing file is replaced when the recorder is closed, unless it
            is being recorded or read; until then the rows are in `NAME.part` beside it, and a full disk leaves it as
            it was.
        channels: The channels of a row.
        attributes: Metadata of the run, stored at the root: strings, numbers and arrays as they are, the rest as JSON;
            `describe` takes them from a simulation.
        terrain: The ground, stored in the group `terrain`; a replay needs it.
        rows_per_flush: Largest number of rows lost if the process is killed.

    Raises:
        RecordingError: A channel or an attribute cannot be stored, or the file is in use; it has not changed.
        OSError: The file cannot be created.
    """

    @checked(
        channels=["Channel"],
        attributes=(Mapping, None),
        terrain=(*TERRAINS, None),
    )
    def __init__(
        self,
        path: str | Path,
        channels: Sequence[Channel],
        attributes: Mapping[str, Any] | None = None,
        *,
        terrain: Terrain | None = None,
        rows_per_flush: int = 200,
    ) -> None:
        import h5py  # noqa: PLC0415 - slow to load

        self.path = file_path(path)
        self._rows_per_flush = whole(
            "rows_per_flush", rows_per_flush, at_least=1, at_most=1_000_000, error=RecordingError
        )
        channels = _checked_channels(channels)
        facts = {**versions(), **storable(attributes or {}), "complete": False}
        self._pending: dict[str, list[npt.NDArray[np.float64]]] = {channel.name: [] for channel in channels}
        self._shapes = {channel.name: channel.shape for channel in channels}
        self._places = {
            channel.name: f"{FRAMES}/{channel.name}" if channel.packed else channel.name for channel in channels
        }
        self._process = os.getpid()
        self._n_rows, self._attributes, self._sums = 0, -1, dict.fromkeys(self._pending, 0)
        self._disk = _new_file(self.path)
        with uninterrupted():
            self._file: h5py.File = h5py.File(self._disk, "w", libver=(LIBRARY, LIBRARY))
            # Close the file before the interpreter exits; later, HDF5 would call Python objects that no longer exist.
            self._release = weakref.finalize(self, _release, self._file, self._disk)
            try:
                self._begin(channels, facts, terrain)
            except BaseException:
                self._give_up()
                raise

    def _begin(self, channels: Sequence[Channel], facts: Mapping[str, Any], terrain: Terrain | None) -> None:
        for key, value in facts.items():
            write_attribute(self._file, key, value)
        for channel in channels:
            most = PACKED_COLUMNS if channel.packed else None
            packing: dict[str, Any] = {"compression": "gzip", "compression_opts": 2, "shuffle": True}
            data = self._file.create_dataset(
                self._places[channel.name],
                shape=(0, *channel.shape),
                # HDF5 has no empty chunks, so an empty channel (the wheels of disks without a machine) is resizable.
                maxshape=(None, *(n or None for n in channel.shape)),
                chunks=(self._rows_per_flush, *(min(n, most or n) or 1 for n in channel.shape)),
                dtype="f4" if channel.packed else "f8",
                fletcher32=True,  # a checksum, so that damaged data is not read as motion
                **(packing if channel.packed else {}),
            )
            write_description(data, channel.unit, channel.description, channel.columns)
        for channel in channels:
            if channel.packed:
                del self._sums[channel.name]
        if terrain is not None:
            sums = write_terrain(self._file.create_group(TERRAIN), terrain)
            self._sums |= {f"{TERRAIN}/{name}": value for name, value in sums.items()}
        self._commit()

    def append(self, row: Mapping[str, npt.ArrayLike]) -> None:
        """Adds one row, with a value for every channel.

        Raises:
            RecordingError: A channel is missing, unknown, not numeric or of another shape, or the recorder is closed;
                nothing was added. Or the rows cannot be written; the recorder is then closed.
        """
        self._must_be_open()
        if row.keys() != self._shapes.keys():
            odd = sorted(map(str, row.keys() ^ self._shapes.keys()))
            refuse(RecordingError, "row", odd, "row and channels differ")
        values = {}
        for name, value in row.items():
            values[name] = _numbers(name, value)
        for name, value in values.items():
            if value.shape != self._shapes[name]:
                refuse(RecordingError, name, value.shape, f"must have its channel's shape {self._shapes[name]}")
        for name, value in values.items():
            self._pending[name].append(value)
        if len(next(iter(self._pending.values()))) >= self._rows_per_flush:
            self.flush()

    def flush(self) -> None:
        """Writes all buffered rows to the disk.

        Raises:
            RecordingError: The recorder is closed, or the rows cannot be written; the recorder is then closed.
        """
        self._must_be_open()
        with uninterrupted():
            for name, rows in self._pending.items():
                if rows:
                    values = np.array(rows)
                    data = self._file[self._places[name]]
                    data.resize(data.shape[0] + len(rows), axis=0)
                    data[-len(rows) :] = values
                    if name in self._sums:
                        self._sums[name] = sum_of_array(values, self._sums[name])
                    self._n_rows = len(data)
                    rows.clear()
                    self._disk.is_worth = True
            self._commit()

    def note(self, **attributes: str | float) -> None:
        """Stores further attributes at the root during the run.

        Raises:
            RecordingError: An attribute cannot be stored, or the recorder is closed.
        """
        self._must_be_open()
        with uninterrupted():
            for key, value in storable(attributes).items():
                write_attribute(self._file, key, value)
            self._attributes = -1

    def close(self) -> None:
        """Writes the buffered rows and marks the file complete; a second call does nothing.

        Raises:
            RecordingError: The last rows cannot be written; the rows written before remain.
        """
        with uninterrupted():
            if self._release.alive:
                self.flush()
                self._file.attrs["complete"] = True
                self._attributes = -1
                self._disk.is_worth = True
                self._commit()
                self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif self._release.alive:  # keep the recorded rows, marked incomplete
            self.flush()
            self._release()

    def _must_be_open(self) -> None:
        if not self._release.alive:
            refuse(RecordingError, "recorder", str(self.path), "is closed, so nothing more can be written")
        if os.getpid() != self._process:
            refuse(RecordingError, "recorder", str(self.path), "belongs to the process that opened it")

    def _commit(self) -> None:
        if self._attributes < 0:  # they have changed
            self._attributes = sum_of_attributes(self._file)
        self._file.attrs.modify(CHECKSUM, checksum(self._n_rows, self._attributes, self._sums))
        try:
            self._file.flush()
            self._disk.commit()
        except OSError as error:
            replaces = self._disk.replaces
            self._give_up()
            rows = 0 if replaces else _rows_on_disk(self.path)
            kept = "the earlier file is as it was" if replaces else f"{rows} rows are on the disk"
            stopped = RecordingError(f"{self.path}: the recording stopped: {error.strerror or str(error)}; {kept}")
            stopped.field, stopped.value = "path", str(self.path)
            raise stopped from error

    def _give_up(self) -> None:
        """Closes the file, and leaves an older one in its place."""
        if self._release.detach() is not None:
            with uninterrupted():
                self._file.close()
                self._disk.give_up()


def _numbers(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Copies a channel's value into a float64 array."""
    try:
        given = np.asarray(value)
    except ValueError:  # rows of unequal length
        refuse(RecordingError, name, value, "must be numbers")
    if given.dtype.kind not in "biuf":
        refuse(RecordingError, name, value, "must be numbers")
    return given.astype(np.float64)


def _new_file(path: Path) -> SteadyFile:
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        return SteadyFile(path)
    except FileInUseError:
        refuse(RecordingError, "path", str(path), "is in use by another recorder or a reader")
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _release(file: h5py.File, disk: SteadyFile) -> None:
    """Closes a file and leaves it on the disk as the last commit wrote it."""
    with uninterrupted():
        file.close()
        disk.close()


def _rows_on_disk(path: Path) -> int:
    try:
        return max(map(len, read_trajectory(path).data.values()))
    except (RecordingError, OSError):
        return 0


def _checked_channels(channels: Sequence[Channel]) -> tuple[Channel, ...]:
    result = tuple(channels)
    names = [channel.name for channel in result]
    if not names:
        refuse(RecordingError, "channels", names, "must not be empty")
    for i, name in enumerate(names):
        if not name or "/" in name or "\0" in name or name in (".", TERRAIN, FRAMES) or name in names[:i]:
            reason = f"must be different names, without / and neither {TERRAIN!r} nor {FRAMES!r}"
            refuse(RecordingError, "channels", name, reason)
    return result
