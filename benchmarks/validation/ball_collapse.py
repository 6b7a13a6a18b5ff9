"""Run-out of collapsing columns of balls.

Source: Lube et al. 2004, *Axisymmetric collapses of granular columns*, J. Fluid Mech. 508,
175-199: (R - R0)/R0 = 1.24 a below a = 1.7 and 1.6 a^(1/2) above, a = H0/R0.
"""

from typing import Any

import numpy as np

from rover_gym.core import Silo
from validation.balls import DIAMETER, Balls, free, glued_disc, loose, settle
from validation.watch import GRAVITY, Ledger, line

FRICTION = 0.5
#: Packing fraction that turns a number of balls into a radius of the column.
FRACTION = 0.57
ASPECTS = (0.5, 1.0, 2.0, 4.0)
#: In units of sqrt(2 H0 / g): longer than the flow lasts.
FALLS = 4.0


def column(count: int, aspect: float, seed: int, ledger: Ledger) -> tuple[Balls, float, float]:
    """Balls at rest in a tube: they, its radius and their height, m."""
    # count pi d^3/6 = FRACTION pi R0^2 a R0
    inner = DIAMETER * (count / (6.0 * FRACTION * aspect)) ** (1.0 / 3.0)
    square = np.sqrt(2.0) * (inner - DIAMETER) + DIAMETER
    sample = loose(count, square, seed, left=-0.5 * square)
    watched = sample.watched(
        vessel=Silo(inner, floor=0.0), stabilisation="projection", friction=FRICTION, wall_friction=0.0
    )
    settle(watched, most=1.2)
    ledger.merge(watched.ledger)
    position, radius = watched.sim.position, watched.sim.radius
    height = float(np.quantile(position[:, 1] + radius, 0.97))
    return free(radius, position), inner, height


def run_out(count: int, aspect: float, seed: int, ledger: Ledger) -> dict[str, Any]:
    """Takes the tube away.

    Returns:
        run_out: (R - R0)/R0, R of the `front`; aspect: as it was; top: final height over R0; grains: R0 in diameters.
    """
    balls, inner, height = column(count, aspect, seed, ledger)
    reach = inner * (1.0 + 2.2 * max(aspect, 1.0))
    watched = (balls + glued_disc(reach, 100 + seed)).watched(friction=FRICTION, stabilisation="projection")
    sim = watched.sim
    fall = float(np.sqrt(2.0 * height / GRAVITY))
    watched.step(round(FALLS * fall / sim.time_step))
    ledger.merge(watched.ledger)
    position = sim.position[~sim.kinematic]
    far = front(np.hypot(position[:, 0], position[:, 2]))
    return {
        "count": count,
        "seed": seed,
        "aspect": height / inner,
        "run_out": (far - inner) / inner,
        "top": float(np.quantile(position[:, 1], 0.99)) / inner,
        "grains": inner / DIAMETER,
    }


def front(away: np.ndarray, cover: float = 0.3) -> float:
    """Outer radius of the last ring, a diameter wide, of which balls at distances `away` cover a share `cover`, m."""
    counts = np.bincount((away / DIAMETER).astype(int))
    area = np.pi * (2 * np.arange(len(counts)) + 1) * DIAMETER**2
    covered = counts * np.pi * (0.5 * DIAMETER) ** 2 >= cover * area
    return float((np.flatnonzero(covered).max() + 1) * DIAMETER)


def lube(aspect: float) -> float:
    """The paper's law."""
    return float(1.24 * aspect if aspect < 1.7 else 1.6 * np.sqrt(aspect))


def measure(ledger: Ledger) -> dict[str, object]:
    """Columns of several aspect ratios, and one aspect ratio with ever more balls."""
    runs = [run_out(700, aspect, seed, ledger) for aspect in ASPECTS for seed in (0, 1)]
    sizes = [run_out(count, 1.0, seed, ledger) for count, seed in ((250, 0), (250, 1), (1500, 0))]
    return {"runs": runs, "sizes": sizes, "limit": limit(sizes + [r for r in runs if 0.8 < r["aspect"] < 1.4])}


def limit(runs: list[dict[str, Any]]) -> dict[str, float]:
    """Run-out over the paper's law where balls are ever smaller: a straight line in d/R0."""
    inverse = np.array([1.0 / run["grains"] for run in runs])
    ratio = np.array([run["run_out"] / lube(run["aspect"]) for run in runs])
    return line(inverse, ratio)
