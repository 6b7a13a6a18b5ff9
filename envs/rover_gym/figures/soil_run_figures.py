"""Curves over time of a recorded soil run: speed, slip and sinkage, wheel forces, energy and contacts.

Signals that jump from row to row are drawn twice: every sample as a light line, and the smoothed curve as a bold one.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.env.wheels import SLIP_SPEED
from rover_gym.figures.derived_signals import Array, smooth
from rover_gym.figures.saving import check_format, save_figures
from rover_gym.figures.signals import WINDOW
from rover_gym.figures.style import DARK, QUANTITY_COLOURS, panel_legend, plain
from rover_gym.rendering.appearance import PLANAR_WHEEL_COLOURS

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

    from rover_gym.figures.style import Sheet
    from rover_gym.soil.soil_run import SoilRun

__all__ = ["SOIL_DRAWINGS", "draw_soil_run"]


def draw_soil_run(
    run: SoilRun, folder: str | Path, *, file_format: str = "png", with_overview: bool = False
) -> list[Path]:
    """Draws the curves of a run on a soil.

    Args:
        run: From `read_soil_run`.
        folder: Output folder; created if it does not exist. For a soil without wheels only the disks are drawn.
        file_format: "png", "svg" or "pdf".
        with_overview: Whether to add one page with all figures.

    Returns:
        Paths of the files.

    Raises:
        OptionError: The file format is unknown.
        MissingExtraError: matplotlib is not installed.
    """
    check_format(file_format)
    chosen = {name: draw for name, draw in SOIL_DRAWINGS.items() if run.wheels.shape[1] or name not in OF_WHEELS}
    drawings = {name: partial(_fill, draw=draw, run=run) for name, draw in chosen.items()}
    paths = save_figures(drawings, folder, height=6.5, file_format=file_format)
    if with_overview:
        page = {"overview": partial(_overview, draws=list(chosen.values()), run=run)}
        paths += save_figures(page, folder, height=6.5 * len(chosen), file_format=file_format)
    return paths


def driving(figure: Sheet, run: SoilRun) -> None:
    """Speed of rover and rims, wheel slip and sinkage."""
    speed, slip, depth = figure.subplots(3, 1, sharex=True)
    rates = run.trajectory["machine_rate"]
    forward = rates[:, 0]
    rims = run.slip_speeds + forward[:, None]
    smoothed_forward, smoothed_rims = smooth(run.time, forward, WINDOW), smooth(run.time, rims, WINDOW)
    _raw_and_smooth(speed, run, forward, DARK, "rover")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 100.0 * np.where(smoothed_rims > SLIP_SPEED, 1.0 - smoothed_forward[:, None] / smoothed_rims, np.nan)
    for i, (name, colour) in enumerate(_wheels(run)):
        _raw_and_smooth(speed, run, rims[:, i], colour, f"rim, {name}")
        slip.plot(run.time, ratios[:, i], color=colour, label=name)
        depth.plot(run.time, 1e3 * run.sinkage[:, i], color=colour, label=name)
    speed.set(ylabel="speed (m/s)")
    slip.set(ylabel="slip (%)", ylim=(-10.0, 110.0))
    depth.axhline(0.0, color=DARK, linewidth=0.6)
    depth.set(ylabel="sinkage (mm)", xlabel="time (s)")
    _finish(figure, (speed, slip, depth), "Speed, slip and sinkage", run)


def wheel_forces(figure: Sheet, run: SoilRun) -> None:
    """Vertical and horizontal force of the soil on each wheel."""
    load, thrust = figure.subplots(2, 1, sharex=True)
    forces = np.array(run.wheel_forces)
    forces[0] = np.nan  # no step had been taken
    for i, (name, colour) in enumerate(_wheels(run)):
        _raw_and_smooth(load, run, forces[:, i, 1], colour, name)
        _raw_and_smooth(thrust, run, forces[:, i, 0], colour, name)
    load.set(ylabel="vertical force (N)")
    thrust.axhline(0.0, color=DARK, linewidth=0.6)
    thrust.set(ylabel="horizontal force,\npositive forward (N)", xlabel="time (s)")
    _finish(figure, (load, thrust), "Force of the soil on the wheels, mean since the row before", run)


def disks_and_contacts(figure: Sheet, run: SoilRun) -> None:
    """Energy of disks and rover, number of contacts, deepest overlap."""
    energy, contacts, overlap = figure.subplots(3, 1, sharex=True)
    data = run.trajectory
    potential = data["potential_energy"] - data["potential_energy"][0]
    energy.plot(run.time, data["kinetic_energy"], color=QUANTITY_COLOURS[0], label="kinetic")
    energy.plot(run.time, potential, color=QUANTITY_COLOURS[1], label="potential, from the start")
    energy.set(ylabel="energy (J)")
    number = np.array(data["n_contacts"])
    number[0] = np.nan  # no step had been taken
    contacts.plot(run.time, number, color=QUANTITY_COLOURS[2], label="contacts of the row's last step")
    contacts.set(ylabel="contacts (1)")
    share = 100.0 * data["penetration"] / float(run.radius.min())
    overlap.plot(run.time, share, color=QUANTITY_COLOURS[3], label="deepest overlap, share of the smallest radius")
    overlap.set(ylabel="overlap (%)", xlabel="time (s)")
    overlap.set_ylim(bottom=0.0)
    _finish(figure, (energy, contacts, overlap), "Disks and contacts", run)


#: By file name.
SOIL_DRAWINGS: dict[str, Callable[[Sheet, SoilRun], None]] = {
    "driving": driving,
    "wheel-forces": wheel_forces,
    "disks-and-contacts": disks_and_contacts,
}
#: Figures that need wheels.
OF_WHEELS = frozenset({"driving", "wheel-forces"})


def _fill(figure: Sheet, draw: Callable[[Sheet, SoilRun], None], run: SoilRun) -> None:
    draw(figure, run)


def _wheels(run: SoilRun) -> list[tuple[str, str]]:
    """Name and colour of each wheel."""
    n = run.wheels.shape[1]
    names = ("back wheel", "front wheel") if n == 2 else tuple(f"wheel {i + 1}" for i in range(n))
    return [(name, PLANAR_WHEEL_COLOURS[i % len(PLANAR_WHEEL_COLOURS)]) for i, name in enumerate(names)]


def _raw_and_smooth(axes: Axes, run: SoilRun, values: Array, colour: str, name: str) -> None:
    """Draws every sample as a light line, and the smoothed curve; values (n,)."""
    axes.plot(run.time, values, color=colour, linewidth=0.5, alpha=0.35, label=f"_{name} samples")
    axes.plot(run.time, smooth(run.time, values, WINDOW), color=colour, label=f"{name}, mean over {WINDOW:g} s")


def _finish(figure: Sheet, panels: tuple[Axes, ...], what: str, run: SoilRun) -> None:
    """Adds legends, and a title naming the figure and the run."""
    for axes in panels:
        panel_legend(axes)
    broken_off = "" if run.trajectory.attributes.get("complete", True) else " (the recording was broken off)"
    figure.suptitle(f"{what}\n{plain(run.title)}{broken_off}")


def _overview(figure: Sheet, draws: list[Callable[[Sheet, SoilRun], None]], run: SoilRun) -> None:
    """All figures stacked on one page."""
    parts = figure.subfigures(len(draws), 1, squeeze=False).flat
    for part, draw in zip(parts, draws, strict=True):
        draw(part, run)
