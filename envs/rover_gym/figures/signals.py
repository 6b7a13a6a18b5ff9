"""Drawing of signals that jump from step to step, and axes for values of very different magnitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rover_gym.figures.derived_signals import Array, smooth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.figures.wheel_style import WheelStyle

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
        "logarithmic above this line",
        (1.0, threshold),
        xycoords=("axes fraction", "data"),
        xytext=(-3, 2),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=7.5,
        color="0.45",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.5},
    )
