"""Trajectories in HDF5: recording, reading, and rover runs."""

from rover_gym.record.channels import Channel, RecordingError, RoverSampler, describe, row_count
from rover_gym.record.recorder import Recorder
from rover_gym.record.rover_run import RoverRun, read_run
from rover_gym.record.trajectory import Trajectory, read_frames, read_trajectory

__all__ = [
    "Channel",
    "Recorder",
    "RecordingError",
    "RoverRun",
    "RoverSampler",
    "Trajectory",
    "describe",
    "read_frames",
    "read_run",
    "read_trajectory",
    "row_count",
]
