"""The format of recordings: their channels, the sampler that reads rows from a simulation, and errors of files."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import gymnasium
import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverGymError, RoverModel, Simulation, __version__
from rover_gym.core.validation import checked, number, refuse
from rover_gym.ground.terrain_parts import sand_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py

    from rover_gym.core import Terrain


FORMAT = "rover-gym trajectory"
FORMAT_VERSION = 4
READ_VERSIONS = (3, 4)  # 3 has no checksum of attributes
#: HDF5 format version: the oldest with checksummed metadata; every HDF5 since 2008 reads it.
LIBRARY = "v108"
TERRAIN = "terrain"  # the group that holds the ground
FRAMES = "frames"  # the group that holds the packed data sets
OBJECTS = ("scene", "solver")  # attributes that are JSON objects
SIGNATURE = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file


class RecordingError(RoverGymError, ValueError):
    """Error of a file that is not a valid trajectory of this format, lacks the requested data, or cannot be written."""


def refuse_field(path: str | Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file with an error that names the file and the invalid field."""
    refuse(RecordingError, f"{path}: {field}", value, reason)


def file_path(path: str | Path) -> Path:
    """Checks that a path is a possible file path and returns it.

    Raises:
        RecordingError: No file can have this path.
    """
    try:
        result = Path(path)
        os.fsencode(result)
    except (TypeError, ValueError):
        refuse(RecordingError, "path", path, "must be the path of a file")
    if "\0" in str(result):
        refuse(RecordingError, "path", path, "must not hold the character NUL")
    return result


@contextmanager
def sound(path: str | Path, field: str = "path") -> Iterator[None]:
    """Turns any exception that a damaged file causes into a `RecordingError` that names the file.

    Args:
        path: The file.
        field: The field being read.
    """
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        if field == "path":
            refuse(RecordingError, field, str(path), reason)
        refuse_field(path, field, "what is there", reason)


@dataclass(frozen=True)
class Channel:
    """One data set with one row per sample.

    Attributes:
        name: Name of the data set.
        unit: SI unit of all columns, or "1" for a pure number.
        description: Content of a row, with frame and sign.
        shape: Shape of a row, `()` for a scalar.
        columns: Names along the first axis of a row, or empty.
        packed: Whether the data set is large: it is stored in single precision, compressed, in the group `frames`,
            and read by `read_frames`.
        read: Attribute of the sampler that is or gives its row, with dots; empty where the rows are given.
    """

    name: str
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()
    packed: bool = False
    read: str = ""


class Sampler:
    """Steps a simulation between rows, and reads the rows of its channels.

    Attributes:
        sim: The simulation.
        channels: What a row holds.
        steps: Steps since the last row.
        residual: Largest residual since the last row.
        iterations: Iterations since the last row.
        energy: Kinetic and potential energy in the row.
        rows_per_flush: Largest number of rows lost if the process is killed.
        title: Title of a recording that is given none.
        without_seed: What a recording without a seed says of it.
    """

    channels: tuple[Channel, ...]
    rows_per_flush = 200
    title = "a rover"
    without_seed = "none"

    def __init__(self, sim: Any) -> None:
        self.sim = sim
        self.energy: Any = None
        self.clear()

    def describe(self, title: str | None, scene: Mapping[str, Any], seed: int | str | None) -> dict[str, Any]:
        """The attributes of a recording, taken from the simulation at its start; None for those of the kind."""
        return {
            "title": title or self.title,
            "scene": {**scene, **self.scene()},
            "seed": self.without_seed if seed is None else seed,
            "solver": self.settings,
        }

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the solver."""
        settings: dict[str, Any] = self.sim.settings
        return settings

    def scene(self) -> dict[str, Any]:
        """What is simulated, from the simulation at its start."""
        raise NotImplementedError  # each kind of simulation describes its own

    @property
    def terrain(self) -> Terrain | None:
        """The ground that a recording holds; None for none."""
        return getattr(self.sim, "terrain", None)

    def measure(self) -> None:
        """Measures what several channels read."""
        self.energy = self.sim.energy()

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        self.steps, self.residual, self.iterations = 0, 0.0, 0

    def step(self, n: int) -> bool:
        """Takes the steps that the next row covers; returns whether all of them converged to the tolerance.

        Raises:
            StepError: A step failed.
        """
        converged = True
        for _ in range(n):
            report = self.sim.step()
            self.steps += 1
            self.residual = max(self.residual, report.residual)
            self.iterations += report.iterations
            converged &= report.is_converged
            self.gather(report)
        return converged

    def gather(self, report: Any) -> None:
        """Accumulates further quantities of a row from the report of each step."""

    def read(self) -> dict[str, npt.ArrayLike]:
        """One row of `channels`: the current state, and what happened since the previous row."""
        self.measure()
        row = {}
        for channel in self.channels:
            value = attrgetter(channel.read)(self)
            row[channel.name] = value() if callable(value) else value
        self.clear()
        return row


def rover_channels(model: RoverModel, forces: str, force_columns: str) -> tuple[Channel, ...]:
    """What every recording of a rover holds; `forces` is the attribute with the forces on its wheels."""
    wheels = tuple(model.wheel_names)
    n = len(wheels)
    positions = (
        "public coordinates: trunk x, y (up), z (m); roll, heading, pitch, joint angles (rad);"
        " trunk attitude R = Ry(heading) Rz(pitch) Rx(roll)"
    )
    rates = "trunk origin's velocity, world (m/s); trunk's angular velocity, world (rad/s); joint rates (rad/s)"
    of_trunk = ("v_x", "v_y", "v_z", "omega_x", "omega_y", "omega_z")
    torques = "commanded driving torques, positive drives forward; 0 while servos hold the wheels' speeds"
    speeds = "speeds that the wheels' servos hold, positive drives forward; nan while torques drive them"
    return (
        Channel("q", "m, rad", positions, (model.nq,), tuple(model.dof_names), read="rover.q"),
        Channel("v", "m/s, rad/s", rates, (model.nv,), (*of_trunk, *model.dof_names[6:]), read="rover.v"),
        Channel("wheel_forces", "N", force_columns, (n, 3), wheels, read=forces),
        Channel("wheel_centres", "m", "world: x forward, y up, z to the right", (n, 3), wheels, read="wheel_centres"),
        Channel("wheel_torques", "N m", torques, (n,), wheels, read="rover.wheel_torques"),
        Channel("wheel_speed_set_points", "rad/s", speeds, (n,), wheels, read="wheel_speed_set_points"),
        Channel(
            "steering_set_points", "rad", "set-points of the steering controllers", (n,), wheels, read="rover.steering"
        ),
    )


def wheel_solids(model: RoverModel) -> list[str]:
    """Names of the solids that carry the wheels."""
    return [wheel["solid"] for wheel in model.to_dict()["wheels"]]


def speed_set_points(sim: Simulation) -> npt.NDArray[np.float64]:
    """(n_wheels,) speeds that servos hold, rad/s; nan while torques drive the wheels."""
    speeds = sim.wheel_speeds
    return np.full(len(sim.model.wheel_names), np.nan) if speeds is None else speeds


def origins(sim: Simulation, solids: Sequence[str]) -> npt.NDArray[np.float64]:
    """(n, 3) origins of some solids, m, world."""
    poses = sim.poses()
    return np.array([poses[solid][0] for solid in solids]).reshape(-1, 3)


#: Channels of time, energy and the contact solver in every recording; the zero of the energy differs.
TIME = Channel("time", "s", "time since the run's start", read="sim.time")
RESIDUAL = Channel("solver_residual", "1", "largest residual of the contact solver since the last row", read="residual")
ITERATIONS = Channel("solver_iterations", "1", "iterations of the contact solver since the last row", read="iterations")


def energy_channels(whose: str, zero: str) -> tuple[Channel, Channel]:
    """Channels of kinetic and potential energy, with the zero of the potential energy."""
    return (
        Channel("kinetic_energy", "J", f"kinetic energy{whose}", read="energy.kinetic"),
        Channel("potential_energy", "J", f"potential energy, zero with {zero}", read="energy.potential"),
    )


class RoverSampler(Sampler):
    """Samples rows from a simulation.

    Args:
        model: The model of the simulations to sample.
    """

    @checked(model="RoverModel")
    def __init__(self, model: RoverModel) -> None:
        super().__init__(None)
        wheels = tuple(model.wheel_names)
        n = len(wheels)
        self._solids = wheel_solids(model)
        gaps = "distance from wheel to ground, negative where they overlap"
        since = "mean since the last row (in recordings of episodes: of the last step)"
        forces = f"contact force along n (ground to wheel), t (rolling direction), b = t x n, {since}"
        torques = f"torque that each drive gave, {since}, positive drives forward"
        self.channels = (
            TIME,
            *rover_channels(model, "wheel_forces", forces),
            Channel("wheel_gaps", "m", gaps, (n,), wheels, read="sim.wheel_gaps"),
            Channel("motor_torques", "N m", torques, (n,), wheels, read="motor_torques"),
            *energy_channels(" of the whole rover", "all mass centres at the world's origin"),
            RESIDUAL,
            ITERATIONS,
        )

    def describe(self, title: str | None, scene: Mapping[str, Any], seed: int | str | None) -> dict[str, Any]:
        """The attributes of a recording, taken from the simulation at its start; None for those of `describe`."""
        return describe(self.sim, title or self.title, scene, seed=self.without_seed if seed is None else seed)

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        super().clear()
        self._forces = self._torques = np.zeros(())

    def gather(self, report: Any) -> None:  # noqa: ARG002 - the forces are the simulation's
        """Adds the forces and torques of the last step."""
        self._forces = self._forces + self.sim.wheel_forces
        self._torques = self._torques + self.sim.motor_torques

    @property
    def wheel_forces(self) -> npt.NDArray[np.float64]:
        """(n_wheels, 3) mean since the last row, N; of the last step if the sampler took none."""
        return self._forces / self.steps if self.steps else self.rover.wheel_forces

    @property
    def motor_torques(self) -> npt.NDArray[np.float64]:
        """(n_wheels,) mean since the last row, N m; of the last step if the sampler took none."""
        return self._torques / self.steps if self.steps else self.rover.motor_torques

    @property
    def rover(self) -> Simulation:
        """The simulation that is sampled."""
        sim: Simulation = self.sim
        return sim

    @property
    def wheel_centres(self) -> npt.NDArray[np.float64]:
        """(n_wheels, 3) m, world."""
        return origins(self.rover, self._solids)

    @property
    def wheel_speed_set_points(self) -> npt.NDArray[np.float64]:
        """(n_wheels,) rad/s; nan while torques drive the wheels."""
        return speed_set_points(self.rover)

    def row(self, sim: Simulation, *, residual: float = 0.0, iterations: int = 0) -> dict[str, npt.ArrayLike]:
        """Samples one row of `channels`.

        Args:
            sim: The simulation to sample; it is not changed.
            residual: Largest residual since the last row, from the step report.
            iterations: Iterations since the last row, from the step report.
        """
        self.sim, self.residual, self.iterations = sim, residual, iterations
        return self.read()


#: Most rows of a run, which limits file size and run time.
MOST_ROWS = 10_000_000


def versions() -> dict[str, Any]:
    """The file format, and the versions of the software that writes it."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "rover_gym_version": __version__,
        "numpy_version": np.__version__,
        "gymnasium_version": gymnasium.__version__,
        "python_version": platform.python_version(),
    }


def storable(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Converts metadata to what HDF5 stores: strings, numbers and arrays of numbers as they are, the rest as JSON."""
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


@checked(time_step=float)
def row_count(duration: float, time_step: float, steps_per_row: int = 1) -> int:
    """The number of rows of a run after the first.

    Args:
        duration: Simulated time, s.
        time_step: Step size, s.
        steps_per_row: Steps between rows.

    Raises:
        OptionError: `duration` is not a positive number, `steps_per_row` is not a positive whole number, or there would
            be more than `MOST_ROWS` rows.
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


@checked(sim="Simulation", scene=(Mapping, None))
def describe(
    sim: Simulation, title: str, scene: Mapping[str, Any] | None = None, *, seed: int | str = "none"
) -> dict[str, Any]:
    """The attributes of a recording, taken from the simulation at its start.

    Args:
        sim: The simulation, whose model, state, commands and settings are stored.
        title: Title of the run.
        scene: Further parameters of the scene.
        seed: Seed of the run, or why there is none.
    """
    sand = sand_of(sim.terrain)
    return {
        "title": title,
        "scene": {
            **({} if sand is None else {"soil": sand.soil}),
            **(scene or {}),
            "model": sim.model.to_dict(),
            "q": sim.q,
            "steering": sim.steering,
            "wheel_torques": sim.wheel_torques,
            **({} if sim.wheel_speeds is None else {"wheel_speeds": sim.wheel_speeds}),
        },
        "seed": seed,
        "solver": sim.settings,
    }


def write_attribute(item: Any, key: str, value: Any) -> None:
    """Stores an attribute; text is stored as UTF-8 of fixed length."""
    if isinstance(value, str):
        import h5py  # noqa: PLC0415 - slow to load

        text = value.encode()
        item.attrs.create(key, text, dtype=h5py.string_dtype("utf-8", max(1, len(text))))
    else:
        item.attrs[key] = value


def write_description(data: h5py.Dataset, unit: str, description: str, columns: Sequence[str]) -> None:
    """Stores unit, description and column names in a data set's attributes."""
    write_attribute(data, "unit", unit)
    write_attribute(data, "description", description)
    if columns:
        write_texts(data, "columns", columns)


def write_texts(item: Any, key: str, texts: Sequence[str]) -> None:
    """Stores several texts in an attribute."""
    import h5py  # noqa: PLC0415 - slow to load

    encoded = [text.encode() for text in texts]
    item.attrs.create(key, encoded, dtype=h5py.string_dtype("utf-8", max(1, *map(len, encoded))))


def _to_plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory's attributes")


WORDS = {
    "goal": "reached the goal",
    "time": "ran out of time",
    "roll_over": "rolled over",
    "left_field": "left the field",
    "high_centred": "got stuck on its belly",
    "battery": "emptied its battery",
    "step_failed": "could not be simulated further",
}


def outcome_words(end: str) -> str:
    """The end of an episode, as `Episode.end` and a recording's `outcome` name it, in words."""
    return WORDS.get(end, end.replace("_", " "))
