"""The wheels of a model as actions know them: positions, sense of rotation, and which entry steers which wheel."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Plane, RoverModel

#: The slip ratio is meaningless while both wheel and rim are slower than this, m/s; equals the core's `SLIP_SPEED`.
SLIP_SPEED = 0.05


@dataclass(frozen=True)
class Steering:
    """The steering entries of an action, one for each joint that steers, in the order of the wheels.

    Attributes:
        joints: Index in q of each entry's joint.
        entries: The entry that each wheel follows, -1 where none does. Wheels that share a joint share its entry.
    """

    joints: tuple[int, ...]
    entries: tuple[int, ...]

    @classmethod
    def of(cls, model: RoverModel) -> "Steering":
        """The steering of a model; locked joints do not steer."""
        of_wheels = model.steering_joint_indices
        joints = tuple(dict.fromkeys(i for i in of_wheels if i >= 0))
        return cls(joints, tuple(joints.index(i) if i >= 0 else -1 for i in of_wheels))

    @property
    def wheels(self) -> list[list[int]]:
        """The wheels of each entry."""
        return [[i for i, own in enumerate(self.entries) if own == entry] for entry in range(len(self.joints))]


def drive_signs(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(n_wheels,)` sign of each wheel's joint rate when it rolls forward: 1, or -1 where the axis points right."""
    return model.actuation_matrix()[model.wheel_joint_indices, range(len(model.wheel_names))]


def wheel_centres(model: RoverModel) -> npt.NDArray[np.float64]:
    """`(n_wheels, 2)` x and z of the wheel centres relative to the trunk's origin, joints at zero, m."""
    points = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.asarray(points)[:, [0, 2]]
