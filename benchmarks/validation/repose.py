"""Angle of repose: the slope that remains after one wall of a bed on a rough floor is removed and disks run off."""

import itertools

import numpy as np

from validation.pool import Run, side_by_side
from validation.samples import DIAMETER, Array, box, glued_row, loose, settle
from validation.watch import Ledger, Watched, means_by, run_off

FRICTIONS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7)
LENGTH, COUNT = 60.0, 900
SEEDS = range(9)
#: Shares of a heap's height between which its flank is taken: above it is flat, below it thins out.
HIGH, LOW = 0.8, 0.2


def surface(position: Array, radius: Array, left: float, right: float) -> tuple[Array, Array]:
    """Places along a heap, two diameters apart, and the height of the highest disk near each, m."""
    edges = np.arange(left, right + 1e-9, 2.0 * DIAMETER)
    x, top = position[:, 0], position[:, 1] + radius
    places, heights = [], []
    for a, b in itertools.pairwise(edges):
        near = (x >= a) & (x < b)
        if near.any():
            k = np.flatnonzero(near)[top[near].argmax()]
            places.append(x[k])
            heights.append(top[k])
    return np.array(places), np.array(heights)


def angle(x: Array, y: Array) -> float:
    """Degrees of a heap's flank: a line through its surface, x onwards, between HIGH and LOW of its height."""
    top = float(y.max())
    flank = (np.arange(len(x)) >= np.flatnonzero(y > HIGH * top)[-1]) & (y > LOW * top)
    return float(np.degrees(np.arctan(-np.polyfit(x[flank], y[flank], 1)[0])))


def row_of(watched: Watched, count: int, x: Array, y: Array) -> Run:
    """Angle, share of so many grains that stays, time, s, and surface (x, y) of a slope that rests."""
    return {
        "angle": angle(x, y),
        "stays": float((~watched.sim.kinematic).sum() / count),
        "seconds": float(watched.sim.time),
        "surface": [(along / watched.diameter).round(3).tolist() for along in (x, y)],
    }


def slope(count: int, friction: float, seed: int, ledger: Ledger, *, length: float = LENGTH) -> Run:
    """Angle of repose of one bed.

    Args:
        count: Disks.
        friction: Between all.
        seed: Of disks and floor.
        ledger: What the steps are entered into.
        length: Of the floor, diameters.

    Returns:
        angle: Degrees. stays: Share of the bed's disks that stay. seconds: Until the slope rests. surface: Places and
        heights, diameters.
    """
    width = length * DIAMETER
    floor = glued_row(0.0, width, 1000 + seed)
    edge = float((floor.position[:, 0] + floor.radius).max())
    sample = loose(count, edge, seed, bottom=1.3 * DIAMETER) + floor
    watched = sample.watched(walls=box(0.0, edge, -DIAMETER), friction=friction, wall_friction=0.0)
    settle(watched)
    ledger.merge(watched.ledger)
    watched = sample.after(watched.sim).watched(walls=[[0.0, 0.0, 1.0, 0.0]], friction=friction, wall_friction=0.0)
    run_off(watched, looks=6, most=8.0)
    ledger.merge(watched.ledger)
    sim = watched.sim
    free = ~sim.kinematic
    row = row_of(watched, count, *surface(sim.position[free], sim.radius[free], 0.0, edge))
    return {"friction": friction, "seed": seed, **row}


def measure(ledger: Ledger) -> dict[str, object]:
    """Slopes of several frictions."""
    options = ({"count": COUNT, "friction": mu, "seed": seed} for mu in FRICTIONS for seed in SEEDS)
    runs = side_by_side(slope, options, ledger)
    return {"runs": runs, "means": means(runs)}


def means(runs: list[Run]) -> list[dict[str, float]]:
    """Mean angle and share that stays for each friction, with their standard errors, and the range of the angles."""
    rows = means_by(runs, "friction", FRICTIONS, {"angle": "error", "stays": "stays_error"})
    for row in rows:
        row["spread"] = float(np.ptp([run["angle"] for run in runs if run["friction"] == row["friction"]]))
    return rows
