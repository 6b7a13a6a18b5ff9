"""The grid of an environment's height scan."""

import numpy as np

from rover_gym.env.rocks import HeightScan
from rover_gym.env.rover_env import RoverEnv
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse


def scan_grid(rover: RoverEnv) -> HeightScan:
    """The grid of an environment's height scan.

    Raises:
        OptionError: It has none, or one of a single row or column.
    """
    offsets = rover.task.scan
    if offsets is None:
        refuse(OptionError, "height_scan", False, "must be given, as by ScanPolicy.arguments(), to plan over")
    columns = int(np.count_nonzero(offsets[:, 0] == offsets[0, 0]))
    rows = len(offsets) // columns
    if rows < 2 or columns < 2:
        refuse(OptionError, "height_scan", (rows, columns), "must have two rows and columns at least")
    return HeightScan(rows, columns, float(offsets[0, 0] - offsets[columns, 0]))
