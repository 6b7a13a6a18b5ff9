"""Scenes of balls in vessels: a column that is set free, a silo that empties, a drum that turns."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.grains.ball_bed import DENSITY, check_memory, settle
from rover_gym.grains.grain_run import GrainRun
from rover_gym.grains.grain_surface import surface_map
from rover_gym.grains.sizes import MOST_BALLS
from rover_gym.mechanics import Drum, GrainSimulation, OptionError, Silo, ball_packing
from rover_gym.validation import checked, number, refuse, whole

Array = npt.NDArray[np.float64]

FLOOR = ((0.0, 0.0, 0.0, 0.0, 1.0, 0.0),)
SPREAD = 0.1  # radii of balls are drawn within this share of their mean
#: Share of a column's balls below its height, and share of the floor that balls cover at the edge of its deposit.
HIGHEST, COVERED = 0.98, 0.5
#: Share of a drum's radius about its axis in which the slope is measured, away from the wall.
INNER = 0.6


@checked(seed=int)
def column(count: int, tube: float, radius: float, *, seed: int = 0, **options: Any) -> GrainSimulation:
    """A round column of settled balls on a floor, whose tube has just been taken away.

    Args:
        count: Number of balls.
        tube: Radius of the column, m.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the tube is narrower than four balls.
        StepError: A step failed.
    """
    filled = _filled(count, tube, radius, Silo(tube), seed, options, walls=FLOOR)
    return GrainSimulation(filled.radius, filled.mass, filled.position, walls=FLOOR, **options)


@checked(seed=int)
def silo(count: int, tube: float, hole: float, radius: float, *, seed: int = 0, **options: Any) -> GrainSimulation:
    """A tube of settled balls on a floor, whose round hole has just been opened; balls fall on a lower floor.

    Args:
        count: Number of balls.
        tube: Radius of the tube, m.
        hole: Radius of the hole, m.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the tube is narrower than four balls.
        TerrainError: The hole is as wide as the tube.
        StepError: A step failed.
    """
    opened = Silo(tube, floor=0.0, hole=number("hole", hole, above=0.0))
    filled = _filled(count, tube, radius, Silo(tube, floor=0.0), seed, options)
    below = np.array(FLOOR)
    below[0, 1] = -tube
    return GrainSimulation(filled.radius, filled.mass, filled.position, vessel=opened, walls=below, **options)


@checked(seed=int)
def drum(
    count: int, wall: float, length: float, rate: float, radius: float, *, seed: int = 0, **options: Any
) -> GrainSimulation:
    """A drum along z with settled balls that begins to turn.

    Args:
        count: Number of balls.
        wall: Inner radius of the drum, m.
        length: Distance of its ends, m.
        rate: Angular velocity about +z, rad/s.
        radius: Mean radius of the balls, m.
        seed: Of radii and places.
        **options: Those of `GrainSimulation`.

    Raises:
        OptionError: A number is out of its range, or the balls do not fit.
        StepError: A step failed.
    """
    count, radius = _checked(count, radius)
    wall, length = number("wall", wall, above=0.0), number("length", length, above=0.0)
    places = _rows_in_drum(wall, length, (1.0 + SPREAD) * radius)
    if count > len(places):
        refuse(OptionError, "count", count, f"balls do not fit into the drum, which takes {len(places)} in rows")
    radii = radius * np.random.default_rng(seed).uniform(1.0 - SPREAD, 1.0 + SPREAD, count)
    mass = 4.0 / 3.0 * np.pi * DENSITY * radii**3
    filled = GrainSimulation(radii, mass, places[:count], vessel=Drum(wall, length), **options)
    settle(filled)
    turning = Drum(wall, length, rate)
    return GrainSimulation(filled.radius, filled.mass, filled.position, vessel=turning, **options)


@checked(run="GrainRun", tube=float)
def run_out(run: GrainRun, tube: float) -> tuple[float, float]:
    """Aspect ratio of a column at the first sample, and how far its edge went by the last, in its first radii.

    Single balls roll on: the edge is where balls cover less than half of the floor.

    Args:
        run: Of a `column`.
        tube: Its first radius, m.
    """
    first, last = (run.positions_of(run.rows[[k]])[0].astype(np.float64) for k in (0, -1))
    height = float(np.quantile(first[:, 1] + run.radius, HIGHEST))
    surface = surface_map(last, run.radius)
    x, z = np.meshgrid(surface.x, surface.z)
    rings = (np.hypot(x, z) / (2.0 * float(run.radius.mean()))).astype(int).ravel()
    covered = np.bincount(rings, np.isfinite(surface.heights).ravel()) / np.maximum(np.bincount(rings), 1)
    thin = np.flatnonzero(covered < COVERED)
    edge = 2.0 * float(run.radius.mean()) * float(thin[0] if len(thin) else len(covered))
    return height / tube, edge / tube - 1.0


@checked(run="GrainRun")
def outflow(run: GrainRun) -> Array:
    """(n,) mass that has left a silo through its hole, kg.

    Args:
        run: Of a `silo`.
    """
    below = run.positions[..., 1] < 0.0
    result: Array = below @ run.mass
    return result


@checked(run="GrainRun")
def slopes(run: GrainRun) -> Array:
    """(n,) slope of the surface in a drum, rad, positive where it rises along x; nan where too few balls lie.

    Args:
        run: Of a `drum`.
    """
    if run.vessel is None or run.vessel["kind"] != "drum":
        refuse(OptionError, "run", run.title, "is not one of a drum")
    inner = INNER * run.vessel["radius"]
    result = np.full(run.n_frames, np.nan)
    for k, places in enumerate(run.positions):
        surface = surface_map(places, run.radius)
        heights = surface.heights
        x = np.broadcast_to(surface.x - run.vessel["centre"][0], heights.shape)
        used = np.isfinite(heights) & (np.abs(x) < inner)
        if used.sum() > 2 and np.ptp(x[used]) > 0.5 * inner:
            result[k] = np.arctan(np.polyfit(x[used], heights[used], 1)[0])
    return result


def _rows_in_drum(wall: float, length: float, largest: float) -> Array:
    """(n, 3) centres of balls of one radius in straight rows that fit into a drum about the origin, lowest first."""
    pitch = 2.0 * largest * (1.0 + 1e-6)
    half = wall - largest
    if half <= 0.0 or length < pitch:
        return np.empty((0, 3))
    steps = pitch * np.arange(-np.floor(half / pitch), half / pitch)
    along = pitch * np.arange(np.floor(length / pitch))
    y, x, z = np.meshgrid(steps, steps, along - along.mean(), indexing="ij")
    places = np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1)
    inside: Array = places[np.hypot(places[:, 0], places[:, 1]) <= half]
    return inside


def _filled(
    count: int, tube: float, radius: float, vessel: Silo, seed: int, options: dict[str, Any], walls: Any = None
) -> GrainSimulation:
    """Balls that settled in a tube about the origin."""
    count, radius = _checked(count, radius)
    tube, largest = number("tube", tube, above=0.0), (1.0 + SPREAD) * radius
    if tube < 4.0 * largest:
        refuse(OptionError, "tube", tube, f"is narrower than four of the largest balls, {8.0 * largest:g} m")
    side = np.sqrt(2.0) * tube
    radii, mass, position = _packed(count, radius, side, side, seed)
    sim = GrainSimulation(radii, mass, position, vessel=vessel, walls=walls, **options)
    settle(sim)
    return sim


def _checked(count: int, radius: float) -> tuple[int, float]:
    count = whole("count", count, at_least=1, at_most=MOST_BALLS, error=OptionError)
    check_memory("count", count)
    return count, number("radius", radius, above=0.0)


def _packed(count: int, radius: float, width: float, depth: float, seed: int) -> tuple[Array, Array, Array]:
    """A loose packing about the y axis."""
    return ball_packing(
        count,
        radius_min=(1.0 - SPREAD) * radius,
        radius_max=(1.0 + SPREAD) * radius,
        mass=4.0 / 3.0 * np.pi * DENSITY * radius**3,
        width=width,
        depth=depth,
        left=-0.5 * width,
        back=-0.5 * depth,
        seed=seed,
    )
