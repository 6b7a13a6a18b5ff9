"""Figures of a planar run: its path over the ground, speed and slip, loads, gaps, energy, and all of them on a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import Polyline
from rover_gym.show.figures.style import (
    DARK,
    QUANTITY_COLOURS,
    Drawing,
    broken_off,
    circle,
    panel_legend,
    plain,
)
from rover_gym.show.frames.appearance import PLANAR_WHEEL_COLOURS

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

    from rover_gym.record.planar_run import PlanarRun
    from rover_gym.show.figures.style import Sheet

Array = npt.NDArray[np.float64]

GROUND = "#8c6d46"
#: Longest stretch of ground that is shown, in diameters of the largest disc: beyond it a step is a hair's breadth.
STRETCH = 20.0
STANCES = 6  # in which the machine is drawn along its way


def path_over_ground(axes: Axes, run: PlanarRun) -> None:
    """The discs' centres over the ground, and the machine in some of its stances; a long way is shown in part."""
    low, high = _stretch(run)
    ground = np.linspace(low, high, 2000)
    if isinstance(run.ground, Polyline):
        ground = np.sort(np.concatenate((ground, run.ground.x - 1e-9, run.ground.x)))
        ground = ground[(ground >= low) & (ground <= high)]
    heights = run.ground.height(ground)
    axes.plot(ground, heights, color=GROUND, label="ground")
    axes.fill_between(ground, heights, heights.min() - 10.0, color=GROUND, alpha=0.15)
    discs = run.discs
    seen = np.flatnonzero(((discs[..., 0] > low) & (discs[..., 0] < high)).all(axis=1))
    for i, (name, colour) in enumerate(_discs(run)):
        axes.plot(*discs[seen, i, :2].T, color=colour, linewidth=0.8, label=f"centre of {name}")
    for row in _stances(discs[seen, :, 0].mean(axis=1)):
        places = discs[seen[row]]
        if len(places) > 1:
            axes.plot(*places[:, :2].T, color=DARK, linewidth=2.0)
        for (x, y, angle), radius, (_, colour) in zip(places, run.radius, _discs(run), strict=True):
            circle(axes, x, y, radius, color=colour)
            tip = radius * np.array([np.cos(angle), np.sin(angle)])
            axes.plot([x, x + tip[0]], [y, y + tip[1]], color=colour, linewidth=0.8)
    tops = discs[seen, :, 1] + run.radius
    margin = 0.3 * float(run.radius.max())
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(low, high))
    axes.set_ylim(float(heights.min()) - margin, max(float(tops.max()), float(heights.max())) + margin)
    axes.set_aspect("equal", adjustable="box")


def speed_and_slip(axes: Axes, run: PlanarRun) -> None:
    """Speed of the machine and of its rims."""
    axes.plot(run.time, run.trajectory["v"][:, 0], color=DARK, label="forward")
    for i, (name, colour) in enumerate(_discs(run)):
        rim = run.slip_speeds[:, i] + run.trajectory["v"][:, 0]
        axes.plot(run.time, rim, color=colour, linewidth=0.9, label=f"rim, {name}")
    axes.set(xlabel="time (s)", ylabel="speed (m/s)")


def disc_loads(axes: Axes, run: PlanarRun) -> None:
    """Force of the ground on each disc along its normal."""
    loads = run.loads
    for i, (name, colour) in enumerate(_discs(run)):
        axes.plot(run.time, loads[:, i], color=colour, label=name)
    peak, bulk = float(loads.max()), float(np.percentile(loads, 98.0))
    if bulk > 0.0 and peak > 4.0 * bulk:  # one impact must not flatten the rest
        axes.set_ylim(-0.05 * bulk, 1.5 * bulk)
        axes.set(ylabel=f"load, without its\npeak of {peak:,.0f} N (N)")
    else:
        axes.set(ylabel="load (N)")
    axes.set(xlabel="time (s)")


def disc_gaps(axes: Axes, run: PlanarRun) -> None:
    """Distance from each disc to the ground."""
    for i, (name, colour) in enumerate(_discs(run)):
        axes.plot(run.time, 1e3 * run.trajectory["gaps"][:, i], color=colour, label=name)
    axes.set(xlabel="time (s)", ylabel="gap (mm)")


def mechanical_energy(axes: Axes, run: PlanarRun) -> None:
    """Kinetic energy, potential energy above its lowest value, and their sum."""
    kinetic, potential = run.trajectory["kinetic_energy"], run.trajectory["potential_energy"]
    potential = potential - potential.min()
    for values, label, colour in (
        (kinetic, "kinetic", QUANTITY_COLOURS[0]),
        (potential, "potential", QUANTITY_COLOURS[1]),
        (kinetic + potential, "sum", DARK),
    ):
        axes.plot(run.time, values, color=colour, label=label)
    axes.set(xlabel="time (s)", ylabel="energy (J)")


_PANELS: dict[str, Callable[[Axes, PlanarRun], None]] = {
    "path": path_over_ground,
    "speed": speed_and_slip,
    "loads": disc_loads,
    "gaps": disc_gaps,
    "energy": mechanical_energy,
}


def _alone(draw: Callable[[Axes, PlanarRun], None]) -> Drawing:
    def fill(figure: Sheet, run: PlanarRun) -> None:
        axes = figure.subplots()
        draw(axes, run)
        panel_legend(axes)
        figure.suptitle(_title(run))

    return Drawing(fill, 5.0)


#: By file name.
PLANAR_DRAWINGS = {name: _alone(draw) for name, draw in _PANELS.items()}


def planar_page(figure: Sheet, run: PlanarRun) -> None:
    """The path over the ground, and speed, loads, gaps and energy against time."""
    grid = figure.add_gridspec(3, 2)
    places = {"path": grid[0, :], "speed": grid[1, 0], "loads": grid[1, 1], "gaps": grid[2, 0], "energy": grid[2, 1]}
    for name, place in places.items():
        axes = figure.add_subplot(place)
        _PANELS[name](axes, run)
        panel_legend(axes, columns=4 if name == "path" else 3)
    figure.suptitle(_title(run))


def _title(run: PlanarRun) -> str:
    low, high = _stretch(run)
    x = run.discs[..., 0]
    part = f", shown from x = {low:.3g} to {high:.3g} m" if x.min() < low or x.max() > high else ""
    return f"{plain(run.title)}, {run.time[-1] - run.time[0]:.3g} s{part}{broken_off(run)}"


def _discs(run: PlanarRun) -> list[tuple[str, str]]:
    """Name and colour of each disc, back to front."""
    return list(zip(run.names, PLANAR_WHEEL_COLOURS[: len(run.names)], strict=True))


def _stretch(run: PlanarRun) -> tuple[float, float]:
    """The ground that is shown, m: the machine's way, of a long one the piece about a step, else the first."""
    x, radius = run.discs[..., 0], float(run.radius.max())
    low, high = float(x.min()) - 2.0 * radius, float(x.max()) + 2.0 * radius
    longest = 2.0 * radius * STRETCH
    if high - low <= longest:
        return low, high
    begin = float(x[0].mean())
    if isinstance(run.ground, Polyline):
        corners = run.ground.x[(run.ground.x > low) & (run.ground.x < high)]
        if len(corners):
            begin = float(corners.mean())
            middle = min(max(begin, low + 0.5 * longest), high - 0.5 * longest)
            return middle - 0.5 * longest, middle + 0.5 * longest
    forward = float(x[-1].mean()) >= begin
    return (low, low + longest) if forward else (high - longest, high)


def _stances(x: Array) -> list[int]:
    """Rows at which the machine is drawn: spread evenly along its way `(n,)`, m."""
    if not len(x):
        return []
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(x)))))
    return sorted({int(np.searchsorted(way, share * way[-1])) for share in np.linspace(0.0, 1.0, STANCES)})
