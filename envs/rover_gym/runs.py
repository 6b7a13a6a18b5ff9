"""Saved runs of every kind: one reader, which tells by the file what was simulated.

run = open_run("runs/planar/soil.h5").resample(25.0)
"""

from pathlib import Path
from typing import Any, TypeAlias, TypeVar, overload

from rover_gym.grains.grain_run import GrainRun, grain_run_of, is_grains
from rover_gym.planar.planar_run import PlanarRun, is_planar, planar_run_of
from rover_gym.record.channels import RecordingError
from rover_gym.record.rover_run import RoverRun, Run, run_of
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.soil.soil_run import SoilRun, is_soil, soil_run_of
from rover_gym.validation import refuse

__all__ = ["SavedRun", "open_run", "saved_run_of"]

#: A rover, a planar machine, a soil of disks, or balls in space.
SavedRun: TypeAlias = RoverRun | PlanarRun | SoilRun | GrainRun
R = TypeVar("R", bound=Run)


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
        RecordingError: The file is not a trajectory, holds no samples, or is a run of another kind.
        OSError: The file does not exist or cannot be read.
        MissingExtraError: h5py is not installed.
    """
    run = saved_run_of(read_trajectory(path), path)
    if not isinstance(run, kind):
        refuse(RecordingError, "path", str(path), f"holds a {type(run).__name__}, no {kind.__name__}")
    return run


def saved_run_of(trajectory: Trajectory, path: str | Path) -> SavedRun:
    """The run of a trajectory that was read from `path`.

    Raises:
        RecordingError: It holds no samples, or its parts are inconsistent.
    """
    if is_soil(trajectory):
        return soil_run_of(trajectory, path)
    if is_grains(trajectory):
        return grain_run_of(trajectory, path)
    return planar_run_of(trajectory, path) if is_planar(trajectory) else run_of(trajectory, path)
