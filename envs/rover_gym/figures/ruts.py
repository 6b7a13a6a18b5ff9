"""Ruts in a bed of balls: maps of its surface before and after, and sections along and across a track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rover_gym.figures.derived_signals import Array
from rover_gym.figures.style import DARK, QUANTITY_COLOURS, panel_legend
from rover_gym.figures.wheel_style import WheelStyle
from rover_gym.grains.grain_surface import SurfaceMap, surface_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.figures.style import Sheet
    from rover_gym.grains.grain_run import GrainRun

POINTS = 400  # of a section
SMOOTHED_CELLS = 4.0  # edge of the square over which a section is smoothed: two balls
MAP_CELLS = 5  # edge of the square over which a map is smoothed
FINEST = 600  # cells along a map, at most


def surfaces_of_run(run: GrainRun) -> tuple[SurfaceMap, SurfaceMap]:
    """The surface of the balls at the first and the last sample, on the same cells."""
    first, last = run.positions_of(run.rows[:1])[0], run.positions_of(run.rows[-1:])[0]
    low, high = (
        (first[:, [0, 2]].min(axis=0) - run.radius.max()).astype(float),
        (first[:, [0, 2]].max(axis=0) + run.radius.max()).astype(float),
    )
    cell = max(float(run.radius.mean()), float((high - low).max()) / FINEST)
    bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return surface_map(first, run.radius, cell, bounds), surface_map(last, run.radius, cell, bounds)


def rut_maps(figure: Sheet, run: GrainRun) -> None:
    """Height before, height after, and the change, with the wheels' ways; means over squares of two balls."""
    before, after = (surface.smoothed(MAP_CELLS) for surface in surfaces_of_run(run))
    # Beds longer than wide one above the other, others side by side.
    is_wide = np.ptp(before.z) > np.ptp(before.x)
    panels = figure.subplots(*((1, 3) if is_wide else (3, 1)), sharex=True, sharey=True)
    known = 1e3 * np.concatenate((before.heights.ravel(), after.heights.ravel()))
    low, high = np.nanquantile(known, (0.01, 0.995))
    change = 1e3 * (after.heights - before.heights)
    finite = np.abs(change[np.isfinite(change)])
    most = max(float(np.quantile(finite, 0.99)) if len(finite) else 0.0, 1e-3)
    edges = before.x[0], before.x[-1], before.z[-1], before.z[0]
    shown = (
        (1e3 * before.heights, "before: height (mm)", "viridis", low, high),
        (1e3 * after.heights, "after: height (mm)", "viridis", low, high),
        (change, "change (mm)", "RdBu", -most, most),
    )
    for axes, (values, name, colours, least, largest) in zip(panels, shown, strict=True):
        # z points to the right: seen from above with x to the right, it points down.
        image = axes.imshow(values, extent=edges, cmap=colours, vmin=least, vmax=largest, aspect="equal")
        axes.grid(visible=False)
        if is_wide:
            axes.set(xlabel="x (m)")
        else:
            axes.set(ylabel="z (m)")
        figure.colorbar(image, ax=axes, label=name, shrink=0.9)
    if run.model is not None:
        style = WheelStyle.of(run.model)
        for i, wheel in enumerate(style.names):
            way = run.wheel_centres[:, i]
            panels[2].plot(way[:, 0], way[:, 2], color=style.colours[wheel], linewidth=0.7, alpha=0.8)
        panels[2].set(xlim=edges[:2], ylim=edges[2:])
    panels[2].set(xlabel="x (m)")
    panels[0].set(ylabel="z (m)")


def rut_sections(figure: Sheet, run: GrainRun) -> None:
    """The surface before and after along a track and across it; through the middle of the bed without a rover."""
    before, after = surfaces_of_run(run)
    along, across = figure.subplots(2, 1)
    track = _track(run, before)
    middle = len(track) // 2
    direction = track[min(middle + 1, len(track) - 1)] - track[max(middle - 1, 0)]
    direction /= max(float(np.linalg.norm(direction)), 1e-12)
    aside = np.array([-direction[1], direction[0]])
    half = 0.5 * float(max(before.x[-1] - before.x[0], before.z[-1] - before.z[0]))
    if run.model is not None:
        half = min(half, 1.5 * run.model.clear_radius)
    steps = np.linspace(-half, half, POINTS)
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(track, axis=0), axis=1))))
    _section(along, before, after, track, way)
    _section(across, before, after, track[middle] + steps[:, None] * aside, steps)
    if run.model is None:
        along.set(xlabel="x, along the middle of the bed (m)")
        across.set(xlabel="z, across the bed, from the middle (m)")
    else:
        style = WheelStyle.of(run.model)
        along.set(xlabel=f"along the track of the {style.labels[style.names[0]]} wheel (m)")
        across.set(xlabel="across, from the middle of that track to the right (m)")
    for axes in (along, across):
        panel_legend(axes)


def _track(run: GrainRun, surface: SurfaceMap) -> Array:
    """(POINTS, 2) x and z, equally spaced: the first wheel's way over the bed, or the bed's middle along x."""
    low, high = np.array([surface.x[0], surface.z[0]]), np.array([surface.x[-1], surface.z[-1]])
    way = np.empty((0, 2)) if run.model is None else run.wheel_centres[:, 0][:, [0, 2]]
    way = way[((low <= way) & (way <= high)).all(axis=1)]
    if len(way) < 2:
        x = np.linspace(low[0], high[0], POINTS)
        return np.column_stack((x, np.full(POINTS, 0.5 * (low[1] + high[1]))))
    travelled = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))))
    places = np.linspace(0.0, max(float(travelled[-1]), 1e-9), POINTS)
    return np.column_stack([np.interp(places, travelled, way[:, i]) for i in range(2)])


def _section(axes: Axes, before: SurfaceMap, after: SurfaceMap, places: Array, way: Array) -> None:
    old, new = (1e3 * surface.at(places, width=SMOOTHED_CELLS * surface.cell) for surface in (before, after))
    axes.plot(way, old, color=DARK, linewidth=0.9, label="before")
    axes.plot(way, new, color=QUANTITY_COLOURS[1], label="after")
    axes.fill_between(way, old, new, where=np.isfinite(old) & np.isfinite(new), color=QUANTITY_COLOURS[1], alpha=0.15)
    axes.set(ylabel="height (mm)")
