from .ball_bed import (
    BallBed as BallBed,
    box_walls as box_walls,
    even_radii as even_radii,
    lognormal_radii as lognormal_radii,
    settle as settle,
    settled_balls as settled_balls,
    settled_track as settled_track,
    sieved_radii as sieved_radii,
    tiled as tiled,
)
from .bed_scenes import (
    column as column,
    drum as drum,
    rover_on_bed as rover_on_bed,
    silo as silo,
    striking_sphere as striking_sphere,
    with_wheel_width as with_wheel_width,
)
from .disk_bed import DiskBed as DiskBed, rover_on_disks as rover_on_disks, settled_disks as settled_disks
from .disk_trials import (
    BedEstimate as BedEstimate,
    DiskDrive as DiskDrive,
    Pull as Pull,
    Traction as Traction,
    drawbar_pull as drawbar_pull,
    drive_on_disks as drive_on_disks,
    fit_traction as fit_traction,
    over_beds as over_beds,
)
from .grain_surface import SurfaceMap as SurfaceMap, surface_map as surface_map
from .moving_window import BedEnergy as BedEnergy, MovingWindow as MovingWindow, WindowSnapshot as WindowSnapshot
from .pit import Pit as Pit, PitFill as PitFill
