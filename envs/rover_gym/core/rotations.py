"""Rotations as matrices, vectors, quaternions, and axes and angles.

The skew part of a rotation matrix vanishes at both angles, and with it the axis. The quaternion is therefore computed
from the largest of its four components (Shepperd 1978), and the axis from the quaternion's vector part, which is small
only for small rotations and still has the right direction there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def turned(R: Array, vectors: Array) -> Array:
    """Vectors (n, 3) turned by a rotation matrix (3, 3).

    The bits are the same on every machine. A product of matrices starts the threads of NumPy's library from some
    thousand vectors on, which take many times the processor time where other programs run.
    """
    x, y, z = vectors.T
    result = np.empty((len(vectors), 3))
    for i in range(3):
        result[:, i] = R[i, 0] * x + R[i, 1] * y + R[i, 2] * z
    return result


def quaternions(rotations: Array) -> Array:
    """Unit quaternions w, x, y, z of rotation matrices.

    Args:
        rotations: (..., 3, 3).

    Returns:
        (..., 4); the largest component is positive.
    """
    R = rotations
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    # 4 q_i q_j, by rows i; the row with the largest diagonal is the quaternion with the least round-off.
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i + 1, i + 1] = 1.0 - trace + 2.0 * R[..., i, i]
        products[..., 0, i + 1] = products[..., i + 1, 0] = R[..., k, j] - R[..., j, k]
        products[..., j + 1, k + 1] = products[..., k + 1, j + 1] = R[..., j, k] + R[..., k, j]
    row = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, row[..., None, None], axis=-2)[..., 0, :]
    result: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return result


def continuous(q: Array) -> Array:
    """Returns rotations without sign flips along the first axis, so that interpolation takes the short way.

    Args:
        q: (n, ..., 4) unit quaternions.
    """
    turns = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0.0, -1.0, 1.0)
    signs = np.concatenate((np.ones((1, *q.shape[1:-1])), np.cumprod(turns, axis=0)))
    result: Array = q * signs[..., None]
    return result


def axis_angles(q: Array) -> Array:
    """Axis and angle of unit quaternions.

    Args:
        q: (..., 4) w, x, y, z.

    Returns:
        (..., 4) unit axis and angle, rad, in 0 to 2 pi; the axis of the identity is y.
    """
    vector = q[..., 1:]
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    axis = np.where(length > 0.0, vector / np.where(length > 0.0, length, 1.0), np.array([0.0, 1.0, 0.0]))
    angle = 2.0 * np.arctan2(length, q[..., :1])
    return np.concatenate((axis, angle), axis=-1)


def rotation_vector(R: Array) -> Array:
    """The rotation vector (3,), axis times angle in rad, of a rotation matrix (3, 3)."""
    w, v = quaternion(R)
    size = float(np.linalg.norm(v))
    return np.zeros(3) if size == 0.0 else np.asarray(2.0 * np.arctan2(size, w) / size * v)


def rotation_matrix(vector: npt.ArrayLike) -> Array:
    """The rotation matrix (3, 3) of a rotation vector (3,), rad."""
    given = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(given))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = given / angle
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
