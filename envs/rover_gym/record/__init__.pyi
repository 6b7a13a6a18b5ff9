from .channels import Channel, RecordingError, RoverSampler, describe, row_count
from .disk_run import DiskRun, DiskSampler
from .grain_measures import outflow, penetration_depths, run_out, slopes
from .grain_run import GrainRun, GrainSampler
from .planar_run import PlanarRun, PlanarSampler
from .recorder import Recorder
from .rover_run import RoverRun, read_run
from .saved_runs import open_run, record_run
from .trajectory import Trajectory, read_frames, read_trajectory

__all__ = [
    "Channel",
    "DiskRun",
    "DiskSampler",
    "GrainRun",
    "GrainSampler",
    "PlanarRun",
    "PlanarSampler",
    "Recorder",
    "RecordingError",
    "RoverRun",
    "RoverSampler",
    "Trajectory",
    "describe",
    "open_run",
    "outflow",
    "penetration_depths",
    "read_frames",
    "read_run",
    "read_trajectory",
    "record_run",
    "row_count",
    "run_out",
    "slopes",
]
