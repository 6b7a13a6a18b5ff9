"""Splits the core's readings into scalars and observations, for one rover or for n."""

from typing import Any, NamedTuple

import numpy as np

from rover_gym.env.generators import Rows
from rover_gym.env.quantities import Array, Observations, Quantity
from rover_gym.env.task import Task
from rover_gym.env.wheels import N_ACTIONS
from rover_gym.mechanics import standard_normals


class ReadingScalars(NamedTuple):
    """The scalar entries of a reading, with the core's names and in its order."""

    distance: Quantity
    cos_tilt: Quantity
    speed: Quantity
    trunk_force: Quantity
    slip_ratio: Quantity
    work: Quantity
    positive_work: Quantity
    time: Quantity
    not_converged: Quantity
    iterations: Quantity
    residual: Quantity
    n_contacts: Quantity

    @classmethod
    def of(cls, task: Task, readings: Array) -> "ReadingScalars":
        """Extracts the scalars of one reading `(size,)` or of readings `(n, size)`."""
        columns = readings[..., task.scalars]
        return cls(*(columns.tolist() if columns.ndim == 1 else columns.T.copy()))


def observe(
    task: Task, readings: Array, previous_action: Array, stuck_time: Quantity, noise: Array | None
) -> tuple[Observations, Any]:
    """Returns observations `(..., size)` and a mask of those that are finite in float32; the others are set to zero."""
    values = np.empty((*readings.shape[:-1], task.layout.size))
    # Readings and observations begin with the same entries.
    n = task.n_shared
    values[..., :n] = readings[..., :n]
    values[..., n : n + N_ACTIONS] = previous_action
    values[..., n + N_ACTIONS] = np.minimum(stuck_time / task.stuck_time, 1.0)
    if task.scan is not None:
        values[..., n + N_ACTIONS + 1 :] = readings[..., task.places["heights"]]
    values *= task.inverse_scale
    if noise is not None:
        values += noise
    observation = values.astype(np.float32)
    finite = np.isfinite(observation).all(axis=-1)
    if not finite.all():
        observation[~finite] = 0.0
    return observation, finite


def draw_noise(task: Task, generators: Rows) -> tuple[Array | None, Rows]:
    """Draws observation noise `(m, size)`, each row from its own generator; None without noise.

    Returns:
        The noise, and the generators `(m, 4)` after the draw.
    """
    if task.noisy is None:
        return None, generators
    normals, after = standard_normals(generators, task.layout.size)
    return normals * task.noisy, after


def tilt_of(cos_tilt: Quantity) -> Quantity:
    """Tilt from the vertical, rad."""
    return np.arccos(np.minimum(np.maximum(cos_tilt, -1.0), 1.0))
