"""Rotations of a run as quaternions, and as axes and angles.

The skew part of a rotation matrix vanishes at both angles, and with it the axis. The quaternion is therefore computed
from the largest of its four components (Shepperd 1978), and the axis from the quaternion's vector part, which is small
only for small rotations and still has the right direction there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


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
    """The same rotations without sign flips along the first axis, so that interpolation takes the short way.

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
