"""Curves over time of a recorded run of disks: speed, slip and sinkage, wheel forces, energy and contacts.

Signals that jump from row to row are drawn twice: every sample as a light line, and the smoothed curve as a bold one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.core.extras import MissingExtraError
from rover_gym.core.files import written_whole
from rover_gym.envs.start import SLIP_SPEED
from rover_gym.ground.grains.disk_trials import DiskDrive, Pull
from rover_gym.show.figures.derived_signals import WINDOW, plot_contacts, plot_energy, raw_and_smooth, smooth
from rover_gym.show.figures.style import DARK, Drawing, finish
from rover_gym.show.frames.appearance import PLANAR_WHEEL_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.ground.grains.disk_trials import Traction
    from rover_gym.record.disk_run import DiskRun
    from rover_gym.show.figures.style import Sheet


def driving(figure: Sheet, run: DiskRun) -> None:
    """Speed of rover and rims, wheel slip and sinkage."""
    speed, slip, depth = figure.subplots(3, 1, sharex=True)
    rates = run.trajectory["machine_rate"]
    forward = rates[:, 0]
    rims = run.slip_speeds + forward[:, None]
    smoothed_forward, smoothed_rims = smooth(run.time, forward, WINDOW), smooth(run.time, rims, WINDOW)
    mean = f"mean over {WINDOW:g} s"
    raw_and_smooth(speed, run.time, forward, DARK, f"rover, {mean}")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 100.0 * np.where(smoothed_rims > SLIP_SPEED, 1.0 - smoothed_forward[:, None] / smoothed_rims, np.nan)
    for i, (name, colour) in enumerate(_wheels(run)):
        raw_and_smooth(speed, run.time, rims[:, i], colour, f"rim, {name}, {mean}")
        slip.plot(run.time, ratios[:, i], color=colour, label=name)
        depth.plot(run.time, 1e3 * run.sinkage[:, i], color=colour, label=name)
    speed.set(ylabel="speed (m/s)")
    slip.set(ylabel="slip (%)", ylim=(-10.0, 110.0))
    depth.axhline(0.0, color=DARK, linewidth=0.6)
    depth.set(ylabel="sinkage (mm)", xlabel="time (s)")
    finish(figure, "Speed, slip and sinkage", run, speed, slip, depth)


def wheel_forces(figure: Sheet, run: DiskRun) -> None:
    """Vertical and horizontal force of the disks on each wheel."""
    load, thrust = figure.subplots(2, 1, sharex=True)
    forces = np.array(run.wheel_forces)
    forces[0] = np.nan  # no step had been taken
    for i, (name, colour) in enumerate(_wheels(run)):
        label = f"{name}, mean over {WINDOW:g} s"
        raw_and_smooth(load, run.time, forces[:, i, 1], colour, label)
        raw_and_smooth(thrust, run.time, forces[:, i, 0], colour, label)
    load.set(ylabel="vertical force (N)")
    thrust.axhline(0.0, color=DARK, linewidth=0.6)
    thrust.set(ylabel="horizontal force,\npositive forward (N)", xlabel="time (s)")
    finish(figure, "Force of the disks on the wheels, mean since the row before", run, load, thrust)


def disks_and_contacts(figure: Sheet, run: DiskRun) -> None:
    """Energy of disks and rover, number of contacts, deepest overlap."""
    energy, contacts, overlap = figure.subplots(3, 1, sharex=True)
    plot_energy(energy, run)
    plot_contacts(contacts, overlap, run, " of the row's last step")
    contacts.set(ylabel="contacts (1)")
    overlap.set(xlabel="time (s)")
    finish(figure, "Disks and contacts", run, energy, contacts, overlap)


#: By file name.
DISK_DRAWINGS = {
    "driving": Drawing(driving, fits=lambda run: run.wheels.shape[1] > 0),
    "wheel-forces": Drawing(wheel_forces, fits=lambda run: run.wheels.shape[1] > 0),
    "disks-and-contacts": Drawing(disks_and_contacts),
}


def _wheels(run: DiskRun) -> list[tuple[str, str]]:
    """Name and colour of each wheel."""
    n = run.wheels.shape[1]
    names = ("back wheel", "front wheel") if n == 2 else tuple(f"wheel {i + 1}" for i in range(n))
    return [(name, PLANAR_WHEEL_COLOURS[i % len(PLANAR_WHEEL_COLOURS)]) for i, name in enumerate(names)]


#: Load colours (Okabe and Ito's palette).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")


def draw_curves(
    drives: Sequence[Sequence[DiskDrive]],
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
    with written_whole(path) as draft:
        figure.savefig(draft, dpi=100)
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
