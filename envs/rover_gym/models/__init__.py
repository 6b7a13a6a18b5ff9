"""Models by name or file: URDF and MJCF in and out, and what a model is on level ground.

`RoverModel.from_file`, `from_urdf`, `from_mjcf`, `to_file`, `to_urdf` and `to_mjcf` stand here, in `model_files`.
"""

import rover_gym.models.model_files  # noqa: F401 - methods of RoverModel
from rover_gym.models.file_writing import write_mjcf, write_urdf
from rover_gym.models.import_report import ImportReport, RobotFileWarning, solid_rows
from rover_gym.models.lookup import open_model, read_robot
from rover_gym.models.reading import read_mjcf, read_urdf
from rover_gym.models.statics import Statics, check_statics

__all__ = [
    "ImportReport",
    "RobotFileWarning",
    "Statics",
    "check_statics",
    "open_model",
    "read_mjcf",
    "read_robot",
    "read_urdf",
    "solid_rows",
    "write_mjcf",
    "write_urdf",
]
