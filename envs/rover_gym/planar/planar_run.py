"""Saved planar runs, read back: a ball, a two-wheel rover or the straight-driving rover over its ground.

run = read_planar_run("rover.h5").resample(25.0)
run.discs[-1, 0, :2]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import (
    Line,
    PlanarSimulation,
    Polyline,
    RoverModel,
    Sine,
    Spline,
)
from rover_gym.record.channels import Channel, row_count
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import LARGEST, check_rows, check_time, film_rows, title_of
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.record.trajectory_format import RecordingError, sound
from rover_gym.validation import refuse

PlanarGround = Line | Sine | Spline | Polyline

COORDINATES = {
    3: ("x", "y", "theta"),
    5: ("x", "y", "theta", "theta_a", "theta_b"),
    7: ("x", "y", "theta", "front_wheels", "bogies", "middle_wheels", "back_wheels"),
}

DISCS = {1: ("ball",), 2: ("wheel A", "wheel B"), 3: ("front wheels", "middle wheels", "back wheels")}


class PlanarSampler:
    """Makes rows of a planar simulation for a `Recorder`.

    Args:
        sim: A simulation of the kind to sample.
    """

    def __init__(self, sim: PlanarSimulation) -> None:
        names, discs = COORDINATES[len(sim.q)], DISCS[len(sim.centres)]
        n = len(discs)
        self.channels = (
            Channel("time", "s", "time since the run's start"),
            Channel("q", "m, rad", "coordinates, angles turn to the left", (len(names),), names),
            Channel("v", "m/s, rad/s", "their rates", (len(names),), tuple(f"{name}_rate" for name in names)),
            Channel("centres", "m", "centres of the discs: x forward, y up", (n, 2), discs),
            Channel("gaps", "m", "distance from disc to ground, negative where they overlap", (n,), discs),
            Channel(
                "impulses",
                "N s",
                "impulses of the last step along the normal (out of the ground) and the tangent (forward), summed"
                " over the contacts of a disc",
                (n, 2),
                discs,
            ),
            Channel("torques", "N m", "driving torques, positive drives forward", (n,), discs),
            Channel("kinetic_energy", "J", "kinetic energy"),
            Channel("potential_energy", "J", "potential energy, zero with the mass centre at height 0"),
            Channel("solver_residual", "1", "largest residual of the contact solver since the last row"),
        )

    def row(self, sim: PlanarSimulation, *, residual: float = 0.0) -> dict[str, npt.ArrayLike]:
        """One row of `channels`; the simulation is not changed.

        Args:
            sim: The simulation to sample.
            residual: Largest residual since the previous row, from the step report.
        """
        contacts, energy = sim.contacts, sim.energy()
        impulses = np.zeros((len(sim.centres), 2))
        np.add.at(impulses, contacts.discs, contacts.impulses)
        return {
            "time": sim.time,
            "q": sim.q,
            "v": sim.v,
            "centres": sim.centres,
            "gaps": sim.gaps,
            "impulses": impulses,
            "torques": sim.torques,
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "solver_residual": residual,
        }


def describe_planar(sim: PlanarSimulation, title: str) -> dict[str, Any]:
    """Attributes of a recording, from the simulation's initial state."""
    ground = sim.ground
    names = {
        Line: ("slope", "offset"),
        Sine: ("amplitude", "wavelength", "phase", "offset"),
        Spline: ("x", "y"),
        Polyline: ("x", "y"),
    }[type(ground)]
    shape = {name: getattr(ground, name) for name in names}
    return {
        "title": title,
        "scene": {
            "kind": type(sim).__name__,
            "ground": {"kind": type(ground).__name__.lower(), **shape},
            "machine": {
                name: value.to_dict() if isinstance(value, RoverModel) else value
                for name, value in sim.parameters.items()
            },
            "q": sim.q,
            "v": sim.v,
            "torques": sim.torques,
        },
        "seed": "none: the scene has no randomness",
        "solver": sim.settings,
    }


def record_planar(
    sim: PlanarSimulation,
    path: str | Path,
    attributes: Mapping[str, Any],
    *,
    duration: float,
    steps_per_row: int = 1,
    until: Callable[[PlanarSimulation], bool] = lambda _: False,
    progress: Callable[[float], None] = lambda _: None,
) -> int:
    """Runs a simulation from its current state and records it.

    Args:
        sim: The simulation.
        path: HDF5 file to write.
        attributes: Attributes of the run, from `describe_planar`.
        duration: Time to simulate, s.
        steps_per_row: Steps from one row to the next.
        until: Asked after each row whether the run ends before its time.
        progress: Called periodically with the simulated time.

    Returns:
        Number of rows with steps that did not converge to the tolerance.

    Raises:
        OptionError: `duration` or `steps_per_row` is not positive, or the run has too many rows.
        RecordingError: The file is in use, or the disk is full.
        MissingExtraError: h5py is not installed.
        StepError: A step failed; the rows before it are on disk.
    """
    sampler = PlanarSampler(sim)
    unconverged = 0
    rows = row_count(duration, sim.time_step, steps_per_row)
    with Recorder(path, sampler.channels, attributes) as recorder:
        recorder.append(sampler.row(sim))
        for row in range(1, rows + 1):
            report = sim.step(steps_per_row)
            recorder.append(sampler.row(sim, residual=report.residual))
            unconverged += not report.is_converged
            if row % 100 == 0:
                progress(sim.time)
            if until(sim):
                break
        recorder.note(unconverged_rows=unconverged)
    return unconverged


Array = npt.NDArray[np.float64]

GROUNDS = {"line": Line, "sine": Sine, "spline": Spline, "polyline": Polyline}

#: Coordinates that are the discs' angles, by the number of coordinates.
ANGLES = {3: (2,), 5: (3, 4), 7: (3, 5, 6)}


@dataclass(frozen=True)
class PlanarRun:
    """A recorded planar run.

    Attributes:
        trajectory: The data sets and attributes of the file.
        ground: The line that the machine moved on.
        radius: (n_discs,) m.
        title: Title of the run.
    """

    trajectory: Trajectory
    ground: PlanarGround
    radius: Array
    title: str

    @property
    def n_frames(self) -> int:
        """Number of samples in the run."""
        return len(self.time)

    @property
    def time(self) -> Array:
        """(n,) sample times, s."""
        return self.trajectory["time"]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the discs, back to front for two wheels."""
        names = DISCS[len(self.radius)]
        return ("back wheel", "front wheel") if len(names) == 2 else names

    @property
    def discs(self) -> Array:
        """(n, n_discs, 3) x and y of the discs' centres, m, and their angles, rad, counter-clockwise positive."""
        q = self.trajectory["q"]
        angles = q[:, ANGLES[q.shape[1]]]
        result: Array = np.concatenate((self.trajectory["centres"], angles[..., None]), axis=2)
        return result

    @property
    def loads(self) -> Array:
        """(n, n_discs) force of the ground on each disc along its normal, mean over a step, N."""
        step = float(self.trajectory.attributes["solver"]["time_step"])
        result: Array = self.trajectory["impulses"][..., 0] / step
        return result

    @property
    def speed(self) -> Array:
        """(n,) speed of the first body's centre, m/s."""
        result: Array = np.linalg.norm(self.trajectory["v"][:, :2], axis=1)
        return result

    @property
    def slip_speeds(self) -> Array:
        """(n, n_discs) rim speed minus travel speed, m/s."""
        v = self.trajectory["v"]
        rims = -v[:, ANGLES[v.shape[1]]] * self.radius
        result: Array = rims - v[:, :1]
        return result

    def resample(self, fps: float) -> PlanarRun:
        """The run reduced to the samples nearest to the frame times of a video, each at most once.

        Args:
            fps: Frames per second; a run sampled more coarsely keeps all its samples.

        Raises:
            OptionError: `fps` is not a positive number.
        """
        return replace(self, trajectory=self.trajectory.at(film_rows(self.time, fps)))


def is_planar(trajectory: Trajectory) -> bool:
    """Whether a trajectory is a planar run on a line."""
    scene = trajectory.attributes.get("scene")
    return isinstance(scene, dict) and isinstance(scene.get("ground"), dict) and isinstance(scene.get("machine"), dict)


def read_planar_run(path: str | Path) -> PlanarRun:
    """Reads a run that `record_planar` saved, complete or not.

    Raises:
        RecordingError: The file is not a trajectory, not a planar run, or holds no samples.
        OSError: The file does not exist or cannot be read.
        MissingExtraError: h5py is not installed.
    """
    return planar_run_of(read_trajectory(path), path)


def planar_run_of(trajectory: Trajectory, path: str | Path) -> PlanarRun:
    """The planar run of a trajectory read from `path`.

    Raises:
        RecordingError: It is not a planar run, or holds no samples.
    """
    if not is_planar(trajectory) or "centres" not in trajectory.data or "q" not in trajectory.data:
        refuse(RecordingError, "path", str(path), "holds no planar machine: `rover planar` writes one")
    check_time(trajectory, path)
    scene = trajectory.attributes["scene"]
    discs = trajectory["centres"].shape[1] if trajectory["centres"].ndim == 3 else 0
    coordinates = trajectory["q"].shape[1] if trajectory["q"].ndim == 2 else 0
    if discs not in DISCS or coordinates not in COORDINATES or len(ANGLES[coordinates]) != discs:
        refuse(RecordingError, f"{path}: centres", discs, "must be one, two or three discs with their coordinates")
    shapes: dict[str, tuple[int, ...]] = {"q": (coordinates,), "v": (coordinates,), "centres": (discs, 2)}
    shapes |= {"gaps": (discs,), "impulses": (discs, 2), "torques": (discs,)}
    shapes |= dict.fromkeys(("kinetic_energy", "potential_energy", "solver_residual"), ())
    for name in shapes:
        if name not in trajectory.data:
            refuse(RecordingError, f"{path}: {name}", None, "is missing")
    check_rows(trajectory, path, shapes, bounded=("q", "v", "centres"))
    with sound(path, "scene"):
        ground = _ground(scene["ground"])
        radius = _radii(scene["machine"], discs)
        step = float(trajectory.attributes["solver"]["time_step"])
    if not ((radius > 0.0) & (radius <= LARGEST)).all() or not 0.0 < step <= LARGEST:
        refuse(RecordingError, f"{path}: scene.machine", radius.tolist(), "must have radii above 0, and a time step")
    return PlanarRun(trajectory, ground, radius, title_of(trajectory))


def _ground(plain: dict[str, Any]) -> PlanarGround:
    arguments = {name: value for name, value in plain.items() if name != "kind"}
    ground: PlanarGround = GROUNDS[plain["kind"]](**arguments)
    return ground


def _radii(machine: dict[str, Any], discs: int) -> Array:
    """Radii of the discs from the machine's parameters, (n_discs,), m."""
    if "model" in machine:
        model = RoverModel.from_dict(machine["model"])
        return np.full(discs, float(np.mean(model.wheel_radii)))
    radius = machine["radius"] if "radius" in machine else machine["wheel_radius"]
    return np.broadcast_to(np.asarray(radius, dtype=np.float64), (discs,)).copy()
