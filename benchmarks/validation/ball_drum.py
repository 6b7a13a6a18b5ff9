"""Slope of balls in a slowly turning drum, against friction.

Sources: Peyneau and Roux 2008 (internal friction of spheres without friction); Chialvo et al. 2012 (yield
stress ratio of spheres that roll freely, against friction); Jop et al. 2006 (glass beads that flow
steadily down a heap).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_gym.core import Drum
from rover_gym.ground.grains import drum, surface_map
from validation.balls import DENSITY, DIAMETER, RADIUS, Array, Balls, free
from validation.watch import Ledger, Watched

FRICTIONS = (0.0, 0.1, 0.2, 0.3, 0.5, 0.8)
SEEDS = (0, 1)
COUNT = 760  # half fill the drum
WALL, LENGTH = 9.0 * DIAMETER, 6.0 * DIAMETER
#: Radii, in diameters, of drums with friction 0.5 beside those of `WALL`, and their seeds.
SIZES = ((6.0, 0), (6.0, 1), (12.0, 0), (12.0, 1), (16.0, 0))
#: rad/s; the Froude number is WALL rate²/g = 2e-4.
RATE = 0.15
#: Degrees of slow shear, by friction: Peyneau and Roux 2008 without, yield stress ratios of Chialvo et al. 2012 with.
YIELD = {0.0: 5.76, **{mu: float(np.degrees(np.arctan(y))) for mu, y in ((0.1, 0.268), (0.3, 0.357), (0.5, 0.382))}}
#: Degrees between which glass beads flow steadily, Jop et al. 2006.
GLASS = (20.9, 32.76)
#: Rates at which two frictions are measured too.
RATES = (0.075, 0.3, 0.6)
TIME_STEP = 2e-3  # s
#: Slope that the surface begins with, degrees, and angle that the drum turns before slopes count, rad.
TILT, START = 18.0, 0.35
#: Angle that it turns while they do, rad.
TURN = 0.75
#: s between slopes.
EVERY = 0.1
BLOCKS = 4
#: Share of the drum's radius about its axis in which the slope is measured.
INNER = 0.6


@dataclass(frozen=True)
class Ring:
    """A rough wall: balls on a circle, some further out than others.

    Attributes:
        away: (n,) distances of the balls from the axis, m.
        angle: (n,) at the beginning, rad.
        along: (n,) places along the axis, m.
    """

    away: Array
    angle: Array
    along: Array

    @staticmethod
    def around(wall: float, length: float, seed: int) -> Ring:
        """A ring that no free ball inside a radius touches."""
        pitch = 1.05 * DIAMETER
        n_around, n_along = int(2.0 * np.pi * wall / pitch), int(length / pitch) + 1
        angle, along = np.meshgrid(
            np.arange(n_around) * 2.0 * np.pi / n_around, pitch * (np.arange(n_along) - 0.5 * (n_along - 1))
        )
        beyond = np.random.default_rng(seed).uniform(1.0, 1.3, angle.size)
        return Ring(wall + RADIUS * beyond, angle.ravel(), along.ravel())

    def places(self, turned: float) -> Array:
        """(n, 3) centres after it turned by an angle, m."""
        angle = self.angle + turned
        return np.stack((self.away * np.cos(angle), self.away * np.sin(angle), self.along), axis=1)

    def balls(self) -> Balls:
        """The ring as kinematic balls."""
        n = len(self.away)
        return Balls(np.full(n, RADIUS), self.places(0.0), np.ones(n, dtype=bool))


def turned(position: Array, angle: float) -> Array:
    """Places turned about the z axis, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return position @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def steepness(position: Array, radius: Array, inner: float) -> float:
    """Degrees of a line through the surface within a distance from the axis, positive where it rises along x."""
    surface = surface_map(position, radius)
    x = np.broadcast_to(surface.x, surface.heights.shape)
    used = np.isfinite(surface.heights) & (np.abs(x) < inner)
    return float(np.degrees(np.arctan(np.polyfit(x[used], surface.heights[used], 1)[0])))


def slope(
    count: int,
    friction: float,
    seed: int,
    ledger: Ledger,
    *,
    wall: float = WALL,
    rate: float = RATE,
    start: float = START,
    turn: float = TURN,
    rough: bool = True,
    time_step: float = TIME_STEP,
) -> dict[str, Any]:
    """Turns a drum.

    Args:
        count: Balls.
        friction: Among balls and, unless the wall is rough, with the wall and the ends.
        seed: Of balls and wall.
        ledger: What the steps are entered into.
        wall: Inner radius of the drum, m.
        rate: rad/s.
        start: Angle that it turns before slopes count, rad.
        turn: Angle that it turns while they do, rad.
        rough: Whether the wall is a ring of glued balls between smooth ends, or the smooth wall of a `Drum`.
        time_step: s.

    Returns:
        angle: Mean slope, degrees. blocks: Means of consecutive quarters. spread: Standard deviation of the slope.
        grip: Angular momentum of the balls over that of a rigid rotation with the drum, mean. surface: Places and mean
        heights, diameters.
    """
    filled = drum(count, wall, LENGTH, 0.0, RADIUS, seed=seed, friction=friction, wall_friction=0.0, time_step=1e-3)
    balls = free(filled.radius, turned(filled.position, np.radians(TILT if friction > 0.0 or rough else 0.0)))
    options: dict[str, Any] = {"friction": friction, "time_step": time_step, "tolerance": 1e-3, "has_energy": False}
    ring = Ring.around(wall, LENGTH, 100 + seed)
    if rough:
        ends = [[0.0, 0.0, -0.5 * LENGTH, 0.0, 0.0, 1.0], [0.0, 0.0, 0.5 * LENGTH, 0.0, 0.0, -1.0]]
        watched = (balls + ring.balls()).watched(
            walls=ends, wall_friction=0.0, stabilisation="projection", density=DENSITY, **options
        )
    else:
        watched = balls.watched(vessel=Drum(wall, LENGTH, rate), **options)
    sim = watched.sim
    per_sample = round(EVERY / time_step)
    slopes, grips, profiles = [], [], []
    columns = np.arange(-wall, wall + 1e-9, DIAMETER)
    for k in range(round((start + turn) / rate / EVERY)):
        _turn(watched, ring if rough else None, k * EVERY, rate, per_sample)
        if k * EVERY * rate < start:
            continue
        position, radius, velocity = sim.position[:count], sim.radius[:count], sim.velocity[:count]
        slopes.append(steepness(position, radius, INNER * wall))
        spin = position[:, 0] * velocity[:, 1] - position[:, 1] * velocity[:, 0]
        grips.append(float(spin.mean() / (position[:, :2] ** 2).sum(axis=1).mean() / rate))
        surface = surface_map(position, radius)
        heights = np.nanmean(surface.heights, axis=0)
        profiles.append(np.interp(columns, surface.x, heights, left=np.nan, right=np.nan))
    ledger.merge(watched.ledger)
    mean = np.mean(profiles, axis=0)
    known = np.isfinite(mean)
    return {
        "friction": friction,
        "seed": seed,
        "rate": rate,
        "rough": rough,
        "wall": wall / DIAMETER,
        "angle": float(np.mean(slopes)),
        "blocks": [float(block.mean()) for block in np.array_split(np.array(slopes), BLOCKS)],
        "spread": float(np.std(slopes)),
        "grip": float(np.mean(grips)),
        "surface": [
            (columns[known] / DIAMETER).round(3).tolist(),
            (mean[known] / DIAMETER).round(3).tolist(),
        ],
    }


def _turn(watched: Watched, ring: Ring | None, time: float, rate: float, steps: int) -> None:
    """Takes steps; the balls of a ring, which move along tangents, are put back on their circles every five."""
    if ring is None:
        watched.step(steps)
        return
    sim = watched.sim
    n = len(ring.away)
    for k in range(0, steps, 5):
        position, velocity, spin = sim.position, sim.velocity, sim.spin
        position[-n:] = ring.places(rate * (time + k * sim.time_step))
        velocity[-n:] = rate * np.stack((-position[-n:, 1], position[-n:, 0], np.zeros(n)), axis=1)
        spin[-n:] = [0.0, 0.0, rate]
        sim.set_state(position, velocity, spin)
        watched.restart()
        watched.step(5)


def measure(ledger: Ledger) -> dict[str, object]:
    """Drums of several frictions, two of them at other rates, one in other sizes and with a finer step, smooth ones."""
    runs = [slope(COUNT, mu, seed, ledger) for mu in FRICTIONS for seed in SEEDS]
    rates = [slope(COUNT, mu, 0, ledger, rate=rate) for mu in (0.0, 0.5) for rate in RATES]
    sizes = [sized(wide, seed, ledger) for wide, seed in SIZES]
    finer = slope(COUNT, 0.5, 0, ledger, time_step=0.5 * TIME_STEP)
    smooth = [slope(COUNT, 0.0, seed, ledger, rough=False) for seed in SEEDS]
    near = sizes + [run for run in runs if run["friction"] == 0.5]
    return {
        "runs": runs,
        "means": means(runs),
        "rates": rates,
        "sizes": sizes,
        "limit": limit(near),
        "finer": finer,
        "smooth": smooth,
    }


def sized(wide: float, seed: int, ledger: Ledger) -> dict[str, Any]:
    """A drum with a radius of so many diameters, half full, friction 0.5."""
    wall = wide * DIAMETER
    return slope(round(COUNT * (wall / WALL) ** 2), 0.5, seed, ledger, wall=wall)


def limit(runs: list[dict[str, Any]]) -> dict[str, float]:
    """Slope where balls are ever smaller than the drum: a straight line in diameter over radius.

    Its error is that of runs whose slopes are as uncertain as their quarters say, all alike.
    """
    inverse = np.array([1.0 / run["wall"] for run in runs])
    (rise, value), covariance = np.polyfit(inverse, [run["angle"] for run in runs], 1, cov="unscaled")
    variance = float(np.mean([np.var(run["blocks"], ddof=1) / BLOCKS for run in runs]))
    return {"value": float(value), "error": float(np.sqrt(variance * covariance[1, 1])), "rise": float(rise)}


def means(runs: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Mean slope for each friction, with the standard error over the quarters of all its runs."""
    rows = []
    for mu in FRICTIONS:
        blocks = np.concatenate([run["blocks"] for run in runs if run["friction"] == mu])
        error = float(blocks.std(ddof=1) / np.sqrt(len(blocks)))
        rows.append({"friction": mu, "angle": float(blocks.mean()), "error": error})
    return rows
