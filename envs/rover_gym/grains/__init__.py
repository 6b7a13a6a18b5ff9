"""Granular ground in space: beds of balls, the rover among them, and recordings."""

from rover_gym.grains.grain_recording import GrainSampler, describe_grains, record_grains
from rover_gym.grains.grain_run import GrainRun, read_grain_run
from rover_gym.grains.grain_surface import SurfaceMap, surface_map

__all__ = [
    "GrainRun",
    "GrainSampler",
    "SurfaceMap",
    "describe_grains",
    "read_grain_run",
    "record_grains",
    "surface_map",
]
