"""Angle of repose of balls: the slope that remains after one wall of a bed on a rough floor is removed."""

import sys
from typing import Any

import numpy as np
from rich.console import Console

from rover_gym.ground.grains import surface_map
from validation.balls import DIAMETER, RADIUS, Array, Balls, free, loose, settle, slow
from validation.repose import angle
from validation.watch import Ledger, means_by

FRICTIONS = (0.1, 0.2, 0.3, 0.5, 0.8)
SEEDS = range(4)
COUNT = 1100
#: Length of the floor and distance of the smooth sides, diameters.
LENGTH, WIDTH = 22.0, 6.0
TIME_STEP = 2e-3  # s


def floor(length: float, width: float, seed: int) -> Balls:
    """Kinematic balls at random heights in a square array, their tops at height 0 or less."""
    pitch = 1.05 * DIAMETER
    x, z = np.meshgrid(np.arange(0.0, length, pitch), np.arange(0.0, width + 0.5 * pitch, pitch))
    y = -RADIUS * np.random.default_rng(seed).uniform(1.0, 1.3, x.size)
    return Balls(np.full(x.size, RADIUS), np.stack((x.ravel(), y, z.ravel()), axis=1), np.ones(x.size, dtype=bool))


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
    sim = watched.sim
    quiet = 0
    while sim.time < 6.0 and quiet < 4:
        watched.step(round(0.05 / TIME_STEP))
        fallen = sim.position[:, 1] < -2.0 * DIAMETER
        watched.remove(fallen)
        quiet = quiet + 1 if slow(watched) and not fallen.any() else 0
    ledger.merge(watched.ledger)
    kept = ~sim.kinematic
    x, y = profile(sim.position[kept], sim.radius[kept], long)
    return {
        "friction": friction,
        "seed": seed,
        "angle": angle(x, y),
        "stays": float(kept.sum() / count),
        "seconds": float(sim.time),
        "surface": [(x / DIAMETER).round(3).tolist(), (y / DIAMETER).round(3).tolist()],
    }


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
