"""Recordings of planar simulations: the sampler that makes their rows, and recorded runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from rover_gym.record.channels import Channel
from rover_gym.record.facts import row_count
from rover_gym.record.recorder import Recorder

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
