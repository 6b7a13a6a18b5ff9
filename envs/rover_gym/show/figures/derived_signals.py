"""Signals derived from a recording: wheel slip, motor work, and smoothed curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.envs.start import SLIP_SPEED, drive_signs
from rover_gym.show.figures.style import QUANTITY_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.record.disk_run import DiskRun
    from rover_gym.record.grain_run import GrainRun
    from rover_gym.record.rover_run import RoverRun
    from rover_gym.record.run import Run
    from rover_gym.show.figures.style import WheelStyle


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
    step = max(float(np.median(np.diff(time))), 1e-6 * window)  # times may be the same
    half = max(round(0.5 * window / step), 1)
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


WINDOW = 0.5  # s, smoothing window: a few periods of the contact chatter, far less than a manoeuvre

SMOOTHED = f"bold: smoothed over {WINDOW:g} s; light: every sample"


def plot_raw_and_smooth(axes: Axes, style: WheelStyle, time: Array, values: Array, wheels: tuple[str, ...]) -> None:
    """Draws every sample as a light line, and the smoothed curve; values (n, n_wheels)."""
    measured = np.array(values)
    measured[0] = np.nan  # no step had been taken
    smoothed = smooth(time, measured, WINDOW)
    for wheel in wheels:
        i = style.names.index(wheel)
        axes.plot(time, values[:, i], color=style.colours[wheel], linewidth=0.5, alpha=0.35, label=f"_{wheel} samples")
    style.plot(axes, time, smoothed, wheels)


def raw_and_smooth(axes: Axes, time: Array, values: Array, colour: str, label: str | None = None) -> None:
    """Draws every sample as a light line, and the smoothed curve; values (n,)."""
    axes.plot(time, values, color=colour, linewidth=0.5, alpha=0.35, label=f"_{label} samples")
    axes.plot(time, smooth(time, values, WINDOW), color=colour, label=label)


def plot_energy(axes: Axes, run: Run) -> tuple[Array, Array]:
    """Draws kinetic and potential energy and returns them, J; the potential one is zero at the start."""
    kinetic, potential = run.trajectory["kinetic_energy"], run.trajectory["potential_energy"]
    potential = potential - potential[0]
    axes.plot(run.time, kinetic, color=QUANTITY_COLOURS[0], label="kinetic")
    axes.plot(run.time, potential, color=QUANTITY_COLOURS[1], label="potential, from the start")
    axes.set(ylabel="energy (J)")
    return kinetic, potential


def plot_contacts(contacts: Axes, overlap: Axes, run: DiskRun | GrainRun, counted: str) -> None:
    """Draws the number of contacts, which `counted` explains, and the deepest overlap of a run of grains."""
    number = np.array(run.trajectory["n_contacts"])
    number[0] = np.nan  # no step had been taken
    contacts.plot(run.time, number, color=QUANTITY_COLOURS[2], label=f"contacts{counted}")
    share = 100.0 * run.trajectory["penetration"] / float(run.radius.min())
    overlap.plot(run.time, share, color=QUANTITY_COLOURS[3], label="deepest overlap, share of the smallest radius")
    overlap.set(ylabel="overlap (%)")
    overlap.set_ylim(bottom=0.0)


def finite(values: Array) -> Array:
    """Values with nan for those that are not finite, so that they are not drawn."""
    return np.where(np.isfinite(values), values, np.nan)


def extremes(values: Array, low: float, high: float) -> tuple[float, float]:
    """Smallest and largest of the finite values, `low` and `high`."""
    known = values[np.isfinite(values)]
    return float(known.min(initial=low)), float(known.max(initial=high))


def linear_then_log(axes: Axes, threshold: float, low: float, high: float) -> None:
    """Makes the axis linear, or logarithmic above the threshold if the values go far beyond it."""
    if high <= 2.0 * threshold and low >= -2.0 * threshold:
        margin = 0.05 * (high - low)
        axes.set_ylim(low - margin if low < 0.0 else 0.0, max(high + margin, 0.1 * threshold))
        return
    decades = np.log10(max(high / threshold, 1.0)) + np.log10(max(-low / threshold, 1.0))
    axes.set_yscale("symlog", linthresh=threshold, linscale=max(float(decades), 0.8))
    axes.set_ylim(1.15 * low if low < 0.0 else 0.0, 1.3 * high)
    ticks = [0.5 * threshold, threshold]
    tick = 10.0 ** np.ceil(np.log10(1.5 * threshold))
    while tick <= 1.3 * high:
        ticks.append(tick)
        tick *= 10.0
    below = [-tick for tick in ticks if -tick >= 1.15 * low]
    axes.set_yticks([*below, 0.0, *ticks], labels=[f"{tick:g}" for tick in (*below, 0.0, *ticks)])
    axes.set_yticks([], minor=True)
    _explain(axes, threshold)


def round_up(value: float) -> float:
    """The next number whose half is round too."""
    scale = 10.0 ** np.floor(np.log10(value))
    return float(
        scale * next(digit for digit in (1.0, 2.0, 4.0, 6.0, 8.0, 10.0) if digit >= value / scale * (1 - 1e-9))
    )


def _explain(axes: Axes, threshold: float) -> None:
    """Marks where an axis becomes logarithmic."""
    axes.axhline(threshold, color="0.6", linewidth=0.5)
    axes.annotate(
        "logarithmic\nabove this line",
        (1.0, threshold),
        xycoords=("axes fraction", "data"),
        xytext=(3, 0),
        textcoords="offset points",
        ha="left",
        va="bottom",
        rotation=90.0,
        fontsize=6.5,
        color="0.45",
    )
