"""Runs of every kind: one recorder, and one reader, which tells by the file what was simulated.

record_run(sim, 5.0, "run.h5")
run = open_run("run.h5").resample(25.0)
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, overload

import numpy as np

from rover_gym.core import DiskSimulation, OptionError, PlanarSimulation, Simulation
from rover_gym.core.validation import checked, number, refuse
from rover_gym.record.channels import RecordingError, RoverSampler, Sampler, row_count
from rover_gym.record.disk_run import DiskRun, DiskSampler
from rover_gym.record.grain_run import GrainRun, GrainSampler, Recordable
from rover_gym.record.planar_run import PlanarRun, PlanarSampler
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import RoverRun
from rover_gym.record.run import Run
from rover_gym.record.trajectory import Trajectory, read_trajectory

__all__ = ["SavedRun", "open_run", "record_run", "saved_run_of"]

#: A rover, a planar machine, disks, or balls in space.
SavedRun: TypeAlias = RoverRun | PlanarRun | DiskRun | GrainRun
R = TypeVar("R", bound=Run)

#: Kinds that a scene tells; a run of a rover is none of these.
KINDS: tuple[type[SavedRun], ...] = (DiskRun, GrainRun, PlanarRun)


def sampler_of(sim: Simulation | PlanarSimulation | DiskSimulation | Recordable) -> Sampler:
    """What steps a simulation from row to row.

    Raises:
        OptionError: It is no simulation that can be recorded.
    """
    if isinstance(sim, Simulation):
        sampler = RoverSampler(sim.model)
        sampler.sim = sim
        return sampler
    if isinstance(sim, PlanarSimulation):
        return PlanarSampler(sim)
    return DiskSampler(sim) if isinstance(sim, DiskSimulation) else GrainSampler(sim)


@checked(
    scene=(Mapping, None),
    title=(str, None),
    seed=(int, str, None),
    before_row=callable,
    until=callable,
    progress=callable,
)
def record_run(
    sim: Simulation | PlanarSimulation | DiskSimulation | Recordable,
    duration: float,
    path: str | Path,
    fps: float | None = 25.0,
    *,
    title: str | None = None,
    scene: Mapping[str, Any] | None = None,
    seed: int | str | None = None,
    before_row: Callable[[Any], None] = lambda _: None,
    until: Callable[[Any], bool] = lambda _: False,
    progress: Callable[[float], None] = lambda _: None,
) -> int:
    """Runs a simulation of any kind from its current state and records it.

    Args:
        sim: The simulation, or a `MovingWindow`.
        duration: Time to simulate, s.
        path: HDF5 file to write.
        fps: Rows per second of simulated time, rounded to whole steps from row to row; None for a row a step.
        title: Title of the recording.
        scene: Further parameters of the scene, stored with it.
        seed: Seed of the start, or why there is none.
        before_row: Called with the simulation before the steps of each row, to command a rover or move walls.
        until: Called with the simulation after each row; the run stops when it returns true.
        progress: Called with the simulated time after each row.

    Returns:
        Number of rows with steps that did not converge to the tolerance; the file has it as `unconverged_rows`.

    Raises:
        OptionError: `duration` or `fps` is not positive, or the run has too many rows.
        RecordingError: The file is in use, or the disk is full.
        StepError: A step failed; the rows before it are on disk.
    """
    sampler = sampler_of(sim)
    steps_per_row = 1 if fps is None else max(1, round(1.0 / (number("fps", fps, above=0.0) * sim.time_step)))
    rows, unconverged = row_count(duration, sim.time_step, steps_per_row), 0
    facts, flush = sampler.describe(title, scene or {}, seed), sampler.rows_per_flush
    with Recorder(path, sampler.channels, facts, terrain=sampler.terrain, rows_per_flush=flush) as recorder:
        recorder.append(sampler.read())
        for _ in range(rows):
            before_row(sim)
            unconverged += not sampler.step(steps_per_row)
            row = sampler.read()
            recorder.append(row)
            progress(float(np.asarray(row["time"])))
            if until(sim):
                break
        recorder.note(unconverged_rows=unconverged)
    return unconverged


@overload
def open_run(path: str | Path) -> SavedRun: ...
@overload
def open_run(path: str | Path, kind: type[R]) -> R: ...
def open_run(path: str | Path, kind: type[Any] = Run) -> Any:
    """Reads a saved run, complete or not.

    Args:
        path: The file.
        kind: The class that the run must have; any by default.

    Raises:
        OptionError: `kind` is not a class.
        RecordingError: The file is not a trajectory, holds no samples, or is a run of another kind.
        OSError: The file does not exist or cannot be read.
    """
    if not isinstance(kind, type):
        refuse(OptionError, "kind", kind, "must be a class of runs")
    run = saved_run_of(read_trajectory(path), path)
    if not isinstance(run, kind):
        refuse(RecordingError, "path", str(path), f"contains a {type(run).__name__}, not a {kind.__name__}")
    return run


def saved_run_of(trajectory: Trajectory, path: str | Path) -> SavedRun:
    """The run of a trajectory that was read from `path`.

    Raises:
        RecordingError: It holds no samples, or its parts are inconsistent.
    """
    kind: type[SavedRun] = next((one for one in KINDS if one.is_scene(trajectory.scene)), RoverRun)
    return kind.of(trajectory, path)
