"""Trajectories in HDF5, an open format that any language reads.

A file describes itself: each data set carries `unit` and `description` (and `columns` where its columns have names),
the file carries the scene, the ground, the seed, the versions and the solver settings. Rows reach the disk while the
run goes, and between two flushes the file is at rest, so a run that is killed, or that fills the disk, keeps all but
the last rows. A file is read only after its kind, its links, its types and its sizes have been checked.
"""

from __future__ import annotations

import json
import math
import os
import platform
import stat
import weakref
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn, Self

import gymnasium
import numpy as np
import numpy.typing as npt

from rover_gym._core import OptionError, Plane, RoverGymError, RoverModel, Simulation, SphereField, __version__
from rover_gym.extras import require
from rover_gym.steady_file import FileInUseError, SteadyFile, lock
from rover_gym.validation import number, refuse, whole

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import h5py

FORMAT = "rover-gym trajectory"
FORMAT_VERSION = 3
#: Of HDF5's own format: the oldest whose descriptions carry checksums; every HDF5 since 2008 reads it.
LIBRARY = "v108"
TERRAIN = "terrain"  # the group that holds the ground
OBJECTS = ("scene", "solver")  # attributes that are JSON objects

#: Rows of a run; more, and neither the disk nor the user's patience holds them.
MOST_ROWS = 10_000_000

#: What a file says it holds is at most so many times as large as the file: packed files are read, bombs are not.
LARGEST_EXPANSION = 100

SIGNATURE = b"\x89HDF\r\n\x1a\n"  # an HDF5 file begins so

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "Channel",
    "Recorder",
    "RecordingError",
    "Sampler",
    "Trajectory",
    "describe",
    "read_trajectory",
    "row_count",
    "sound",
]


class RecordingError(RoverGymError, ValueError):
    """A file is no sound trajectory of this format, does not hold what was asked of it, or cannot be written."""


def _import_h5py() -> Any:
    return require("h5py", "demo")


def _refuse(path: str | Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file: names it, and in it the field that is not as it must be."""
    refuse(RecordingError, f"{path}: {field}", value, reason)


@dataclass(frozen=True)
class Channel:
    """One data set: a row per sample.

    Attributes:
        name: The data set's name.
        unit: SI unit, or "1" for a pure number; one for all columns.
        description: What a row holds, its frame and sign.
        shape: Shape of a row, `()` for a scalar.
        columns: Names along the first axis of a row, or empty.
    """

    name: str
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()


class Sampler:
    """Makes rows of a simulation.

    Args:
        model: The model of the simulations to look at.
    """

    def __init__(self, model: RoverModel) -> None:
        wheels = tuple(model.wheel_names)
        n = len(wheels)
        self._wheel_solids = [wheel["solid"] for wheel in model.to_dict()["wheels"]]
        self.channels = (
            Channel("time", "s", "time since the run's start"),
            Channel(
                "q",
                "m, rad",
                "public coordinates: trunk x, y (up), z (m); roll, heading, pitch, joint angles (rad);"
                " trunk attitude R = Ry(heading) Rz(pitch) Rx(roll)",
                (model.nq,),
                tuple(model.dof_names),
            ),
            Channel(
                "v",
                "m/s, rad/s",
                "trunk origin's velocity, world (m/s); trunk's angular velocity, world (rad/s); joint rates (rad/s)",
                (model.nv,),
                ("v_x", "v_y", "v_z", "omega_x", "omega_y", "omega_z", *model.dof_names[6:]),
            ),
            Channel("wheel_gaps", "m", "distance from wheel to ground, negative where they overlap", (n,), wheels),
            Channel(
                "wheel_forces",
                "N",
                "mean contact force of the last step along n (ground to wheel), t (rolling direction), b = t x n",
                (n, 3),
                wheels,
            ),
            Channel("wheel_centres", "m", "world: x forward, y up, z to the right", (n, 3), wheels),
            Channel("wheel_torques", "N m", "commanded driving torques, positive drives forward", (n,), wheels),
            Channel(
                "motor_torques",
                "N m",
                "mean torque that each drive gave in the last step, positive drives forward",
                (n,),
                wheels,
            ),
            Channel("steering_set_points", "rad", "set-points of the steering controllers", (n,), wheels),
            Channel("kinetic_energy", "J", "kinetic energy of the whole rover"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at the world's origin"),
            Channel("solver_residual", "1", "worst natural-map residual of the contact solver since the last row"),
            Channel("solver_iterations", "1", "iterations of the contact solver since the last row"),
        )

    def row(self, sim: Simulation, *, residual: float = 0.0, iterations: int = 0) -> dict[str, npt.ArrayLike]:
        """One row of `channels`.

        Args:
            sim: The simulation to look at; it is not changed.
            residual: Worst residual since the last row, from the step's report.
            iterations: Iterations since the last row, from the step's report.
        """
        energy = sim.energy()
        poses = sim.poses()
        return {
            "time": sim.time,
            "q": sim.q,
            "v": sim.v,
            "wheel_gaps": sim.wheel_gaps,
            "wheel_forces": sim.wheel_forces,
            "wheel_centres": np.array([poses[solid][0] for solid in self._wheel_solids]),
            "wheel_torques": sim.wheel_torques,
            "motor_torques": sim.motor_torques,
            "steering_set_points": sim.steering,
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "solver_residual": residual,
            "solver_iterations": iterations,
        }


class Recorder:
    """Appends rows to an HDF5 file; a context manager.

    Rows are kept in memory and written `rows_per_flush` at a time. Between two flushes nothing is pending in the file,
    so a process killed there leaves a readable file (attribute `complete` false). A full disk ends the recording with
    an error, and the file stays as the flush before left it. The file is locked until the recorder is closed.

    Args:
        path: The file to make; an existing one is replaced, unless it is being recorded or read. Its folder is made.
        channels: What a row holds.
        attributes: Facts about the run, stored at the root: strings, numbers and arrays as they are, the rest as JSON;
            `describe` makes them of a simulation.
        terrain: The ground, stored in the group `terrain`; a replay needs it.
        rows_per_flush: How many rows may be lost at a kill.

    Raises:
        RecordingError: A channel or an attribute cannot be stored, or the file is in use. It was not changed.
        OSError: The file cannot be made.
        MissingExtraError: h5py is not installed.
    """

    def __init__(
        self,
        path: str | Path,
        channels: Sequence[Channel],
        attributes: Mapping[str, Any] | None = None,
        *,
        terrain: Plane | SphereField | None = None,
        rows_per_flush: int = 200,
    ) -> None:
        hdf5 = _import_h5py()
        self.path = _path(path)
        self._rows_per_flush = whole(
            "rows_per_flush", rows_per_flush, at_least=1, at_most=1_000_000, error=RecordingError
        )
        channels = _checked_channels(channels)
        facts = {**_versions(), **_storable(attributes or {}), "complete": False}
        self._pending: dict[str, list[npt.NDArray[np.float64]]] = {channel.name: [] for channel in channels}
        self._shapes = {channel.name: channel.shape for channel in channels}
        self._process = os.getpid()
        self._disk = _new_file(self.path)
        self._file: h5py.File = hdf5.File(self._disk, "w", libver=(LIBRARY, LIBRARY))
        # The file must be closed before the interpreter ends, as HDF5 would call what is no longer there.
        self._release = weakref.finalize(self, _release, self._file, self._disk)
        try:
            self._begin(channels, facts, terrain)
        except BaseException:
            self._release()
            raise

    def _begin(
        self, channels: Sequence[Channel], facts: Mapping[str, Any], terrain: Plane | SphereField | None
    ) -> None:
        for key, value in facts.items():
            _describe(self._file, key, value)
        for channel in channels:
            data = self._file.create_dataset(
                channel.name,
                shape=(0, *channel.shape),
                # HDF5 knows no empty chunk: a channel of nothing (the wheels of a soil without a machine) may grow.
                maxshape=(None, *(n or None for n in channel.shape)),
                chunks=(self._rows_per_flush, *(n or 1 for n in channel.shape)),
                dtype="f8",
                fletcher32=True,  # a checksum, so that damage is no motion
            )
            _describe_all(data, channel.unit, channel.description, channel.columns)
        if terrain is not None:
            _write_terrain(self._file.create_group(TERRAIN), terrain)
        self._commit()

    def append(self, row: Mapping[str, npt.ArrayLike]) -> None:
        """Adds one row, with a value for every channel.

        Raises:
            RecordingError: A channel is missing, unknown, not numbers or of another shape, or the recorder is closed:
                nothing was added. Or the rows cannot be written: the recorder is closed.
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
        """Brings all rows to the disk.

        Raises:
            RecordingError: They cannot be written, and the recorder is now closed; or it was closed before.
        """
        self._must_be_open()
        for name, rows in self._pending.items():
            if rows:
                data = self._file[name]
                data.resize(data.shape[0] + len(rows), axis=0)
                data[-len(rows) :] = np.array(rows)
                rows.clear()
        self._commit()

    def note(self, **attributes: str | float) -> None:
        """Stores facts that are known only now, at the root.

        Raises:
            RecordingError: A fact cannot be stored, or the recorder is closed.
        """
        self._must_be_open()
        for key, value in _storable(attributes).items():
            _describe(self._file, key, value)

    def close(self) -> None:
        """Writes what is pending and marks the file complete; nothing where that was done.

        Raises:
            RecordingError: The last rows cannot be written; what was written before stays.
        """
        if self._release.alive:
            self.flush()
            self._file.attrs["complete"] = True
            self._commit()
            self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif self._release.alive:  # what was recorded stays, and stays marked incomplete
            self.flush()
            self._release()

    def _must_be_open(self) -> None:
        if not self._release.alive:
            refuse(RecordingError, "recorder", str(self.path), "is closed: a run that is finished takes no more")
        if os.getpid() != self._process:
            refuse(RecordingError, "recorder", str(self.path), "belongs to the process that opened it")

    def _commit(self) -> None:
        try:
            self._file.flush()
            self._disk.commit()
        except OSError as error:
            self._release()
            reason = error.strerror or str(error)
            stopped = RecordingError(
                f"{self.path}: the recording stopped: {reason}; {_rows_on_disk(self.path)} rows are on the disk"
            )
            stopped.field, stopped.value = "path", str(self.path)
            raise stopped from error


@dataclass(frozen=True)
class Trajectory:
    """A recorded run in memory.

    Attributes:
        data: The data sets by name, (n, ...) float64.
        units: Their units.
        attributes: What the file says of the run; JSON values are decoded.
        terrain: The ground, or None where the file holds none.
    """

    data: Mapping[str, npt.NDArray[np.float64]]
    units: Mapping[str, str]
    attributes: Mapping[str, Any]
    terrain: Plane | SphereField | None = None

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        """The data set of that name.

        Raises:
            RecordingError: There is none.
        """
        if name not in self.data:
            refuse(RecordingError, name, sorted(self.data), "the run holds no such data set; it holds")
        return self.data[name]


def read_trajectory(path: str | Path) -> Trajectory:
    """Reads a file that `Recorder` wrote, complete or not.

    Nothing is followed out of the file: links, external storage and virtual data sets are refused. Neither is anything
    read that is larger than `LARGEST_EXPANSION` times the file.

    Raises:
        RecordingError: The file is no sound trajectory of this format and version, or is being recorded.
        OSError: The file is not there or may not be read.
        MissingExtraError: h5py is not installed.
    """
    h5py = _import_h5py()
    path = _path(path)
    size = _check_bytes(path)
    with sound(path), h5py.File(path, "r") as file:
        return _Reader(h5py, path, size).trajectory(file)


class _Reader:
    """Reads one file, and only what it has checked."""

    def __init__(self, h5py: Any, path: Path, size: int) -> None:
        self._h5py, self._path, self._size = h5py, path, size
        self._room = LARGEST_EXPANSION * size  # bytes that may still be read

    def trajectory(self, file: h5py.File) -> Trajectory:
        if "format" not in file.attrs or "format_version" not in file.attrs:
            refuse(RecordingError, "path", str(self._path), f"is no {FORMAT}")
        version = self._attribute(file, "format_version")
        if version != FORMAT_VERSION:
            reason = f"is a {FORMAT} of version {version}, this rover-gym reads {FORMAT_VERSION}: record it again"
            refuse(RecordingError, "path", str(self._path), reason)
        if self._attribute(file, "format") != FORMAT:
            refuse(RecordingError, "path", str(self._path), f"is no {FORMAT}")
        sets, terrain = {}, None
        for name in file:
            item = self._item(file, name)
            if isinstance(item, self._h5py.Dataset):
                self._check(name, item, least_dimensions=1)
                sets[name] = item
            elif name == TERRAIN:
                terrain = self._terrain(item)
        if not sets:
            _refuse(self._path, "file", None, "holds no data set")
        rows = min(len(data) for data in sets.values())  # a kill within a flush leaves some a few rows longer
        units = {name: self._attribute(data, "unit") for name, data in sets.items()}
        for name, unit in units.items():
            if not isinstance(unit, str):
                _refuse(self._path, f"{name}.unit", unit, "must be text")
        return Trajectory(
            data={name: np.asarray(data[:rows], dtype=np.float64) for name, data in sets.items()},
            units=units,
            attributes={key: self._decoded(key, self._attribute(file, key)) for key in file.attrs},
            terrain=terrain,
        )

    def _item(self, group: h5py.Group, name: str) -> Any:
        """What is in the file under a name; what is elsewhere is refused."""
        field = f"{group.name.strip('/')}/{name}".strip("/")
        link = group.get(name, getlink=True)
        if not isinstance(link, self._h5py.HardLink):
            _refuse(self._path, field, type(link).__name__, "must be in the file itself, and not a link")
        item = group[name]
        if isinstance(item, self._h5py.Dataset) and (item.external or item.is_virtual):
            kind = "external storage" if item.external else "a virtual data set"
            _refuse(self._path, field, kind, "must be in the file itself")
        return item

    def _check(self, field: str, data: h5py.Dataset, *, least_dimensions: int = 0) -> None:
        """Refuses what is no array of float64, or larger than the file can hold."""
        if data.shape is None or data.dtype.kind != "f" or data.dtype.itemsize != 8:
            _refuse(self._path, field, str(data.dtype), "must be an array of float64")
        if not least_dimensions <= len(data.shape) <= 3:
            _refuse(self._path, field, data.shape, f"must have {least_dimensions} to 3 dimensions")
        self._take(field, data.shape, 8)
        if data.chunks is not None:
            self._take(f"{field}, one chunk", data.chunks, 8)
            self._check_chunks(field, data)

    def _check_chunks(self, field: str, data: h5py.Dataset) -> None:
        """Refuses chunks whose place or size cannot be: HDF5 reads the checksum at the end of what has none."""
        whole = math.prod(data.chunks) * 8 + 4 * data.fletcher32
        packed = data.compression is not None
        wrong: list[int] = []

        def look(chunk: Any) -> None:
            fits = 4 < chunk.size <= self._size if packed else chunk.size == whole
            if not fits or chunk.byte_offset + chunk.size > self._size:
                wrong.append(chunk.size)

        data.id.chunk_iter(look)
        if wrong:
            _refuse(self._path, field, wrong[0], "has a chunk that is not in the file, of so many bytes")

    def _take(self, field: str, shape: tuple[int, ...], itemsize: int) -> None:
        size = math.prod(shape) * itemsize
        if size > self._room:
            reason = f"is too large for a file of this size, {size} bytes, with the shape"
            _refuse(self._path, field, shape, reason)
        self._room -= size

    def _attribute(self, item: Any, key: str) -> Any:
        """An attribute's value, a string, a number or an array of them; None where there is none."""
        if key not in item.attrs:
            return None
        kind = item.attrs.get_id(key)
        field = f"{item.name.strip('/')}.{key}".strip(".")
        # Text of no fixed length lies elsewhere in the file, and HDF5 believes whatever length is stated.
        if kind.dtype.kind not in "biufS":
            _refuse(self._path, field, str(kind.dtype), "must be numbers or text of a fixed length")
        self._take(field, kind.shape or (), kind.dtype.itemsize)
        value = item.attrs[key]
        if isinstance(value, bytes):
            return value.decode()
        if isinstance(value, np.ndarray) and value.dtype.kind == "S":
            return [entry.decode() for entry in value.ravel().tolist()]
        return value.item() if isinstance(value, np.generic) else value

    def _decoded(self, key: str, value: Any) -> Any:
        """A value that was stored as JSON, as it was."""
        if not isinstance(value, str) or key == "title":
            return value
        if value[:1] in ("{", "["):
            try:
                result = json.loads(value)
                if "\\u" in value:
                    json.dumps(result, ensure_ascii=False).encode()  # half a pair of surrogates is no text
            except (ValueError, RecursionError) as error:
                _refuse(self._path, key, value[:40], f"is no JSON ({error}), beginning with")
            if isinstance(result, dict) or key not in OBJECTS:
                return result
        if key in OBJECTS:
            _refuse(self._path, key, value[:40], "must be a JSON object, beginning with")
        return value

    def _terrain(self, group: h5py.Group) -> Plane | SphereField:
        names = ("plane_normal", "plane_offset", "sphere_centres", "sphere_radii")
        given = {}
        for name in names:
            if name in group:
                data = self._item(group, name)
                if not isinstance(data, self._h5py.Dataset):
                    _refuse(self._path, f"{TERRAIN}/{name}", "a group", "must be an array of float64")
                self._check(f"{TERRAIN}/{name}", data)
                given[name] = np.asarray(data[()], dtype=np.float64)
        try:
            plane = None
            if "plane_normal" in given:
                plane = Plane(given["plane_normal"], given["plane_offset"].item())
            if "sphere_centres" in given:
                return SphereField(given["sphere_centres"], given["sphere_radii"], plane)
        except (RoverGymError, ValueError, TypeError, KeyError) as error:
            _refuse(self._path, TERRAIN, sorted(given), f"is no ground ({error}), from")
        if plane is None:
            _refuse(self._path, TERRAIN, sorted(given), "holds neither a plane nor spheres")
        return plane


def _path(path: str | Path) -> Path:
    try:
        result = Path(path)
        os.fsencode(result)
    except (TypeError, ValueError):
        refuse(RecordingError, "path", path, "must be the path of a file")
    if "\0" in str(result):
        refuse(RecordingError, "path", path, "must not hold the character NUL")
    return result


def _check_bytes(path: Path) -> int:
    """Checks what can be without HDF5, and returns the file's size."""
    if not stat.S_ISREG(path.stat().st_mode):  # one that is not there says so itself; to open a pipe would wait
        refuse(RecordingError, "path", str(path), "is no regular file")
    with path.open("rb") as file:
        try:
            lock(file.fileno(), shared=True)
        except FileInUseError:
            refuse(RecordingError, "path", str(path), "is being recorded: it can be read when the recorder is closed")
        begin = file.read(len(SIGNATURE))
    if begin != SIGNATURE:
        refuse(RecordingError, "path", str(path), f"is no {FORMAT}: not HDF5")
    return path.stat().st_size


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
        _refuse(path, field, "what is there", reason)


def _numbers(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """A copy of a channel's value."""
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
        refuse(RecordingError, "path", str(path), "is in use: another recorder writes it, or someone reads it")
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _release(file: h5py.File, disk: SteadyFile) -> None:
    """Closes a file, and leaves on the disk what the last commit wrote."""
    file.close()
    disk.close()


def _rows_on_disk(path: Path) -> int:
    try:
        return max(map(len, read_trajectory(path).data.values()))
    except (RecordingError, OSError):
        return 0


def _versions() -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "rover_gym_version": __version__,
        "numpy_version": np.__version__,
        "gymnasium_version": gymnasium.__version__,
        "python_version": platform.python_version(),
    }


def _checked_channels(channels: Sequence[Channel]) -> tuple[Channel, ...]:
    result = tuple(channels)
    names = [channel.name for channel in result]
    if not names:
        refuse(RecordingError, "channels", names, "must not be empty")
    for i, name in enumerate(names):
        if not name or "/" in name or "\0" in name or name in (".", TERRAIN) or name in names[:i]:
            refuse(RecordingError, "channels", name, f"must be names of their own, without / and not {TERRAIN!r}")
    return result


def _storable(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Facts in a form that HDF5 takes: strings, numbers, arrays of numbers, and JSON for the rest."""
    result: dict[str, Any] = {}
    for key, value in attributes.items():
        plain = isinstance(value, (str, float, np.number)) or (
            (isinstance(value, int) and -(2**63) <= value < 2**63)
            or (isinstance(value, np.ndarray) and value.dtype.kind in "biuf")
        )
        try:
            stored = value if plain else json.dumps(value, default=_to_plain)
            if isinstance(stored, str):
                stored.encode()
        except (TypeError, ValueError, RecursionError) as error:
            refuse(RecordingError, str(key), value, f"cannot be stored ({error})")
        if isinstance(stored, str) and "\0" in stored:
            refuse(RecordingError, str(key), value, "must not hold the character NUL")
        result[key] = stored
    return result


def row_count(duration: float, time_step: float, steps_per_row: int = 1) -> int:
    """How many rows a run has after its first.

    Args:
        duration: s.
        time_step: s.
        steps_per_row: From one row to the next.

    Raises:
        OptionError: `duration` is no positive number, `steps_per_row` no positive whole number, or the rows are more
            than `MOST_ROWS`.
    """
    seconds = number("duration", duration, above=0.0)
    per_row = number("steps_per_row", steps_per_row, at_least=1.0)
    if per_row != math.floor(per_row):
        refuse(OptionError, "steps_per_row", steps_per_row, "must be a whole number")
    rows = seconds / time_step / per_row
    if not rows <= MOST_ROWS:
        reason = f"at a step of {time_step:g} s makes more than {MOST_ROWS} rows"
        refuse(OptionError, "duration", duration, reason)
    return round(rows)


def describe(
    sim: Simulation, title: str, scene: Mapping[str, Any] | None = None, *, seed: int | str = "none"
) -> dict[str, Any]:
    """The attributes of a recording, from the simulation at its start.

    Args:
        sim: The simulation; its model, state, commands and settings are described.
        title: What is run, in words.
        scene: What else the scene was made from.
        seed: Seed of the run, or why there is none.
    """
    return {
        "title": title,
        "scene": {
            **(scene or {}),
            "model": sim.model.to_dict(),
            "q": sim.q,
            "steering": sim.steering,
            "wheel_torques": sim.wheel_torques,
        },
        "seed": seed,
        "solver": sim.settings,
    }


def _describe(item: Any, key: str, value: Any) -> None:
    """Stores an attribute: text in UTF-8, of a fixed length."""
    if isinstance(value, str):
        text = value.encode()
        item.attrs.create(key, text, dtype=_import_h5py().string_dtype("utf-8", max(1, len(text))))
    else:
        item.attrs[key] = value


def _describe_all(data: h5py.Dataset, unit: str, description: str, columns: Sequence[str]) -> None:
    _describe(data, "unit", unit)
    _describe(data, "description", description)
    if columns:
        names = [name.encode() for name in columns]
        data.attrs.create("columns", names, dtype=_import_h5py().string_dtype("utf-8", max(1, *map(len, names))))


def _write_terrain(group: h5py.Group, terrain: Plane | SphereField) -> None:
    def write(name: str, value: npt.ArrayLike, unit: str, description: str, columns: Sequence[str] = ()) -> None:
        values = np.asarray(value, dtype=np.float64)
        data = group.create_dataset(name, data=values, **({"fletcher32": True} if values.size and values.ndim else {}))
        _describe_all(data, unit, description, columns)

    field = terrain if isinstance(terrain, SphereField) else None
    plane = terrain if isinstance(terrain, Plane) else terrain.ground
    _describe(group, "kind", "plane" if field is None else "sphere_field")
    _describe(group, "description", "the ground, fixed; free is what lies outside all spheres and above the plane")
    axes = ("x", "y", "z")
    if plane is not None:
        write("plane_normal", plane.normal, "1", "unit normal n of the plane, to the free side, world", axes)
        write("plane_offset", plane.offset, "m", "d of the plane n.x + d = 0")
    if field is not None:
        write("sphere_centres", field.centres, "m", "centres of the spheres, world", axes)
        write("sphere_radii", field.radii, "m", "radii of the spheres")


def _to_plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory's attributes")
