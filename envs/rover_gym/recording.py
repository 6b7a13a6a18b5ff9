"""Trajectories in HDF5, an open format that any language reads.

A file describes itself: each data set carries `unit` and `description` (and `columns` where its columns have names),
the file carries the scene, the ground, the seed, the versions and the solver settings. Rows reach the disk while the
run goes, and between two flushes the file is at rest, so a run that is killed keeps all but the last rows.
"""

from __future__ import annotations

import json
import platform
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import gymnasium
import numpy as np
import numpy.typing as npt

from rover_gym._core import Plane, RoverGymError, RoverModel, Simulation, SphereField, __version__
from rover_gym.extras import require
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import h5py

FORMAT = "rover-gym trajectory"
FORMAT_VERSION = 2
TERRAIN = "terrain"  # the group that holds the ground

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
]


class RecordingError(RoverGymError, ValueError):
    """A file is no trajectory of this format, or does not hold what was asked of it."""


def _import_h5py() -> Any:
    return require("h5py", "demo")


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
            Channel("wheel_torques", "N m", "driving torques, positive drives forward", (n,), wheels),
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
            "steering_set_points": sim.steering,
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "solver_residual": residual,
            "solver_iterations": iterations,
        }


class Recorder:
    """Appends rows to an HDF5 file; a context manager.

    Rows are kept in memory and written `rows_per_flush` at a time. Between two flushes nothing is pending in the file,
    so a process killed there leaves a readable file (attribute `complete` false).

    Args:
        path: The file to make; an existing one is replaced. Its folder is made.
        channels: What a row holds.
        attributes: Facts about the run, stored at the root: strings, numbers and arrays as they are, the rest as JSON;
            `describe` makes them of a simulation.
        terrain: The ground, stored in the group `terrain`; a replay needs it.
        rows_per_flush: How many rows may be lost at a kill.
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
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._rows_per_flush = rows_per_flush
        self._pending: dict[str, list[npt.NDArray[np.float64]]] = {channel.name: [] for channel in channels}
        self._shapes = {channel.name: channel.shape for channel in channels}
        self._file: h5py.File = hdf5.File(self.path, "w")
        root = self._file.attrs
        root["format"] = FORMAT
        root["format_version"] = FORMAT_VERSION
        root["rover_gym_version"] = __version__
        root["numpy_version"] = np.__version__
        root["gymnasium_version"] = gymnasium.__version__
        root["python_version"] = platform.python_version()
        for key, value in (attributes or {}).items():
            plain = isinstance(value, (str, int, float, np.ndarray))
            root[key] = value if plain else json.dumps(value, default=_to_plain)
        root["complete"] = False
        for channel in channels:
            data = self._file.create_dataset(
                channel.name,
                shape=(0, *channel.shape),
                # HDF5 knows no empty chunk: a channel of nothing (the wheels of a soil without a machine) may grow.
                maxshape=(None, *(n or None for n in channel.shape)),
                chunks=(rows_per_flush, *(n or 1 for n in channel.shape)),
                dtype="f8",
            )
            data.attrs["unit"] = channel.unit
            data.attrs["description"] = channel.description
            if channel.columns:
                data.attrs["columns"] = list(channel.columns)
        if terrain is not None:
            _write_terrain(self._file.create_group(TERRAIN), terrain)
        self._file.flush()

    def append(self, row: Mapping[str, npt.ArrayLike]) -> None:
        """Adds one row, with a value for every channel.

        Raises:
            ValueError: A channel is missing, unknown or of another shape. Nothing was added.
        """
        if row.keys() != self._shapes.keys():
            odd = sorted(row.keys() ^ self._shapes.keys())
            raise ValueError(f"row and channels differ in {', '.join(odd)}")
        values = {name: np.array(value, dtype=np.float64) for name, value in row.items()}
        for name, value in values.items():
            if value.shape != self._shapes[name]:
                raise ValueError(f"{name} has shape {value.shape}, its channel {self._shapes[name]}")
        for name, value in values.items():
            self._pending[name].append(value)
        if len(next(iter(self._pending.values()))) >= self._rows_per_flush:
            self.flush()

    def flush(self) -> None:
        """Brings all rows to the disk."""
        for name, rows in self._pending.items():
            if rows:
                data = self._file[name]
                data.resize(data.shape[0] + len(rows), axis=0)
                data[-len(rows) :] = np.array(rows)
                rows.clear()
        self._file.flush()

    def note(self, **attributes: str | float) -> None:
        """Stores facts that are known only now, at the root."""
        for key, value in attributes.items():
            self._file.attrs[key] = value

    def close(self) -> None:
        """Writes what is pending and marks the file complete."""
        if self._file:
            self.flush()
            self._file.attrs["complete"] = True
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        elif self._file:  # what was recorded stays, and stays marked incomplete
            self.flush()
            self._file.close()


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
        """The data set of that name."""
        return self.data[name]


def read_trajectory(path: str | Path) -> Trajectory:
    """Reads a file that `Recorder` wrote, complete or not.

    Raises:
        RecordingError: The file is no trajectory of this format and version.
        OSError: The file is not there or cannot be read.
    """
    h5py = _import_h5py()
    path = Path(path)
    with path.open("rb"):  # a file that is not there, or may not be read, says so itself
        pass
    if not h5py.is_hdf5(path):
        refuse(RecordingError, "path", str(path), f"is no {FORMAT}: not HDF5")
    with h5py.File(path, "r") as file:
        version = file.attrs.get("format_version")
        if file.attrs.get("format") != FORMAT:
            refuse(RecordingError, "path", str(path), f"is no {FORMAT}")
        if version != FORMAT_VERSION:
            reason = f"is a {FORMAT} of version {version}, this rover-gym reads {FORMAT_VERSION}: record it again"
            refuse(RecordingError, "path", str(path), reason)
        sets = {name: data for name, data in file.items() if isinstance(data, h5py.Dataset)}
        rows = min(len(data) for data in sets.values())  # a kill within a flush leaves some a few rows longer
        return Trajectory(
            data={name: data[:rows] for name, data in sets.items()},
            units={name: data.attrs["unit"] for name, data in sets.items()},
            attributes={key: _decode(value) for key, value in file.attrs.items()},
            terrain=_read_terrain(file[TERRAIN]) if TERRAIN in file else None,
        )


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


def _write_terrain(group: h5py.Group, terrain: Plane | SphereField) -> None:
    def write(name: str, value: npt.ArrayLike, unit: str, description: str, columns: Sequence[str] = ()) -> None:
        data = group.create_dataset(name, data=np.asarray(value, dtype=np.float64))
        data.attrs["unit"] = unit
        data.attrs["description"] = description
        if columns:
            data.attrs["columns"] = list(columns)

    field = terrain if isinstance(terrain, SphereField) else None
    plane = terrain if isinstance(terrain, Plane) else terrain.ground
    group.attrs["kind"] = "plane" if field is None else "sphere_field"
    group.attrs["description"] = "the ground, fixed; free is what lies outside all spheres and above the plane"
    axes = ("x", "y", "z")
    if plane is not None:
        write("plane_normal", plane.normal, "1", "unit normal n of the plane, to the free side, world", axes)
        write("plane_offset", plane.offset, "m", "d of the plane n.x + d = 0")
    if field is not None:
        write("sphere_centres", field.centres, "m", "centres of the spheres, world", axes)
        write("sphere_radii", field.radii, "m", "radii of the spheres")


def _read_terrain(group: h5py.Group) -> Plane | SphereField:
    plane = Plane(group["plane_normal"][:], float(group["plane_offset"][()])) if "plane_normal" in group else None
    if "sphere_centres" in group:
        return SphereField(group["sphere_centres"][:], group["sphere_radii"][:], plane)
    if plane is None:
        refuse(RecordingError, TERRAIN, group.attrs.get("kind"), "holds neither a plane nor spheres")
    return plane


def _to_plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory's attributes")


def _decode(value: Any) -> Any:
    if isinstance(value, str) and value[:1] in ("{", "["):
        return json.loads(value)
    return value.item() if isinstance(value, np.generic) else value
