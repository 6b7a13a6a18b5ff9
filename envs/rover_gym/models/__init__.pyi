from .file_writing import write_mjcf as write_mjcf, write_urdf as write_urdf
from .import_report import ImportReport as ImportReport, RobotFileWarning as RobotFileWarning, solid_rows as solid_rows
from .lookup import open_model as open_model, read_robot as read_robot
from .reading import read_mjcf as read_mjcf, read_urdf as read_urdf
from .statics import Statics as Statics, check_statics as check_statics
