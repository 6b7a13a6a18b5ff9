"""Curves of trials on a soil: the rover's slip and sinkage against torque, a wheel's pull and sinkage against slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.extras import MissingExtraError
from rover_gym.soil.soil_trials import Pull, SoilDrive

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.soil.traction import Traction

__all__ = ["draw_curves"]

#: Load colours (Okabe and Ito's palette).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def draw_curves(
    drives: Sequence[Sequence[SoilDrive]],
    pulls: Mapping[float, Sequence[Sequence[Pull]]],
    fits: Mapping[float, Traction],
    path: str | Path,
) -> Path:
    """Draws means over the beds, with one-standard-error bars if there are several beds, and the fitted pulls.

    Args:
        drives: Drives by torque, then by bed.
        pulls: Pulls by load (kg), then by slip, then by bed.
        fits: Fits by load.
        path: PNG file to write.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "demo") from error
    figure = Figure(figsize=(14.0, 7.4), layout="constrained")
    (speed, slip, depth), (pull, sinkage, note) = figure.subplots(2, 3)
    note.axis("off")
    torques = [row[0].torque for row in drives]
    for axes, name, unit in ((speed, "speed", 1.0), (slip, "slip", 1.0), (depth, "sinkage", 1e3)):
        _curve(axes, torques, [[unit * getattr(drive, name) for drive in row] for row in drives], "rover")
        axes.set_xlabel("torque of each wheel, N m")
    speed.set_ylabel("mean speed, m/s")
    slip.set_ylabel("slip")
    depth.set_ylabel("sinkage, mm")
    texts = []
    for (load, rows), colour in zip(pulls.items(), cycle(COLOURS), strict=False):
        slips, fit = [row[0].slip for row in rows], fits[load]
        ratios = [[trial.pull / trial.weight for trial in row] for row in rows]
        _curve(pull, slips, ratios, f"{load:g} kg", fmt="o", color=colour)
        between = np.linspace(min(slips), max(slips), 200)
        pull.plot(between, fit(between), color=colour)
        _curve(sinkage, slips, [[1e3 * trial.sinkage for trial in row] for row in rows], f"{load:g} kg", color=colour)
        texts.append(
            f"{load:g} kg:\n  A = {fit.limit}\n  s₀ = {fit.free_slip}\n  K = {fit.scale}\n"
            f"  slope from s = {fit.first:g} on: {fit.last_slope}"
        )
    pull.axhline(0.0, color="black", linewidth=0.8)
    pull.set(xlabel="slip", ylabel="drawbar pull / load of one wheel")
    sinkage.set(xlabel="slip", ylabel="sinkage of one wheel, mm")
    for axes in (pull, sinkage):
        axes.legend(title="load")
    note.text(
        0.0,
        1.0,
        "\n".join(("lines: pull / load = A (1 - exp(-(s - s₀) / K))\nof the slip s\n", *texts)),
        transform=note.transAxes,
        verticalalignment="top",
        fontsize=11.0,
    )
    figure.savefig(path, dpi=100)
    return Path(path)


def _curve(
    axes: Axes,
    x: Sequence[float],
    rows: Sequence[Sequence[float]],
    label: str,
    *,
    fmt: str = "o-",
    color: str = COLOURS[0],
) -> None:
    """Means of the rows over their finite values, with standard errors."""
    means, errors = [], []
    for row in rows:
        known = np.array(row)[np.isfinite(row)]
        means.append(known.mean() if len(known) else np.nan)
        errors.append(known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else 0.0)
    axes.errorbar(x, means, yerr=errors, fmt=fmt, color=color, markersize=4, capsize=3, label=label)
    axes.grid(alpha=0.3)
