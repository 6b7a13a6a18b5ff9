"""The six wheels that actions drive and steer: how many, where they stand, which way they turn."""

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Plane, RoverModel

N_WHEELS = 6
#: A torque and a steering set-point for each wheel.
N_ACTIONS = 12

#: Below this speed, m/s, of wheel and rim alike a slip ratio says nothing: the core's `SLIP_SPEED`.
SLIP_SPEED = 0.05


def drive_signs(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(6,)` rate of a wheel's joint when the wheel rolls forward: 1, or -1 where the axis points right."""
    return model.actuation_matrix()[model.wheel_joint_indices, range(N_WHEELS)]


def wheel_centres(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(6, 2)` x and z of the wheels relative to the trunk's origin, joints at zero, m."""
    points = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.asarray(points)[:, [0, 2]]
