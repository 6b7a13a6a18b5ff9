from .file_writing import write_mjcf, write_urdf
from .import_report import ImportReport, RobotFileWarning, solid_rows
from .lookup import open_model, read_robot
from .reading import read_mjcf, read_urdf
from .statics import Statics, check_statics

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
