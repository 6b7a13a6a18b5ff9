"""Recorded runs of the report's scenes."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_gym.mechanics import Simulation
from rover_gym.record.channels import RoverSampler, row_count
from rover_gym.record.recorder import Recorder

SEED = "none: the scene has no randomness"


@dataclass(frozen=True)
class SceneResult:
    """Result of `run`.

    Attributes:
        path: The recorded trajectory.
        duration: Simulated time, s.
        wall_time: Time spent stepping and recording, s.
        first_contact: Time at which a wheel first carried load, s, or None.
        smallest_gap: Smallest wheel gap of the run, m; negative means overlap.
        unconverged_steps: Steps whose contact problem did not converge to the tolerance.
        worst_residual: Largest residual of the contact solver.
    """

    path: Path
    duration: float
    wall_time: float
    first_contact: float | None
    smallest_gap: float
    unconverged_steps: int
    worst_residual: float


def record_scene(
    sim: Simulation,
    path: str | Path,
    attributes: Mapping[str, Any],
    *,
    duration: float,
    progress: Callable[[float], None] = lambda _: None,
) -> SceneResult:
    """Runs a simulation from its current state and records every step.

    Args:
        sim: The simulation.
        path: HDF5 file to write.
        attributes: Attributes of the run, from `describe`.
        duration: Time to simulate, s.
        progress: Called periodically with the simulated time.

    Raises:
        OptionError: `duration` is not positive, or the run has too many rows.
        RecordingError: The file is in use, or the disk is full.
        MissingExtraError: h5py is not installed.
        StepError: A step failed; the rows before it are on disk.
    """
    steps = row_count(duration, sim.time_step)
    first_contact: float | None = None
    smallest_gap = float(sim.wheel_gaps.min())
    unconverged, worst = 0, 0.0
    sampler = RoverSampler(sim.model)
    with Recorder(path, sampler.channels, attributes, terrain=sim.terrain) as recorder:
        recorder.append(sampler.row(sim))
        begin = time.perf_counter()
        for step in range(1, steps + 1):
            report = sim.step()
            recorder.append(sampler.row(sim, residual=report.residual, iterations=report.iterations))
            unconverged += not report.is_converged
            worst = max(worst, report.residual)
            smallest_gap = min(smallest_gap, float(sim.wheel_gaps.min()))
            if first_contact is None and report.n_contacts > 0:
                first_contact = sim.time
            if step % 100 == 0:
                progress(sim.time)
        wall_time = time.perf_counter() - begin
        recorder.note(wall_time=wall_time, unconverged_steps=unconverged)
    return SceneResult(Path(path), sim.time, wall_time, first_contact, smallest_gap, unconverged, worst)
