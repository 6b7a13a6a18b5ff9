"""Models from and to the files of other programs: URDF and MJCF.

`RoverModel.from_urdf`, `from_mjcf`, `to_urdf` and `to_mjcf` call this room.
"""

from rover_gym.models.import_report import ImportReport
from rover_gym.models.mjcf_writer import write_mjcf
from rover_gym.models.reading import read_mjcf, read_urdf
from rover_gym.models.urdf_writer import write_urdf

__all__ = ["ImportReport", "read_mjcf", "read_urdf", "write_mjcf", "write_urdf"]
