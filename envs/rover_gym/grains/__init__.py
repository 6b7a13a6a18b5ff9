"""Granular ground in space: beds of balls, the rover among them, and recordings."""

from rover_gym.grains.ball_bed import BallBed, settled_balls
from rover_gym.grains.grain_recording import GrainSampler, describe_grains, record_grains
from rover_gym.grains.grain_run import GrainRun, read_grain_run
from rover_gym.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.grains.sizes import even_radii, lognormal_radii, sieved_radii
from rover_gym.grains.tiling import tiled

__all__ = [
    "BallBed",
    "GrainRun",
    "GrainSampler",
    "SurfaceMap",
    "describe_grains",
    "even_radii",
    "lognormal_radii",
    "read_grain_run",
    "record_grains",
    "settled_balls",
    "sieved_radii",
    "surface_map",
    "tiled",
]
