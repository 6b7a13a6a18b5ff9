"""The path of a recorded run from above, over its ground."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rover_gym.core import SphereField, Terrain
from rover_gym.core.extras import require
from rover_gym.ground.terrain_parts import parts_of, plane_of, spheres_of, surface_heights, surfaces_of
from rover_gym.show.figures.derived_signals import Array
from rover_gym.show.figures.style import WheelStyle, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.record.rover_run import RoverRun
    from rover_gym.show.figures.style import Sheet

MARGIN = 0.1  # shown around the way, of its larger extent
RATIO = 1.5  # of the map, width to height
HEADING_DISTANCE = 1.8  # spacing of the heading arrows, in arrow lengths
ARROW = 0.045  # of the map's width


SAND = "YlOrBr_r"  # colours of the height of sand


class Footprints(NamedTuple):
    """The visible parts of a field's spheres, from above.

    Attributes:
        centres: (n, 2) x and z, m.
        radii: (n,) of the circles where the spheres leave the ground, m.
        heights: (n,) of the spheres' tops, above the ground or, without one, above the world's origin, m.
    """

    centres: Array
    radii: Array
    heights: Array


def path_from_above(figure: Sheet, run: RoverRun) -> None:
    """Paths of trunk and wheels, start, goal and heading; spheres as circles shaded by the height of their tops."""
    axes = figure.subplots()
    trajectory = run.trajectory
    trunk, centres = trajectory["q"][:, :3], trajectory["wheel_centres"]
    _show_extent(axes, run)
    others: dict[str, dict[str, Any]] = {}
    if surfaces_of(run.terrain):
        _draw_heights(figure, axes, run.terrain, SAND if run.on_sand else "copper")
    if any(isinstance(part, SphereField) for part in parts_of(run.terrain)):
        _draw_spheres(figure, axes, run.terrain)
    wheels = WheelStyle.of(run.model)
    # Wide tracks for the back wheels, narrow ones for the front wheels on top.
    for wheel in sorted(wheels.names, key=lambda name: -wheels.widths[name]):
        x, _, z = centres[:, wheels.names.index(wheel)].T
        axes.plot(z, x, color=wheels.colours[wheel], linewidth=wheels.widths[wheel], label=f"_{wheel} track")
    axes.plot(trunk[:, 2], trunk[:, 0], color="black", linewidth=1.0, label="_trunk")
    others["trunk's origin"] = {"color": "black", "linewidth": 1.0}
    axes.plot(trunk[0, 2], trunk[0, 0], "o", color="black", markersize=6, zorder=4, label="_start")
    others["start"] = {"marker": "o", "color": "black", "linestyle": "none"}
    if run.goal is not None:
        style: dict[str, Any] = {"marker": "*", "color": "#DDCC00", "markeredgecolor": "black", "markersize": 15}
        axes.plot(run.goal[1], run.goal[0], zorder=5, label="_goal", **style)
        others["goal"] = {**style, "markersize": 10, "linestyle": "none"}
        if run.goal_tolerance is not None:
            edge: dict[str, Any] = {"color": "#117733", "linewidth": 1.2, "linestyle": "--"}
            turn = np.linspace(0.0, 2.0 * np.pi, 100)
            x, z = np.array(run.goal)[:, None] + run.goal_tolerance * np.array([np.cos(turn), np.sin(turn)])
            axes.plot(z, x, zorder=4, label="_reached", **edge)
            others["reached within"] = edge
    _draw_headings(axes, trajectory["q"])
    others["heading"] = {"marker": "$\u2192$", "color": "black", "linestyle": "none", "markersize": 9}
    axes.set(xlabel="to the right, z (m)", ylabel="forward, x (m)")
    finish(figure, f"The way from above, {run.time[-1] - run.time[0]:.3g} s{_slope(run.terrain)}", run)
    wheels.legend(figure, others)


def footprints(terrain: Terrain) -> Footprints:
    """The parts of a terrain's spheres above its ground."""
    (centres, radii), ground = spheres_of(terrain), plane_of(terrain)
    # Distance of the centres from the ground.
    if ground is not None:
        distance = centres @ ground.normal + ground.offset
    elif surfaces_of(terrain):
        distance = np.nan_to_num(centres[:, 1] - surface_heights(terrain, centres[:, [0, 2]]))
    else:
        return Footprints(centres[:, [0, 2]], radii, centres[:, 1] + radii)
    at_ground = np.sqrt(np.maximum(radii**2 - np.minimum(distance, 0.0) ** 2, 0.0))
    return Footprints(centres[:, [0, 2]], at_ground, distance + radii)


def _draw_heights(figure: Sheet, axes: Axes, terrain: Terrain, colours: str) -> None:
    """The ground's height as filled contours, with a colour bar."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    z, x = np.linspace(left, right, 150), np.linspace(bottom, top, 100)
    grid_z, grid_x = np.meshgrid(z, x)
    places = np.column_stack((grid_x.ravel(), grid_z.ravel()))
    heights = surface_heights(terrain, places).reshape(grid_x.shape)
    filled = axes.contourf(z, x, np.ma.masked_invalid(heights), levels=20, cmap=colours, alpha=0.45, zorder=0)
    figure.colorbar(filled, ax=axes, shrink=0.8, pad=0.02, label="height of the ground (m)")


def _draw_spheres(figure: Sheet, axes: Axes, field: Terrain) -> None:
    collections = require("matplotlib.collections", "demo")
    prints = _within(axes, footprints(field))
    if len(prints.radii) == 0:
        return
    upward = np.argsort(prints.heights)  # highest last, on top of the others
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
    is_on_ground = plane_of(field) is not None or bool(surfaces_of(field))
    low = 0.0 if is_on_ground else float(prints.heights.min())
    span = max(float(prints.heights.max()) - low, 1e-6)
    circles.set_clim(low - 0.1 * span, low + 2.2 * span)  # light greys only, so that the tracks stand out
    axes.add_collection(circles, autolim=False)
    if surfaces_of(field):
        return  # the colour bar is that of the ground
    above = "the ground" if is_on_ground else "y = 0"
    bar = figure.colorbar(circles, ax=axes, shrink=0.8, pad=0.02, label=f"top of the sphere above {above} (m)")
    bar.ax.set_ylim(low, low + span)


def _within(axes: Axes, prints: Footprints) -> Footprints:
    """The spheres within the axes' limits."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    x, z = prints.centres.T
    r = prints.radii
    seen = (z + r > left) & (z - r < right) & (x + r > bottom) & (x - r < top) & (r > 0.0)
    return Footprints(*(values[seen] for values in prints))


def _draw_headings(axes: Axes, q: Array) -> None:
    """Arrows along the heading, spaced apart: a rover rocking back and forth would otherwise blacken the map."""
    length = ARROW * float(np.ptp(axes.get_xlim()))
    rows = [0]
    for row, place in enumerate(q[:, [0, 2]]):
        if np.hypot(*(q[rows][:, [0, 2]] - place).T).min() > HEADING_DISTANCE * length:
            rows.append(row)
    heading = q[rows, 4]
    axes.quiver(
        q[rows, 2],
        q[rows, 0],
        -length * np.sin(heading),
        length * np.cos(heading),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0045,
        color="black",
        zorder=3,
    )


def _show_extent(axes: Axes, run: RoverRun) -> None:
    """Limits the view to path and goal plus a margin, at equal scales, with just enough ground to fill the axes."""
    places = [run.trajectory["wheel_centres"][..., [2, 0]].reshape(-1, 2)]
    if run.goal is not None:
        radius = run.goal_tolerance or 0.0
        places.append(np.array([run.goal[::-1]]) + radius * np.array([[-1.0, -1.0], [1.0, 1.0]]))
    seen = np.concatenate(places)
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = (high - low).max() * 2.0 * MARGIN + (high - low)
    height = max(extent[1], extent[0] / RATIO)
    half = 0.5 * height * np.array([RATIO, 1.0])
    (left, bottom), (right, top) = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set_autoscale_on(False)


def _slope(terrain: Terrain) -> str:
    """The ground's slope, if it has one."""
    ground = plane_of(terrain)
    if ground is None:
        return ""
    degrees = float(np.degrees(np.arccos(np.clip(ground.normal[1], -1.0, 1.0))))
    return f"; the ground slopes by {degrees:.1f}°" if degrees > 0.05 else ""
