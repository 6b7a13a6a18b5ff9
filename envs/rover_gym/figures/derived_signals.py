"""Signals derived from a recording: wheel slip, motor work, and smoothed curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.env.wheels import SLIP_SPEED, drive_signs

if TYPE_CHECKING:
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]


def contact_velocities(run: RoverRun) -> Array:
    """(n, 6, 3) velocities of the wheels at the ground along n, t, b, m/s; nan where a wheel carried no load.

    For a wheel that touches two spheres, the contact with the smaller gap counts.
    """
    states = zip(run.trajectory["q"], run.trajectory["v"], strict=True)
    velocities = np.array([run.model.wheel_jacobians(q, run.terrain, "state") @ v for q, v in states])
    velocities[run.trajectory["wheel_forces"][:, :, 0] <= 0.0] = np.nan
    return velocities


def slip_ratios(run: RoverRun) -> Array:
    """(n, 6) rim speed over the ground divided by the larger of rim and wheel speed, as `slip_ratio` of `Rover-v0`.

    It is nan where a wheel carried no load.
    """
    u = contact_velocities(run)
    rim = of_wheels(run, "v") * run.model.wheel_radii
    ground = np.hypot(rim + u[..., 1], u[..., 2])
    sliding = np.hypot(u[..., 1], u[..., 2])
    return np.asarray(sliding / np.maximum(np.maximum(np.abs(rim), ground), SLIP_SPEED))


def motor_work(run: RoverRun) -> Array:
    """(n, 6) work of the wheel motors since the start, J, positive where they drove.

    The drive torque of the last step before a row is taken as constant since the previous row.
    """
    angles = of_wheels(run, "q")
    turned = np.diff(angles, axis=0, prepend=angles[:1])
    return np.cumsum(run.trajectory["motor_torques"] * turned, axis=0)


def smooth(time: Array, values: Array, window: float) -> Array:
    """Moving average with a Hann window; nan has zero weight.

    Args:
        time: (n,) s, equally spaced.
        values: (n,) or (n, m).
        window: Full width, s; the weights' mean distance from the centre is about a fifth of it.
    """
    if len(time) < 3:
        return values
    half = max(round(0.5 * window / float(np.median(np.diff(time)))), 1)
    weights = np.hanning(2 * half + 3)[1:-1]
    columns = values.reshape(len(values), -1)
    known = np.isfinite(columns)
    smoothed = np.empty_like(columns)
    for i in range(columns.shape[1]):
        total = np.convolve(np.where(known[:, i], columns[:, i], 0.0), weights)[half : half + len(time)]
        weight = np.convolve(known[:, i].astype(np.float64), weights)[half : half + len(time)]
        smoothed[:, i] = np.divide(total, weight, out=np.full_like(total, np.nan), where=weight > 1e-9)
    smoothed[~known] = np.nan  # no curve where there was nothing to measure
    return smoothed.reshape(values.shape)


def of_wheels(run: RoverRun, name: str) -> Array:
    """(n, 6) angles ("q", rad) or rates ("v", rad/s) of the wheels, positive forward; zero where a wheel is welded."""
    columns = np.array(run.model.wheel_joint_indices)
    values: Array = run.trajectory[name][:, columns] * drive_signs(run.model)
    values[:, columns < 0] = 0.0
    return values
