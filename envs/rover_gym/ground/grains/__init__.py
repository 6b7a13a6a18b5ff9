"""Grains: beds of balls in space and of disks in the plane, scenes on them and in vessels, trials, recordings.

>>> from rover_gym.ground.grains import settled_balls
>>> bed = settled_balls(200, 0.2, 0.2, radius_min=0.009, radius_max=0.011)
>>> 0.02 < bed.surface < 0.04
True

>>> from rover_gym.ground.grains import rover_on_disks
>>> sim = rover_on_disks(count=222, layers=3)
>>> sim.set_torques([50.0, 50.0])
>>> sim.step(100).steps
100
"""

from rover_gym.ground.grains.ball_bed import (
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
from rover_gym.ground.grains.bed_scenes import column, drum, rover_on_bed, silo, striking_sphere, with_wheel_width
from rover_gym.ground.grains.disk_bed import DiskBed, rover_on_disks, settled_disks
from rover_gym.ground.grains.disk_trials import (
    BedEstimate,
    DiskDrive,
    Pull,
    Traction,
    drawbar_pull,
    drive_on_disks,
    fit_traction,
    over_beds,
)
from rover_gym.ground.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.ground.grains.moving_window import BedEnergy, MovingWindow, WindowSnapshot
from rover_gym.ground.grains.pit import Pit, PitFill

__all__ = [
    "BallBed",
    "BedEnergy",
    "BedEstimate",
    "DiskBed",
    "DiskDrive",
    "MovingWindow",
    "Pit",
    "PitFill",
    "Pull",
    "SurfaceMap",
    "Traction",
    "WindowSnapshot",
    "box_walls",
    "column",
    "drawbar_pull",
    "drive_on_disks",
    "drum",
    "even_radii",
    "fit_traction",
    "lognormal_radii",
    "over_beds",
    "rover_on_bed",
    "rover_on_disks",
    "settle",
    "settled_balls",
    "settled_disks",
    "settled_track",
    "sieved_radii",
    "silo",
    "striking_sphere",
    "surface_map",
    "tiled",
    "with_wheel_width",
]
