"""Curves of trials on a soil: the rover's slip and sinkage against torque, a wheel's pull and sinkage against slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.extras import MissingExtraError
from rover_gym.soil_trials import Drive, Pull

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_curves"]


def draw_curves(
    drives: Sequence[Sequence[Drive]], pulls: Mapping[float, Sequence[Sequence[Pull]]], path: str | Path
) -> Path:
    """Draws means over the beds, with bars of one standard error where there are several beds.

    Args:
        drives: By torque, then by bed.
        pulls: By load (kg), then by slip, then by bed.
        path: PNG file.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "demo") from error
    figure = Figure(figsize=(11.0, 7.4), layout="constrained")
    (speed, slip), (depth, pull) = figure.subplots(2, 2)
    torques = [row[0].torque for row in drives]
    for axes, name, unit in ((speed, "speed", 1.0), (slip, "slip", 1.0), (depth, "sinkage", 1e3)):
        _curve(axes, torques, [[unit * getattr(drive, name) for drive in row] for row in drives], "rover")
        axes.set_xlabel("torque of each wheel, N m")
    speed.set_ylabel("mean speed, m/s")
    slip.set_ylabel("slip")
    depth.set_ylabel("sinkage, mm")
    for load, rows in pulls.items():
        slips = [row[0].slip for row in rows]
        _curve(pull, slips, [[result.pull / result.weight for result in row] for row in rows], f"{load:g} kg")
    pull.axhline(0.0, color="black", linewidth=0.8)
    pull.set(xlabel="slip", ylabel="drawbar pull / load of one wheel")
    if len(pulls) > 1:
        pull.legend(title="load")
    figure.savefig(path, dpi=100)
    return Path(path)


def _curve(axes: Axes, x: Sequence[float], rows: Sequence[Sequence[float]], label: str) -> None:
    """Means of the rows, numbers only, with their standard errors."""
    means, errors = [], []
    for row in rows:
        known = np.array(row)[np.isfinite(row)]
        means.append(known.mean() if len(known) else np.nan)
        errors.append(known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else 0.0)
    axes.errorbar(x, means, yerr=errors, fmt="o-", markersize=4, capsize=3, label=label)
    axes.grid(alpha=0.3)
