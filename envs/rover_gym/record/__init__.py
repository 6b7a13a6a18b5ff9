"""Runs in HDF5: recording and reading, of a rover, a planar machine or grains."""

from rover_gym.record.channels import Channel, RecordingError, RoverSampler, describe, row_count
from rover_gym.record.disk_run import DiskRun, DiskSampler
from rover_gym.record.grain_measures import outflow, penetration_depths, run_out, slopes
from rover_gym.record.grain_run import GrainRun, GrainSampler
from rover_gym.record.planar_run import PlanarRun, PlanarSampler, is_planar, planar_run_of
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import RoverRun, read_run
from rover_gym.record.saved_runs import SavedRun, open_run, record_run
from rover_gym.record.trajectory import Trajectory, read_frames, read_trajectory

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
    "SavedRun",
    "Trajectory",
    "describe",
    "is_planar",
    "open_run",
    "outflow",
    "penetration_depths",
    "planar_run_of",
    "read_frames",
    "read_run",
    "read_trajectory",
    "record_run",
    "row_count",
    "run_out",
    "slopes",
]
