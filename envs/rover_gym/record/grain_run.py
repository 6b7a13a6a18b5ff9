"""Recordings of balls in space, alone or under a rover, and the saved runs read back.

Positions are stored in single precision. A grain keeps its stored place until it has moved by the resolution, so that
a bed at rest repeats its rows and compresses to almost nothing.

run = open_run("grains.h5").resample(25.0)
run.positions[-1, :, 1].max()
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import (
    Drum,
    GrainSimulation,
    OptionError,
    Plane,
    RoverGrainSimulation,
    RoverModel,
    Silo,
    Simulation,
)
from rover_gym.core.validation import refuse
from rover_gym.ground.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.ground.grains.moving_window import MovingWindow
from rover_gym.record.bed_run import bed_channels, strongest_contacts
from rover_gym.record.channels import (
    ITERATIONS,
    TIME,
    Channel,
    RecordingError,
    Sampler,
    origins,
    rover_channels,
    sound,
    speed_set_points,
    wheel_solids,
)
from rover_gym.record.rover_run import RoverRun
from rover_gym.record.run import LARGEST, Array, Run, are_sizes, check_rows, is_moderate, width_of
from rover_gym.record.trajectory import Trajectory, read_frames

if TYPE_CHECKING:
    from rover_gym.core import Terrain


#: What may stand around the balls: the classes, and the properties that a recording stores.
VESSELS = {
    "drum": (Drum, ("radius", "length", "rate", "centre")),
    "silo": (Silo, ("radius", "floor", "hole", "axis")),
}


def stored_vessel(vessel: Drum | Silo | None) -> dict[str, Any] | None:
    """A vessel as JSON holds it; None for none."""
    for kind, (cls, names) in VESSELS.items():
        if isinstance(vessel, cls):
            return {"kind": kind, **{name: getattr(vessel, name) for name in names}}
    return None


def checked_vessel(vessel: Any) -> dict[str, Any] | None:
    """A vessel as a recording stores it; None for none.

    Raises:
        ValueError: It is no vessel; so do TypeError and KeyError.
    """
    if vessel is None:
        return None
    result = {"kind": vessel["kind"]}
    for name in VESSELS[vessel["kind"]][1]:
        value = np.array(vessel[name], dtype=np.float64)
        is_place, is_open = name in ("centre", "axis"), name == "floor" and vessel[name] is None
        if not is_open and (value.ndim != is_place or not is_moderate(value)):
            raise ValueError(f"{name} is not finite, too large or of a wrong shape")
        result[name] = None if is_open else value.tolist()
    return result


#: Balls in space, alone or under a rover.
Recordable: TypeAlias = GrainSimulation | RoverGrainSimulation | MovingWindow

KIND = "GrainSimulation"
#: Most contacts of a row that are recorded: the strongest ones, which carry a wheel or hold a heap.
MOST_CHAINS = 128
#: Share of the smallest radius by which a stored position may be off.
RESOLUTION = 1.0 / 250.0


def _both(sim: Recordable) -> tuple[GrainSimulation | MovingWindow, Simulation | None]:
    """All the balls, and the rover among them."""
    if isinstance(sim, GrainSimulation):
        return sim, None
    if not hasattr(sim, "grains") or not hasattr(sim, "rover"):
        refuse(OptionError, "sim", sim, "must be a GrainSimulation, a RoverGrainSimulation or a MovingWindow")
    return (sim if isinstance(sim, MovingWindow) else sim.grains), sim.rover


class StoredPlaces:
    """Positions as they are stored: a grain keeps its place until it has moved by the resolution.

    Args:
        radius: (n,) m.
    """

    def __init__(self, radius: Array) -> None:
        self.resolution = 2.0 ** math.floor(math.log2(RESOLUTION * float(radius.min())))
        self._stored: Array | None = None

    def of(self, position: Array) -> Array:
        """(n, 3) multiples of the resolution, m."""
        rounded = np.round(position / self.resolution) * self.resolution
        if self._stored is not None:
            still = (np.abs(position - self._stored) < self.resolution).all(axis=1)
            rounded[still] = self._stored[still]
        self._stored = rounded
        return rounded


def grain_channels(balls: int, walls: int, model: RoverModel | None, chains: int) -> tuple[Channel, ...]:
    """The channels of so many balls, walls and strongest contacts, with a rover among them or without."""
    strongest = " of the last step: from x, y, z to x, y, z (m), force"
    counted = "most contacts of a step since the last row"
    forces = "force of balls and ground on each wheel, world x, y, z, mean since the last row"
    centres = "centre of each ball: x forward, y up, z right"
    normals = "a point of each wall and the normal to its free side"
    return (
        replace(TIME, read="grains.time"),
        Channel("position", "m", centres, (balls, 3), packed=True, read="places"),
        Channel("walls", "m, 1", normals, (walls, 6), read="grains.walls"),
        Channel("n_asleep", "1", "number of balls that sleep", read="n_asleep"),
        *bed_channels((chains, 7), strongest, counted, packed=True),
        ITERATIONS,
        *(() if model is None else rover_channels(model, "wheel_forces", forces)),
    )


class GrainSampler(Sampler):
    """Steps balls, alone or under a rover, from row to row and makes the rows for a `Recorder`.

    Args:
        sim: A `GrainSimulation`, a `RoverGrainSimulation` or a `MovingWindow`.
    """

    rows_per_flush = 16  # 0.6 s at 25 frames a second
    title = "balls in space"

    def __init__(self, sim: Recordable) -> None:
        self.grains, self.rover = _both(sim)
        model = None if self.rover is None else self.rover.model
        self._stored = StoredPlaces(self.grains.radius)
        self._solids = [] if model is None else wheel_solids(model)
        self._contacts = sim if isinstance(sim, GrainSimulation) else sim.grains
        self._n_chains = min(MOST_CHAINS, 4 * len(self.grains.radius))
        super().__init__(sim)
        self.channels = grain_channels(len(self.grains.radius), len(self.grains.walls), model, self._n_chains)

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        super().clear()
        self.n_contacts, self._impulses = 0, np.zeros((len(self._solids), 3))

    def gather(self, report: Any) -> None:
        """Adds the contacts and the wheels' impulses of a step."""
        self.n_contacts = max(self.n_contacts, report.n_contacts)
        if self.rover is not None:
            self._impulses += wheel_impulses(self.rover)

    def measure(self) -> None:
        """Measures what several channels read."""
        self.energy = self.grains.energy()
        if self.rover is not None:
            both = self.energy, self.rover.energy()
            self.energy = SimpleNamespace(
                kinetic=sum(energy.kinetic for energy in both), potential=sum(energy.potential for energy in both)
            )

    def places(self) -> Array:
        """(n, 3) places as they are stored, m."""
        return self._stored.of(self.grains.position)

    def n_asleep(self) -> int:
        """Number of balls that sleep."""
        return int(np.count_nonzero(self.grains.asleep))

    def force_chains(self) -> Array:
        """(n_chains, 7) the strongest contacts of the last step, see `strongest_contacts`."""
        grains = self._contacts
        contacts = grains.contacts
        strengths = np.linalg.norm(contacts.world_impulses.reshape(-1, 3), axis=1) / grains.time_step
        bodies, points = contacts.bodies.reshape(-1, 2), contacts.points.reshape(-1, 3)
        return strongest_contacts(self._n_chains, bodies, points, strengths, grains.position)

    def wheel_forces(self) -> Array:
        """(n_wheels, 3) mean force on each wheel since the last row, N."""
        return self._impulses / (max(self.steps, 1) * self.grains.time_step)

    def wheel_speed_set_points(self) -> Array:
        """(n_wheels,) rad/s; nan while torques drive the wheels."""
        return np.zeros(0) if self.rover is None else speed_set_points(self.rover)

    def wheel_centres(self) -> Array:
        """(n_wheels, 3) m, world."""
        return np.zeros((0, 3)) if self.rover is None else origins(self.rover, self._solids)

    @property
    def terrain(self) -> Terrain | None:
        """The ground of rover and balls, or of the balls."""
        return self.grains.terrain if self.rover is None else self.rover.terrain

    def scene(self) -> dict[str, Any]:
        """How the balls are stored, the vessel and the rover."""
        return {
            "kind": KIND,
            "resolution": self._stored.resolution,
            "chains": self._n_chains,
            "vessel": stored_vessel(self.grains.vessel),
            **({} if self.rover is None else {"model": self.rover.model.to_dict()}),
        }

    def describe(self, title: str | None, scene: Mapping[str, Any], seed: int | str | None) -> dict[str, Any]:
        """The attributes of a recording, taken from the simulation at its start; None for those of the kind."""
        grains = self.grains
        return super().describe(title, scene, seed) | {
            "grain_radius": np.asarray(grains.radius, dtype=np.float64),
            "grain_mass": np.asarray(grains.mass, dtype=np.float64),
            "grain_kinematic": np.asarray(grains.kinematic, dtype=np.uint8),
        }

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the solver, which are the balls'."""
        return self.grains.settings


def wheel_impulses(rover: Simulation) -> Array:
    """(n_wheels, 3) impulse of balls and ground on each wheel in the last step, world, N s."""
    contacts = rover.contacts
    impulses = np.zeros((len(rover.model.wheel_radii), 3))
    touching = contacts.wheels >= 0
    # The rows of a contact frame are n, t, b: a world impulse is the sum of its components times the rows.
    world = np.einsum("ci,cij->cj", contacts.impulses[touching], contacts.frames[touching])
    np.add.at(impulses, contacts.wheels[touching], world)
    return impulses


@dataclass(frozen=True)
class GrainRun(Run):
    """A recorded run of balls, alone or under a rover.

    Attributes:
        trajectory: The data sets and attributes of the file, but for the balls' places.
        path: The file; the balls' places are read from it when they are first asked for.
        radius: (n_balls,) m.
        mass: (n_balls,) kg.
        kinematic: (n_balls,) whether no force moves the ball.
        terrain: The fixed ground; None if there is none but the walls.
        model: The rover; None without one.
        vessel: The drum or silo around the balls, by the names of its properties, with its `kind`; None without one.
    """

    MISSING = "contains no balls in space; `rover grains` records such runs"

    path: Path
    radius: Array
    mass: Array
    kinematic: npt.NDArray[np.bool_]
    terrain: Terrain | None
    model: RoverModel | None
    vessel: Mapping[str, Any] | None

    @classmethod
    def is_scene(cls, scene: Mapping[str, Any]) -> bool:
        """Whether a file with this scene is a run of balls in space."""
        return scene.get("kind") == KIND

    @classmethod
    def _checked(cls, trajectory: Trajectory, path: str | Path) -> Self:
        scene = trajectory.scene
        radius, mass, kinematic = (_of_balls(trajectory, path, name) for name in ("radius", "mass", "kinematic"))
        if not are_sizes(radius) or len(radius) != len(mass):
            reason = "must be a positive radius for each of the balls"
            refuse(RecordingError, f"{path}: grain_radius", len(radius), reason)
        if len(kinematic) != len(radius):
            reason = "must have an entry for each of the balls"
            refuse(RecordingError, f"{path}: grain_kinematic", len(kinematic), reason)
        model = None
        if "model" in scene:
            with sound(path, "scene.model"):
                model = RoverModel.from_dict(scene["model"])
        with sound(path, "scene.vessel"):
            vessel = checked_vessel(scene.get("vessel"))
        channels = grain_channels(len(radius), width_of(trajectory, "walls", 3), model, 0)
        check_rows(trajectory, path, channels, bounded=("walls", "q", "v", "wheel_centres"), needed=True)
        terrain = Plane() if model is not None and trajectory.terrain is None else trajectory.terrain
        return cls(trajectory, Path(path), radius, mass, kinematic > 0.0, terrain, model, vessel)

    @cached_property
    def positions(self) -> npt.NDArray[np.float32]:
        """(n, n_balls, 3) centres, m.

        Raises:
            RecordingError: They take more than 4 GiB, or the file is damaged or has changed.
        """
        return self.positions_of(self.rows)

    def positions_of(self, rows: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """(n_rows, n_balls, 3) centres in some samples of the file, m.

        Args:
            rows: Increasing indices of samples in the file.

        Raises:
            RecordingError: They take more than 4 GiB, or the file is damaged or has changed.
        """
        places = read_frames(self.path, "position", rows)
        if places.shape[1:] != (len(self.radius), 3):
            reason = f"must have rows of shape {(len(self.radius), 3)}"
            refuse(RecordingError, f"{self.path}: frames/position", places.shape[1:], reason)
        if not is_moderate(places):
            refuse(RecordingError, f"{self.path}: frames/position", "a place", f"must be finite and within {LARGEST:g}")
        return places

    @property
    def walls(self) -> Array:
        """(n, n_walls, 6) a point of each wall and the normal to its free side."""
        return self.trajectory["walls"]

    @cached_property
    def rover(self) -> RoverRun | None:
        """The rover's part of the run, with the poses of its solids; None without one."""
        if self.model is None or self.terrain is None:
            return None
        return RoverRun(self.trajectory, self.model, self.terrain, None)

    @property
    def wheel_centres(self) -> Array:
        """(n, n_wheels, 3) m.

        Raises:
            RecordingError: The run has no rover.
        """
        return self.trajectory["wheel_centres"]

    @property
    def wheel_forces(self) -> Array:
        """(n, n_wheels, 3) force of balls and ground on each wheel, world, mean since the previous sample, N.

        Raises:
            RecordingError: The run has no rover.
        """
        return self.trajectory["wheel_forces"]

    @cached_property
    def force_chains(self) -> Array:
        """(n, n_chains, 7) the strongest contacts as lines x, y, z to x, y, z, m, with their force, N.

        Raises:
            RecordingError: The file is damaged or has changed.
        """
        if "chains" not in self.trajectory.scene:
            return np.zeros((len(self.rows), 0, 7))
        chains = read_frames(self.path, "force_chains", self.rows).astype(np.float64)
        if chains.ndim != 3 or chains.shape[2] != 7 or not is_moderate(chains):
            reason = f"must have 7 finite numbers for each contact, within {LARGEST:g}"
            refuse(RecordingError, f"{self.path}: frames/force_chains", chains.shape, reason)
        return chains

    @cached_property
    def first_surface(self) -> SurfaceMap:
        """The surface of the balls at the file's first sample."""
        return surface_map(self.positions_of([0])[0], self.radius)

    @cached_property
    def sinkage(self) -> Array:
        """(n, n_wheels) depth of the wheels' lowest points below the first surface over them, m; nan beside it.

        Raises:
            RecordingError: The run has no rover.
        """
        centres = self.wheel_centres
        radii = np.zeros(0) if self.model is None else np.asarray(self.model.wheel_radii)
        width = max(4.0 * float(self.radius.mean()), float(radii.max(initial=0.0)))
        surface = self.first_surface.at(centres[..., [0, 2]], width=width)
        return surface - (centres[..., 1] - radii)


def _of_balls(trajectory: Trajectory, path: str | Path, name: str) -> Array:
    value = trajectory.attributes.get(f"grain_{name}")
    if not isinstance(value, np.ndarray) or value.ndim != 1:
        refuse(RecordingError, f"{path}: grain_{name}", value, "must be an array with an entry for each of the balls")
    return value.astype(np.float64)
