"""Axes of robot files and of this package, and the rotations between them.

URDF and MJCF have x forward, y left and z up; here x is forward, y up and z right. One rotation `P` converts them, and
it applies to every frame: a link's frame becomes `R Pᵀ`, so every vector `r` of the file becomes `P r` and every
inertia `P I Pᵀ`. At the zero of all joints a frame that had z up has y up.
"""

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import ModelError
from rover_gym.validation import refuse

Array = npt.NDArray[np.float64]

#: From z up, x forward, to y up, x forward.
Z_UP_TO_Y_UP: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

#: Rotations about the vertical that bring the file's forward direction to x.
_FORWARD = {
    "x": np.eye(3),
    "-x": np.diag([-1.0, -1.0, 1.0]),
    "y": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "-y": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}


def axes_of(forward: object) -> Array:
    """The rotation (3, 3) from a file's axes, whose machine drives along `forward`, to those of this package.

    Raises:
        ModelError: `forward` is not "x", "-x", "y" or "-y".
    """
    if not isinstance(forward, str) or forward not in _FORWARD:
        refuse(ModelError, "forward", forward, 'must be "x", "-x", "y" or "-y"')
    return np.asarray(Z_UP_TO_Y_UP @ _FORWARD[forward])


def rotation_vector(R: Array) -> Array:
    """The rotation vector (3,), axis times angle in rad, of a rotation matrix (3, 3)."""
    w, v = quaternion(R)
    size = float(np.linalg.norm(v))
    return np.zeros(3) if size == 0.0 else np.asarray(2.0 * np.arctan2(size, w) / size * v)


def rotation_matrix(vector: Array) -> Array:
    """The rotation matrix (3, 3) of a rotation vector (3,), rad."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + 2.0 * np.sin(angle / 2.0) ** 2 * K @ K)


def quaternion(R: Array) -> tuple[float, Array]:
    """The unit quaternion of a rotation matrix: its scalar part, not negative, and its vector part (3,)."""
    squares = np.array([np.trace(R), *np.diag(R)])
    largest = int(np.argmax(squares))
    if largest == 0:
        q = np.array([1.0 + np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = R[k, j] - R[j, k]
        q[1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + k] = R[k, i] + R[i, k]
    q /= np.linalg.norm(q)
    if q[0] < 0.0:
        q = -q
    return float(q[0]), q[1:]


def from_quaternion(q: Array) -> Array:
    """The rotation matrix (3, 3) of a quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def roll_pitch_yaw(R: Array) -> Array:
    """URDF's angles (3,) of a rotation matrix: R = Rz(yaw) Ry(pitch) Rx(roll), rad."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if np.hypot(R[0, 0], R[1, 0]) > 1e-12:
        return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])])
    return np.array([0.0, pitch, np.arctan2(-R[0, 1], R[1, 1])])


def turn_z_to(axis: Array) -> Array:
    """A rotation (3, 3) that takes z to a unit vector; the identity for z itself."""
    x, y, z = axis
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + z))
