"""Granular ground in space: beds of balls, scenes on them and in vessels, and recordings.

>>> from rover_gym.grains import settled_balls
>>> bed = settled_balls(200, 0.2, 0.2, radius_min=0.009, radius_max=0.011)
>>> 0.02 < bed.surface < 0.04
True
"""

from rover_gym.grains.ball_bed import (
    BallBed,
    box_walls,
    even_radii,
    lognormal_radii,
    settle,
    settled_balls,
    settled_track,
    sieved_radii,
    tiled,
)
from rover_gym.grains.bed_scenes import (
    column,
    drum,
    outflow,
    penetration_depths,
    rover_on_bed,
    run_out,
    silo,
    slopes,
    striking_sphere,
    with_wheel_width,
)
from rover_gym.grains.grain_run import GrainRun, GrainSampler
from rover_gym.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.grains.moving_window import BedEnergy, MovingWindow, WindowSnapshot
from rover_gym.grains.pit import Pit, PitFill

__all__ = [
    "BallBed",
    "BedEnergy",
    "GrainRun",
    "GrainSampler",
    "MovingWindow",
    "Pit",
    "PitFill",
    "SurfaceMap",
    "WindowSnapshot",
    "box_walls",
    "column",
    "drum",
    "even_radii",
    "lognormal_radii",
    "outflow",
    "penetration_depths",
    "rover_on_bed",
    "run_out",
    "settle",
    "settled_balls",
    "settled_track",
    "sieved_radii",
    "silo",
    "slopes",
    "striking_sphere",
    "surface_map",
    "tiled",
    "with_wheel_width",
]
