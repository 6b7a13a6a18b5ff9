from .channels import (
    Channel as Channel,
    RecordingError as RecordingError,
    RoverSampler as RoverSampler,
    describe as describe,
    row_count as row_count,
)
from .disk_run import DiskRun as DiskRun, DiskSampler as DiskSampler
from .grain_measures import (
    outflow as outflow,
    penetration_depths as penetration_depths,
    run_out as run_out,
    slopes as slopes,
)
from .grain_run import GrainRun as GrainRun, GrainSampler as GrainSampler
from .planar_run import PlanarRun as PlanarRun, PlanarSampler as PlanarSampler
from .recorder import Recorder as Recorder
from .rover_run import RoverRun as RoverRun, read_run as read_run
from .saved_runs import open_run as open_run, record_run as record_run
from .trajectory import Trajectory as Trajectory, read_frames as read_frames, read_trajectory as read_trajectory
