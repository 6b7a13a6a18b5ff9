"""Scenes of balls in vessels: a column that is set free, a silo that empties, a drum that turns."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.grains.ball_bed import DENSITY, MOST_BALLS, settle
from rover_gym.grains.grain_run import GrainRun
from rover_gym.grains.grain_surface import surface_map
from rover_gym.mechanics import Drum, GrainSimulation, OptionError, Silo, ball_packing
from rover_gym.validation import number, refuse, whole

Array = npt.NDArray[np.float64]

FLOOR = ((0.0, 0.0, 0.0, 0.0, 1.0, 0.0),)
SPREAD = 0.1  # radii of balls are drawn within this share of their mean
#: Share of the balls that the deposit of a column holds; the others rolled away from it.
DEPOSIT = 0.98
#: Share of a drum's radius about its axis in which the slope is measured, away from the wall.
INNER = 0.6


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
    largest = (1.0 + SPREAD) * radius
    # A box in the drum, as wide as 1.5 radii and as high as what remains.
    width, depth = 1.5 * wall - 2.0 * largest, length
    if width < 4.0 * largest or depth < 2.0 * largest:
        refuse(OptionError, "radius", radius, "balls are too large for the drum")
    bottom = -np.sqrt(wall**2 - 0.5625 * wall**2) + largest
    packing = _packed(count, radius, width, depth, seed, bottom=bottom)
    tops = packing[2][:, 1] + packing[0]
    if float(tops.max()) > np.sqrt(wall**2 - 0.5625 * wall**2):
        refuse(OptionError, "count", count, "balls do not fit into the drum")
    filled = GrainSimulation(*packing, vessel=Drum(wall, length), **options)
    settle(filled)
    turning = Drum(wall, length, rate)
    return GrainSimulation(filled.radius, filled.mass, filled.position, vessel=turning, **options)


def run_out(run: GrainRun, tube: float) -> tuple[float, float]:
    """Aspect ratio of a column at the first sample, and how far it spread by the last, in its first radii.

    Args:
        run: Of a `column`.
        tube: Its first radius, m.
    """
    first, last = (run.positions_of(run.rows[[k]])[0].astype(np.float64) for k in (0, -1))
    height = float(np.quantile(first[:, 1] + run.radius, DEPOSIT))
    reach = float(np.quantile(np.hypot(last[:, 0], last[:, 2]), DEPOSIT)) + float(run.radius.mean())
    return height / tube, reach / tube - 1.0


def outflow(run: GrainRun) -> Array:
    """(n,) mass that has left a silo through its hole, kg.

    Args:
        run: Of a `silo`.
    """
    below = run.positions[..., 1] < 0.0
    result: Array = below @ run.mass
    return result


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
    return count, number("radius", radius, above=0.0)


def _packed(
    count: int, radius: float, width: float, depth: float, seed: int, bottom: float = 0.0
) -> tuple[Array, Array, Array]:
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
        bottom=bottom,
        seed=seed,
    )
