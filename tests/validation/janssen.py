"""A silo whose bottom bears less than the filling weighs: the walls bear the rest."""

from __future__ import annotations

import numpy as np

from validation.samples import DIAMETER, glued_row, loose, settle, sides
from validation.watch import GRAVITY, Ledger

FRICTION = 0.5
WALL_FRICTION = 0.5
#: Width of the silo in diameters, and heights of the filling in widths.
WIDTH = 12.0
HEIGHTS = (0.5, 1.0, 1.5, 2.5, 4.0, 6.0)
#: The bottom is lowered at this speed (diameters a second), so that the walls' friction is all turned upward, this far.
SPEED = 2.0
TRAVEL = 1.0


def weigh(
    height: float, seed: int, ledger: Ledger, *, wall_friction: float = WALL_FRICTION, diameters: float = WIDTH
) -> dict[str, float]:
    """Fills a silo, so many diameters wide, to a height (in widths) and weighs it at its bottom.

    Returns:
        Mass of the filling and mass that the bottom bears, both in units of a filling that is as high as wide and packs
        at 0.82; the bottom's is a mean over the second half of its way, with the standard error of ten blocks.
    """
    width = diameters * DIAMETER
    count = round(height * 0.82 * diameters**2 * 4.0 / np.pi)
    bottom = glued_row(-DIAMETER, width + DIAMETER, 500 + seed)
    sample = loose(count, width, seed, bottom=1.3 * DIAMETER) + bottom
    watched = sample.watched(walls=sides(0.0, width), friction=FRICTION, wall_friction=wall_friction)
    settle(watched)
    ledger.merge(watched.ledger)
    settled = sample.after(watched.sim)
    settled.velocity[settled.kinematic] = [0.0, -SPEED * DIAMETER, 0.0]
    lowered = settled.watched(walls=sides(0.0, width), friction=FRICTION, wall_friction=wall_friction, has_energy=False)
    steps = round(TRAVEL / SPEED / lowered.sim.time_step)
    forces = np.empty(steps)
    for k in range(steps):
        lowered.step()
        forces[k] = lowered.from_kinematic[1] / lowered.sim.time_step
    ledger.merge(lowered.ledger)
    free = ~settled.kinematic
    areal = settled.mass[free].sum() / (np.pi * (settled.radius[free] ** 2).sum())
    unit = areal * 0.82 * width**2
    kept = forces[steps // 2 :] / GRAVITY / unit
    blocks = [block.mean() for block in np.array_split(kept, 10)]
    return {
        "height": height,
        "seed": seed,
        "filling": float(settled.mass[free].sum() / unit),
        "borne": float(kept.mean()),
        "error": float(np.std(blocks, ddof=1) / np.sqrt(len(blocks))),
    }


def saturation(filling: np.ndarray, borne: np.ndarray) -> tuple[float, float]:
    """The mass m that Janssen's law `borne = m (1 - exp(-filling / m))` fits best with, and the fit's R^2."""
    candidates = np.geomspace(0.05, 20.0, 4000)
    laws = candidates[:, None] * -np.expm1(-filling / candidates[:, None])
    squares = ((laws - borne) ** 2).sum(axis=1)
    best = int(squares.argmin())
    return float(candidates[best]), float(1.0 - squares[best] / ((borne - borne.mean()) ** 2).sum())


def measure(ledger: Ledger) -> dict[str, object]:
    """Fillings of several heights between rough walls, and one between smooth walls."""
    runs = [weigh(height, seed, ledger) for seed in range(4) for height in HEIGHTS]
    smooth = [weigh(height, 0, ledger, wall_friction=0.0) for height in (1.0, 3.0)]
    mass, determination = saturation(np.array([r["filling"] for r in runs]), np.array([r["borne"] for r in runs]))
    return {"runs": runs, "smooth": smooth, "saturation": mass, "determination": determination}
