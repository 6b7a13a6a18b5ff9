"""The six driven and steered wheels: their number, positions and sense of rotation."""

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Plane, RoverModel

N_WHEELS = 6
#: Entries of a steered rover's action: one torque and one steering set-point per wheel.
N_ACTIONS = 12

#: The slip ratio is meaningless while both wheel and rim are slower than this, m/s; equals the core's `SLIP_SPEED`.
SLIP_SPEED = 0.05


def drive_signs(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(6,)` sign of each wheel's joint rate when it rolls forward: 1, or -1 where the axis points right."""
    return model.actuation_matrix()[model.wheel_joint_indices, range(N_WHEELS)]


def wheel_centres(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(6, 2)` x and z of the wheel centres relative to the trunk's origin, joints at zero, m."""
    points = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.asarray(points)[:, [0, 2]]
