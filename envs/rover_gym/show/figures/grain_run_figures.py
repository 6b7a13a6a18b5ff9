"""Figures of a recorded run of balls in space: wheels, ruts, energy and contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rover_gym.core import RoverModel
from rover_gym.envs.start import SLIP_SPEED
from rover_gym.ground.grains.grain_surface import SurfaceMap, surface_map
from rover_gym.show.figures.derived_signals import (
    SMOOTHED,
    WINDOW,
    Array,
    of_wheels,
    plot_contacts,
    plot_energy,
    plot_raw_and_smooth,
    raw_and_smooth,
    smooth,
)
from rover_gym.show.figures.style import (
    DARK,
    QUANTITY_COLOURS,
    Drawing,
    WheelStyle,
    finish,
    panel_legend,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_gym.record.grain_run import GrainRun
    from rover_gym.show.figures.style import Sheet


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
        axes.set_title(name, loc="left")
        if name.startswith("before"):
            continue  # the map after has the same colours
        # A bar beside or over its map, of its length: the map's shape, not the panel's, sets both.
        place = (0.0, -0.24, 1.0, 0.03) if is_wide else (1.015, 0.0, 0.012, 1.0)
        bar = axes.inset_axes(place)
        figure.colorbar(image, cax=bar, orientation="horizontal" if is_wide else "vertical")
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


def wheel_forces(figure: Sheet, run: GrainRun) -> None:
    """Load, thrust and side force of each wheel."""
    panels = figure.subplots(3, 1, sharex=True)
    style = WheelStyle.of(_model(run))
    heading = run.trajectory["q"][:, 4]
    ahead = np.stack((np.cos(heading), np.zeros_like(heading), -np.sin(heading)), axis=1)
    right = np.stack((np.sin(heading), np.zeros_like(heading), np.cos(heading)), axis=1)
    forces = run.wheel_forces
    along = np.einsum("nwi,ni->nw", forces, ahead), np.einsum("nwi,ni->nw", forces, right)
    for axes, values, name in zip(
        panels,
        (forces[..., 1], *along),
        ("load", "thrust,\npositive forward", "side force,\nto the right"),
        strict=True,
    ):
        plot_raw_and_smooth(axes, style, run.time, values, style.names)
        axes.axhline(0.0, color=DARK, linewidth=0.6)
        axes.set(ylabel=f"{name} (N)")
    panels[-1].set(xlabel="time (s)")
    style.legend(figure, note=SMOOTHED)
    finish(figure, "Force of balls and ground on the wheels, mean since the row before", run)


def sinkage_and_slip(figure: Sheet, run: GrainRun) -> None:
    """Sinkage below the first surface, slip of each wheel, and the rover's speed."""
    depth, slip, speed = figure.subplots(3, 1, sharex=True)
    style = WheelStyle.of(_model(run))
    style.plot(depth, run.time, 1e3 * run.sinkage)
    depth.axhline(0.0, color=DARK, linewidth=0.6)
    depth.set(ylabel="sinkage (mm)")
    style.plot(slip, run.time, 100.0 * slip_of_wheels(run))
    slip.set(ylabel="slip (%)", ylim=(-20.0, 110.0))
    rate = np.hypot(*run.trajectory["v"][:, [0, 2]].T)
    raw_and_smooth(speed, run.time, rate, DARK)
    speed.set(ylabel="speed of the trunk (m/s)", xlabel="time (s)")
    style.legend(figure, note=f"slip and speed: smoothed over {WINDOW:g} s")
    finish(figure, "Sinkage and slip of the wheels, speed", run)


def slip_of_wheels(run: GrainRun) -> Array:
    """(n, n_wheels) share of the rim's way that a wheel's centre falls short of, smoothed; nan where the rim stands.

    Raises:
        RecordingError: The run has no rover.
    """
    centres = run.wheel_centres
    if run.rover is None or run.n_frames < 3:
        return np.full(centres.shape[:2], np.nan)
    heading = run.trajectory["q"][:, 4]
    ahead = np.stack((np.cos(heading), np.zeros_like(heading), -np.sin(heading)), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # between equal times there is no speed
        travel = np.einsum("nwi,ni->nw", np.gradient(centres, run.time, axis=0), ahead)
    rims = of_wheels(run.rover, "v") * run.rover.model.wheel_radii
    travel, rims = smooth(run.time, travel, WINDOW), smooth(run.time, rims, WINDOW)
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Array = np.where(np.abs(rims) > SLIP_SPEED, 1.0 - travel / rims, np.nan)
    return result


def balls_and_contacts(figure: Sheet, run: GrainRun) -> None:
    """Energy, number of contacts, deepest overlap and the solver's residual."""
    energy, contacts, overlap, residual = figure.subplots(4, 1, sharex=True)
    data = run.trajectory
    plot_energy(energy, run)
    plot_contacts(contacts, overlap, run, ", most of a row's steps")
    contacts.plot(run.time, data["n_asleep"], color=QUANTITY_COLOURS[4], label="balls asleep")
    contacts.set(ylabel="number (1)")
    contacts.set_ylim(bottom=0.0)
    worst = np.where(data["solver_residual"] > 0.0, data["solver_residual"], np.nan)
    residual.plot(run.time, worst, color=QUANTITY_COLOURS[0], label="largest residual of a row's steps")
    residual.set(ylabel="residual (1)", xlabel="time (s)", yscale="log")
    tolerance = data.attributes.get("solver", {}).get("tolerance")
    if isinstance(tolerance, float) and tolerance > 0.0:
        residual.axhline(tolerance, color=DARK, linewidth=0.8, linestyle="--", label="tolerance")
    finish(figure, "Balls and contacts", run, energy, contacts, overlap, residual)


def ruts(figure: Sheet, run: GrainRun) -> None:
    """The surface at the first and the last sample, and what changed."""
    rut_maps(figure, run)
    finish(figure, "Surface of the balls", run)


def sections(figure: Sheet, run: GrainRun) -> None:
    """Sections along and across a track, or through the middle of the bed."""
    rut_sections(figure, run)
    finish(figure, "Sections through the surface of the balls", run)


#: By file name.
GRAIN_DRAWINGS = {
    "wheel-forces": Drawing(wheel_forces, fits=lambda run: run.model is not None),
    "sinkage-and-slip": Drawing(sinkage_and_slip, fits=lambda run: run.model is not None),
    "ruts": Drawing(ruts),
    "sections": Drawing(sections),
    "balls-and-contacts": Drawing(balls_and_contacts),
}


def _model(run: GrainRun) -> RoverModel:
    return RoverModel() if run.model is None else run.model
