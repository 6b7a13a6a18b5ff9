"""The way of a recorded run from above, over the ground that it drove on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rover_gym._core import Plane, SphereField
from rover_gym.extras import require
from rover_gym.figures.derived import Array
from rover_gym.figures.style import COLOURS, WHEELS, title, wheel_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.figures.style import Sheet
    from rover_gym.run import Run

MARGIN = 1.0  # m, shown around the way
N_HEADINGS = 12  # how many arrows show the heading along the way
ARROW = 0.6  # m


class Footprints(NamedTuple):
    """What shows of the spheres of a field, from above.

    Attributes:
        centres: (n, 2) x and z, m.
        radii: (n,) of the circles where the spheres leave the ground, m.
        heights: (n,) of the spheres' tops, above the ground or, without one, above the world's origin, m.
    """

    centres: Array
    radii: Array
    heights: Array


def path_from_above(figure: Sheet, run: Run) -> None:
    """The way of trunk and wheels, start, goal and heading; spheres as circles, by the height of their tops."""
    axes = figure.subplots()
    trajectory = run.trajectory
    trunk, centres = trajectory["q"][:, :3], trajectory["wheel_centres"]
    _show_extent(axes, run, figure)
    others = {}
    if isinstance(run.terrain, SphereField):
        _draw_spheres(figure, axes, run.terrain)
    for i, wheel in enumerate(WHEELS):
        axes.plot(centres[:, i, 2], centres[:, i, 0], color=COLOURS[wheel], linewidth=1.0, label=f"_{wheel} track")
    axes.plot(trunk[:, 2], trunk[:, 0], color="black", linewidth=1.3, linestyle=(0, (5, 2)), label="_trunk")
    others["trunk's origin"] = {"color": "black", "linestyle": (0, (5, 2))}
    axes.plot(trunk[0, 2], trunk[0, 0], "o", color="black", markersize=6, zorder=4, label="_start")
    others["start"] = {"marker": "o", "color": "black", "linestyle": "none"}
    if run.goal is not None:
        style = {"marker": "*", "color": "#DDCC00", "markeredgecolor": "black", "markersize": 15}
        axes.plot(run.goal[1], run.goal[0], zorder=5, label="_goal", **style)
        others["goal"] = {**style, "markersize": 10, "linestyle": "none"}
    _draw_headings(axes, trajectory["q"])
    others["heading"] = {"marker": "$\u2192$", "color": "black", "linestyle": "none", "markersize": 9}
    axes.set(xlabel="to the right, z (m)", ylabel="forward, x (m)")
    title(figure, f"The way from above, {run.time[-1] - run.time[0]:.3g} s{_slope(run.terrain)}", run)
    wheel_legend(figure, others)


def footprints(field: SphereField) -> Footprints:
    """What shows of a field's spheres above its ground."""
    centres, radii, ground = field.centres, field.radii, field.ground
    if ground is None:
        return Footprints(centres[:, [0, 2]], radii, centres[:, 1] + radii)
    distance = centres @ ground.normal + ground.offset  # of the centres from the ground
    at_ground = np.sqrt(np.maximum(radii**2 - np.minimum(distance, 0.0) ** 2, 0.0))
    return Footprints(centres[:, [0, 2]], at_ground, distance + radii)


def _draw_spheres(figure: Sheet, axes: Axes, field: SphereField) -> None:
    collections = require("matplotlib.collections", "demo")
    prints = footprints(field)
    upward = np.argsort(prints.heights)  # the highest last, so that it covers the others
    diameters = 2.0 * prints.radii[upward]
    circles = collections.EllipseCollection(
        diameters,
        diameters,
        np.zeros(len(diameters)),
        units="xy",
        offsets=prints.centres[upward][:, ::-1],
        offset_transform=axes.transData,
        cmap="Greys",
        edgecolors="0.55",
        linewidths=0.3,
        zorder=1,
    )
    circles.set_array(prints.heights[upward])
    low = 0.0 if field.ground is not None else float(prints.heights.min())
    span = max(float(prints.heights.max()) - low, 1e-6)
    circles.set_clim(low - 0.1 * span, low + 1.7 * span)  # light greys only, so that the tracks stand out
    axes.add_collection(circles, autolim=False)
    above = "the ground" if field.ground is not None else "y = 0"
    bar = figure.colorbar(circles, ax=axes, shrink=0.8, pad=0.02, label=f"top of the sphere above {above} (m)")
    bar.ax.set_ylim(low, low + span)


def _draw_headings(axes: Axes, q: Array) -> None:
    """Arrows along the heading, at equal ways along the path."""
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(q[:, [0, 2]], axis=0).T))))
    rows = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], N_HEADINGS)))
    heading = q[rows, 4]
    axes.quiver(
        q[rows, 2],
        q[rows, 0],
        -ARROW * np.sin(heading),
        ARROW * np.cos(heading),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.003,
        color="black",
        zorder=3,
    )


def _show_extent(axes: Axes, run: Run, figure: Sheet) -> None:
    """Shows way and goal with a margin, at one scale, and no more of the ground than fills the axes."""
    places = [run.trajectory["wheel_centres"][..., [2, 0]].reshape(-1, 2)]
    if run.goal is not None:
        places.append(np.array([[run.goal[1], run.goal[0]]]))
    seen = np.concatenate(places)
    low, high = seen.min(axis=0) - MARGIN, seen.max(axis=0) + MARGIN
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_autoscale_on(False)


def _slope(terrain: Plane | SphereField) -> str:
    """The slope of the ground, where there is one."""
    ground = terrain if isinstance(terrain, Plane) else terrain.ground
    if ground is None:
        return ""
    degrees = float(np.degrees(np.arccos(np.clip(ground.normal[1], -1.0, 1.0))))
    return f"; the ground slopes by {degrees:.1f}°" if degrees > 0.05 else ""
