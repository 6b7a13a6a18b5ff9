"""What a recording of balls says about a scene: how deep a sphere sank, how far a column spread."""

from typing import Any

import numpy as np

from rover_gym.core.validation import checked
from rover_gym.ground.grains.grain_surface import surface_map
from rover_gym.record.grain_run import GrainRun

#: Share of a column's balls below its height, and share of the floor that balls cover at the edge of its deposit.
HIGHEST, COVERED = 0.98, 0.5


@checked(run="GrainRun")
def penetration_depths(run: GrainRun) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(n,) depth of the lowest point of the last ball below the surface that it struck, m.

    Args:
        run: Of a `striking_sphere`.
    """
    lowest = run.positions[:, -1, 1].astype(np.float64) - run.radius[-1]
    depths: np.ndarray[Any, np.dtype[np.float64]] = lowest[0] - lowest
    return depths


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
