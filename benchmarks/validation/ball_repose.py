"""Angle of repose of balls: the slope that remains after one wall of a bed on a rough floor is removed."""

import sys
from typing import Any

import numpy as np
from rich.console import Console

from rover_gym.ground.grains import surface_map
from validation.balls import DIAMETER, Array, Balls, free, glued, loose, settle
from validation.repose import row_of
from validation.watch import Ledger, means_by, run_off

FRICTIONS = (0.1, 0.2, 0.3, 0.5, 0.8)
SEEDS = range(4)
COUNT = 1100
#: Length of the floor and distance of the smooth sides, diameters.
LENGTH, WIDTH = 22.0, 6.0
TIME_STEP = 2e-3  # s


def floor(length: float, width: float, seed: int) -> Balls:
    """A rectangular rough floor."""
    pitch = 1.05 * DIAMETER
    x, z = np.meshgrid(np.arange(0.0, length, pitch), np.arange(0.0, width + 0.5 * pitch, pitch))
    return glued(x.ravel(), z.ravel(), seed)


def profile(position: Array, radius: Array, length: float) -> tuple[Array, Array]:
    """Places along a heap, a diameter apart, and the mean height of its surface across it, m."""
    columns = np.arange(0.5 * DIAMETER, length, DIAMETER)
    surface = surface_map(position, radius)
    known = np.isfinite(surface.heights).mean(axis=0) > 0.5
    heights = np.nanmean(surface.heights[:, known], axis=0)
    return columns, np.interp(columns, surface.x[known], heights, right=0.0)


def slope(
    count: int,
    friction: float,
    seed: int,
    ledger: Ledger,
    *,
    length: float = LENGTH,
    width: float = WIDTH,
    rolling: float = 0.0,
) -> dict[str, Any]:
    """Angle of repose of one bed, `length` and `width` in diameters; `rolling`: coefficient of rolling friction.

    Returns:
        angle: Degrees. stays: Share of the balls that stay. seconds: Until the slope rests. surface: Places and
        heights, diameters. friction, seed.
    """
    long, wide = length * DIAMETER, width * DIAMETER
    sample = loose(count, long, seed, depth=wide)
    sides = [[0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, wide, 0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]
    options: dict[str, Any] = {
        "friction": friction,
        "wall_friction": 0.0,
        "rolling_friction": rolling,
        "time_step": TIME_STEP,
        "tolerance": 5e-4,
    }
    watched = (sample + floor(long, wide, 200 + seed)).watched(
        walls=[*sides, [long, 0.0, 0.0, -1.0, 0.0, 0.0]], **options | {"time_step": 1e-3, "tolerance": 3e-4}
    )
    settle(watched)
    ledger.merge(watched.ledger)
    sim = watched.sim
    kept = ~sim.kinematic
    watched = (free(sim.radius[kept], sim.position[kept]) + floor(long, wide, 200 + seed)).watched(
        walls=sides, **options
    )
    run_off(watched, looks=4, most=6.0)
    ledger.merge(watched.ledger)
    sim = watched.sim
    kept = ~sim.kinematic
    row = row_of(watched, count, *profile(sim.position[kept], sim.radius[kept], long))
    return {"friction": friction, "seed": seed, **row}


def measure(ledger: Ledger) -> dict[str, object]:
    """Slopes of several frictions, and two of a bed half as long and high again."""
    runs = [slope(COUNT, mu, seed, ledger) for mu in FRICTIONS for seed in SEEDS]
    larger = [slope(round(2.25 * COUNT), 0.5, seed, ledger, length=1.5 * LENGTH) for seed in (0, 1)]
    return {"runs": runs, "means": means(runs), "larger": larger}


def means(runs: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Mean angle and share that stays for each friction, with their standard errors."""
    return means_by(runs, "friction", FRICTIONS, {"angle": "error", "stays": "stays_error"})


def with_rolling_friction(count: int, coefficients: list[float], seeds: int) -> None:
    """Prints the angle of repose for each coefficient of rolling friction, at a friction of 0.5."""
    for rolling in coefficients:
        ledger = Ledger()
        angles = [slope(count, 0.5, seed, ledger, rolling=rolling)["angle"] for seed in range(seeds)]
        spread = np.std(angles, ddof=1) / np.sqrt(seeds) if seeds > 1 else np.nan
        solved = 100.0 - 100.0 * ledger.unconverged / ledger.steps
        line = f"{rolling:.2f}  {np.mean(angles):.1f} +- {spread:.1f} degrees, {solved:.1f}% of the steps solved"
        Console().print(line, highlight=False)


if __name__ == "__main__":
    with_rolling_friction(COUNT, [float(x) for x in sys.argv[1:]], len(SEEDS))
