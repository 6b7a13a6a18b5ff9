"""What a recording of balls says about a scene: how deep a sphere sank, how far a column spread."""

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import checked, refuse
from rover_gym.ground.grains.grain_surface import surface_map
from rover_gym.record.grain_run import GrainRun

#: Share of a column's balls below its height, and share of the floor that balls cover at the edge of its deposit.
HIGHEST, COVERED = 0.98, 0.5

#: Share of a drum's radius about its axis in which the slope is measured, away from the wall.
INNER = 0.6

Array = npt.NDArray[np.float64]


@checked(run="GrainRun")
def penetration_depths(run: GrainRun) -> Array:
    """(n,) depth of the lowest point of the last ball below the surface that it struck, m.

    Args:
        run: Of a `striking_sphere`.
    """
    lowest = run.positions[:, -1, 1].astype(np.float64) - run.radius[-1]
    depths: Array = lowest[0] - lowest
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


@checked(run="GrainRun")
def outflow(run: GrainRun) -> Array:
    """(n,) mass that has left a silo through its hole, kg.

    Args:
        run: Of a `silo`.
    """
    below = run.positions[..., 1] < 0.0
    return below @ run.mass


@checked(run="GrainRun")
def slopes(run: GrainRun) -> Array:
    """(n,) slope of the surface in a drum, rad, positive where it rises along x; nan where too few balls lie.

    Args:
        run: Of a `drum`.
    """
    if run.vessel is None or run.vessel["kind"] != "drum":
        refuse(OptionError, "run", run.title, "is not a run of a drum")
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
