"""Recordings of balls in space, alone or under a rover.

Positions are stored in single precision. A grain keeps its stored place until it has moved by the resolution, so that
a bed at rest repeats its rows and compresses to almost nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, RoverModel, StepReport, Terrain
from rover_gym.record.channels import Channel
from rover_gym.record.facts import row_count
from rover_gym.record.recorder import Recorder
from rover_gym.validation import number, refuse

Array = npt.NDArray[np.float64]

KIND = "GrainSimulation"
#: Share of the smallest radius by which a stored position may be off.
RESOLUTION = 1.0 / 250.0
#: Rows of a flush and of a chunk: a kill loses at most these, 0.6 s at 25 frames a second.
ROWS_PER_FLUSH = 16


class _Energy(Protocol):
    @property
    def kinetic(self) -> float: ...
    @property
    def potential(self) -> float: ...


class Grains(Protocol):
    """What a simulation of balls offers to a recording."""

    @property
    def position(self) -> Array:
        """(n, 3) centres, m."""
    @property
    def radius(self) -> Array:
        """(n,) m."""
    @property
    def mass(self) -> Array:
        """(n,) kg."""
    @property
    def kinematic(self) -> npt.NDArray[np.bool_]:
        """(n,) whether no force moves the ball."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the ball sleeps."""
    @property
    def walls(self) -> Array:
        """(n_walls, 6) a point of each wall and the normal to its free side."""
    @property
    def time(self) -> float:
        """Time, s."""
    @property
    def time_step(self) -> float:
        """Time step, s."""
    @property
    def settings(self) -> dict[str, Any]:
        """Options of contacts, gravity and solver."""

    def step(self, n: int = 1) -> StepReport:
        """Takes steps."""

    def energy(self) -> _Energy:
        """Energy, J."""

    def penetration(self) -> float:
        """Deepest overlap, m."""


class RoverOnGrains(Grains, Protocol):
    """What a simulation of a rover among balls offers besides."""

    @property
    def model(self) -> RoverModel:
        """The rover."""
    @property
    def terrain(self) -> Terrain:
        """The fixed ground."""
    @property
    def q(self) -> Array:
        """(nq,) coordinates."""
    @property
    def v(self) -> Array:
        """(nv,) velocities."""
    @property
    def wheel_torques(self) -> Array:
        """(n_wheels,) N m."""
    @property
    def steering(self) -> Array:
        """(n_wheels,) set-points, rad."""

    def poses(self) -> Mapping[str, tuple[Array, Array]]:
        """Origin and rotation of each solid."""

    def wheel_forces(self) -> Array:
        """(n_wheels, 3) force on each wheel in the last step, world, N."""


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


class GrainSampler:
    """Steps balls, alone or under a rover, from row to row and makes the rows for a `Recorder`.

    Args:
        sim: The simulation.
    """

    def __init__(self, sim: Grains | RoverOnGrains) -> None:
        self._sim = sim
        self._model: RoverModel | None = getattr(sim, "model", None)
        self._places = StoredPlaces(np.asarray(sim.radius))
        self._residual, self._contacts, self._iterations = 0.0, 0, 0
        self._forces: Array | None = None
        self._steps = 0
        self.channels: tuple[Channel, ...] = (
            Channel("time", "s", "time since the run's start"),
            Channel(
                "position", "m", "centre of each ball: x forward, y up, z right", (len(sim.radius), 3), packed=True
            ),
            Channel("walls", "m, 1", "a point of each wall and the normal to its free side", np.shape(sim.walls)),
            Channel("n_asleep", "1", "number of balls that sleep"),
            Channel("kinetic_energy", "J", "kinetic energy of all"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at height 0"),
            Channel("n_contacts", "1", "most contacts of a step since the last row"),
            Channel("penetration", "m", "deepest overlap"),
            Channel("solver_residual", "1", "largest residual of the contact solver since the last row"),
            Channel("solver_iterations", "1", "iterations of the contact solver since the last row"),
        )
        if self._model is not None:
            self.channels += _rover_channels(self._model)
            self._wheel_solids = [wheel["solid"] for wheel in self._model.to_dict()["wheels"]]

    def step(self, n: int) -> bool:
        """Takes the steps that the next row covers; returns whether all of them converged to the tolerance.

        Raises:
            StepError: A step failed.
        """
        converged = True
        for _ in range(n):
            report = self._sim.step(1)
            self._residual = max(self._residual, report.residual)
            self._contacts = max(self._contacts, report.n_contacts)
            self._iterations += report.iterations
            converged &= report.is_converged
            if self._model is not None:
                forces = np.asarray(self._sim.wheel_forces())  # type: ignore[union-attr]
                self._forces = forces if self._forces is None else self._forces + forces
                self._steps += 1
        return converged

    def row(self) -> dict[str, npt.ArrayLike]:
        """One row of `channels`: the current state, and means since the previous row."""
        sim = self._sim
        energy = sim.energy()
        row: dict[str, npt.ArrayLike] = {
            "time": sim.time,
            "position": self._places.of(np.asarray(sim.position)),
            "walls": sim.walls,
            "n_asleep": int(np.count_nonzero(sim.asleep)),
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "n_contacts": self._contacts,
            "penetration": sim.penetration(),
            "solver_residual": self._residual,
            "solver_iterations": self._iterations,
        }
        if self._model is not None:
            row |= self._rover_row(sim)  # type: ignore[arg-type]
        self._residual, self._contacts, self._iterations = 0.0, 0, 0
        self._forces, self._steps = None, 0
        return row

    def _rover_row(self, sim: RoverOnGrains) -> dict[str, npt.ArrayLike]:
        poses = sim.poses()
        none = np.zeros((len(self._wheel_solids), 3))
        return {
            "q": sim.q,
            "v": sim.v,
            "wheel_forces": none if self._forces is None else self._forces / self._steps,
            "wheel_centres": np.array([poses[solid][0] for solid in self._wheel_solids]),
            "wheel_torques": sim.wheel_torques,
            "steering_set_points": sim.steering,
        }


def _rover_channels(model: RoverModel) -> tuple[Channel, ...]:
    wheels = tuple(model.wheel_names)
    n = len(wheels)
    return (
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
        Channel(
            "wheel_forces",
            "N",
            "force of balls and ground on each wheel, world x, y, z, mean since the last row",
            (n, 3),
            wheels,
        ),
        Channel("wheel_centres", "m", "world: x forward, y up, z to the right", (n, 3), wheels),
        Channel("wheel_torques", "N m", "commanded driving torques, positive drives forward", (n,), wheels),
        Channel("steering_set_points", "rad", "set-points of the steering controllers", (n,), wheels),
    )


def describe_grains(
    sim: Grains | RoverOnGrains, title: str, scene: Mapping[str, Any] | None = None, *, seed: int | str = "none"
) -> dict[str, Any]:
    """The attributes of a recording, taken from the simulation at its start.

    Args:
        sim: The simulation.
        title: Title of the run.
        scene: Further parameters of the scene.
        seed: Seed of the packing, or why there is none.
    """
    model: RoverModel | None = getattr(sim, "model", None)
    return {
        "title": title,
        "scene": {
            **(scene or {}),
            "kind": KIND,
            "resolution": StoredPlaces(np.asarray(sim.radius)).resolution,
            **({} if model is None else {"model": model.to_dict()}),
        },
        "grain_radius": np.asarray(sim.radius, dtype=np.float64),
        "grain_mass": np.asarray(sim.mass, dtype=np.float64),
        "grain_kinematic": np.asarray(sim.kinematic, dtype=np.uint8),
        "seed": seed,
        "solver": sim.settings,
    }


def record_grains(
    sim: Grains | RoverOnGrains,
    duration: float,
    path: str | Path,
    fps: float = 25.0,
    *,
    title: str = "balls in space",
    scene: Mapping[str, Any] | None = None,
    seed: int | str = "none",
    before_row: Callable[[Any], None] = lambda _: None,
    until: Callable[[Any], bool] = lambda _: False,
    progress: Callable[[float], None] = lambda _: None,
) -> int:
    """Runs balls, alone or under a rover, from their current state and records them.

    Rows are written 16 at a time: a run that is killed keeps all but its last 15 rows at most.

    Args:
        sim: A `GrainSimulation` or a `RoverGrainSimulation`.
        duration: Time to simulate, s.
        path: HDF5 file to write.
        fps: Rows per second of simulated time, rounded to a whole number of steps from row to row.
        title: Title of the recording.
        scene: Further parameters of the scene, stored with it.
        seed: Seed of the packing, or why there is none.
        before_row: Called with the simulation before the steps of each row, to command a rover or move walls.
        until: Called with the simulation after each row; the run stops when it returns true.
        progress: Called with the simulated time after each row.

    Returns:
        Number of rows with steps that did not converge to the tolerance.

    Raises:
        OptionError: `duration` or `fps` is not positive, or the run has too many rows.
        RecordingError: The file is in use, or the disk is full.
        MissingExtraError: h5py is not installed.
        StepError: A step failed; the rows before it are on disk.
    """
    fps = number("fps", fps, above=0.0)
    if not len(sim.radius):
        refuse(OptionError, "sim", 0, "must hold at least one ball")
    steps_per_row = max(1, round(1.0 / (fps * sim.time_step)))
    rows = row_count(duration, sim.time_step, steps_per_row)
    sampler = GrainSampler(sim)
    unconverged = 0
    with Recorder(
        path,
        sampler.channels,
        describe_grains(sim, title, scene, seed=seed),
        terrain=getattr(sim, "terrain", None),
        rows_per_flush=ROWS_PER_FLUSH,
    ) as recorder:
        recorder.append(sampler.row())
        for _ in range(rows):
            before_row(sim)
            unconverged += not sampler.step(steps_per_row)
            recorder.append(sampler.row())
            progress(sim.time)
            if until(sim):
                break
        recorder.note(unconverged_rows=unconverged)
    return unconverged
