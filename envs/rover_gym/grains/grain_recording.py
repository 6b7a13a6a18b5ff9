"""Recordings of balls in space, alone or under a rover.

Positions are stored in single precision. A grain keeps its stored place until it has moved by the resolution, so that
a bed at rest repeats its rows and compresses to almost nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.grains.moving_window import MovingWindow
from rover_gym.grains.stored_vessel import stored_vessel
from rover_gym.mechanics import GrainSimulation, OptionError, RoverGrainSimulation, RoverModel, Simulation
from rover_gym.record.channels import Channel, row_count, state_channels
from rover_gym.record.recorder import Recorder
from rover_gym.validation import checked, number, refuse

Array = npt.NDArray[np.float64]
#: Balls in space, alone or under a rover.
Recordable: TypeAlias = GrainSimulation | RoverGrainSimulation | MovingWindow

KIND = "GrainSimulation"
#: Share of the smallest radius by which a stored position may be off.
RESOLUTION = 1.0 / 250.0
#: Rows of a flush and of a chunk: a kill loses at most these, 0.6 s at 25 frames a second.
ROWS_PER_FLUSH = 16


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


class GrainSampler:
    """Steps balls, alone or under a rover, from row to row and makes the rows for a `Recorder`.

    Args:
        sim: A `GrainSimulation`, a `RoverGrainSimulation` or a `MovingWindow`.
    """

    def __init__(self, sim: Recordable) -> None:
        self._sim = sim
        self._grains, self._rover = _both(sim)
        self._places = StoredPlaces(self._grains.radius)
        n = len(self._grains.radius)
        self.channels: tuple[Channel, ...] = (
            Channel("time", "s", "time since the run's start"),
            Channel("position", "m", "centre of each ball: x forward, y up, z right", (n, 3), packed=True),
            Channel("walls", "m, 1", "a point of each wall and the normal to its free side", self._grains.walls.shape),
            Channel("n_asleep", "1", "number of balls that sleep"),
            Channel("kinetic_energy", "J", "kinetic energy of all"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at height 0"),
            Channel("n_contacts", "1", "most contacts of a step since the last row"),
            Channel("penetration", "m", "deepest overlap"),
            Channel("solver_residual", "1", "largest residual of the contact solver since the last row"),
            Channel("solver_iterations", "1", "iterations of the contact solver since the last row"),
        )
        self._wheel_solids: list[str] = []
        if self._rover is not None:
            self.channels += _rover_channels(self._rover.model)
            self._wheel_solids = [wheel["solid"] for wheel in self._rover.model.to_dict()["wheels"]]
        self._clear()

    def _clear(self) -> None:
        """Resets what is gathered from row to row."""
        self._residual, self._contacts, self._iterations, self._steps = 0.0, 0, 0, 0
        self._impulses = np.zeros((len(self._wheel_solids), 3))

    def step(self, n: int) -> bool:
        """Takes the steps that the next row covers; returns whether all of them converged to the tolerance.

        Raises:
            StepError: A step failed.
        """
        converged = True
        for _ in range(n):
            report = self._sim.step()
            self._steps += 1
            self._residual = max(self._residual, report.residual)
            self._contacts = max(self._contacts, report.n_contacts)
            self._iterations += report.iterations
            converged &= report.is_converged
            if self._rover is not None:
                self._impulses += wheel_impulses(self._rover)
        return converged

    def row(self) -> dict[str, npt.ArrayLike]:
        """One row of `channels`: the current state, and means since the previous row."""
        grains, rover = self._grains, self._rover
        energies = [grains.energy()] + ([] if rover is None else [rover.energy()])
        row: dict[str, npt.ArrayLike] = {
            "time": grains.time,
            "position": self._places.of(grains.position),
            "walls": grains.walls,
            "n_asleep": int(np.count_nonzero(grains.asleep)),
            "kinetic_energy": sum(energy.kinetic for energy in energies),
            "potential_energy": sum(energy.potential for energy in energies),
            "n_contacts": self._contacts,
            "penetration": self._sim.penetration(),
            "solver_residual": self._residual,
            "solver_iterations": self._iterations,
        }
        if rover is not None:
            poses = rover.poses()
            row |= {
                "q": rover.q,
                "v": rover.v,
                "wheel_forces": self._impulses / (max(self._steps, 1) * grains.time_step),
                "wheel_centres": np.array([poses[solid][0] for solid in self._wheel_solids]),
                "wheel_torques": rover.wheel_torques,
                "steering_set_points": rover.steering,
            }
        self._clear()
        return row


def wheel_impulses(rover: Simulation) -> Array:
    """(n_wheels, 3) impulse of balls and ground on each wheel in the last step, world, N s."""
    contacts = rover.contacts
    impulses = np.zeros((len(rover.model.wheel_radii), 3))
    touching = contacts.wheels >= 0
    # The rows of a contact frame are n, t, b: a world impulse is the sum of its components times the rows.
    world = np.einsum("ci,cij->cj", contacts.impulses[touching], contacts.frames[touching])
    np.add.at(impulses, contacts.wheels[touching], world)
    return impulses


def _rover_channels(model: RoverModel) -> tuple[Channel, ...]:
    wheels = tuple(model.wheel_names)
    n = len(wheels)
    return (
        *state_channels(model),
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


@checked(scene=(Mapping, None))
def describe_grains(
    sim: Recordable,
    title: str,
    scene: Mapping[str, Any] | None = None,
    *,
    seed: int | str = "none",
) -> dict[str, Any]:
    """The attributes of a recording, taken from the simulation at its start.

    Args:
        sim: The simulation.
        title: Title of the run.
        scene: Further parameters of the scene.
        seed: Seed of the packing, or why there is none.
    """
    grains, rover = _both(sim)
    return {
        "title": title,
        "scene": {
            **(scene or {}),
            "kind": KIND,
            "resolution": StoredPlaces(grains.radius).resolution,
            "vessel": stored_vessel(grains.vessel),
            **({} if rover is None else {"model": rover.model.to_dict()}),
        },
        "grain_radius": np.asarray(grains.radius, dtype=np.float64),
        "grain_mass": np.asarray(grains.mass, dtype=np.float64),
        "grain_kinematic": np.asarray(grains.kinematic, dtype=np.uint8),
        "seed": seed,
        "solver": grains.settings,
    }


@checked(scene=(Mapping, None), title=str, seed=(int, str), before_row=callable, until=callable, progress=callable)
def record_grains(
    sim: Recordable,
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
        sim: A `GrainSimulation`, a `RoverGrainSimulation` or a `MovingWindow`.
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
    grains, rover = _both(sim)
    steps_per_row = max(1, round(1.0 / (fps * grains.time_step)))
    rows = row_count(duration, grains.time_step, steps_per_row)
    sampler = GrainSampler(sim)
    unconverged = 0
    with Recorder(
        path,
        sampler.channels,
        describe_grains(sim, title, scene, seed=seed),
        terrain=grains.terrain if rover is None else rover.terrain,
        rows_per_flush=ROWS_PER_FLUSH,
    ) as recorder:
        recorder.append(sampler.row())
        for _ in range(rows):
            before_row(sim)
            unconverged += not sampler.step(steps_per_row)
            recorder.append(sampler.row())
            progress(grains.time)
            if until(sim):
                break
        recorder.note(unconverged_rows=unconverged)
    return unconverged
