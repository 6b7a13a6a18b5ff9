"""Models by name or file: import and export of URDF and MJCF, and checks of a model on level ground.

The module `model_files` implements `RoverModel.from_file`, `from_urdf`, `from_mjcf`, `to_file`, `to_urdf` and
`to_mjcf`.
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
