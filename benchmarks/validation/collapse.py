"""Runout of collapsing columns of disks.

Source: Staron and Hinch 2005, *Study of the collapse of granular columns using two-dimensional discrete-grain
simulation*, J. Fluid Mech. 545, 1-27.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from validation.pool import side_by_side
from validation.samples import DIAMETER, RADIUS, Array, Sample, box, glued_row, loose, settle
from validation.watch import GRAVITY, Ledger, line

FRICTION = 1.0
#: Paper's power laws of (R - R0)/R0 in the aspect ratio: prefactor, exponent; the first below ASPECT, the second above.
PAPER = ((2.5, 1.0), (3.25, 0.7))
ASPECT = 2.0
#: Observation time of a column, in free-fall times of its height.
FALLS = 4.0
#: Disks of a column: as many for each aspect ratio, so that its area is a given number of disks.
COUNT = 4000
#: Of the contact solver: ten times the default, which takes a sixth of the time; `tolerances` has both.
TOLERANCE = 1e-3
#: Where tall columns strike the floor that tolerance leaves overlaps of 3% of a radius, so they are projected away.
STABILISATION = "projection"
ASPECTS = (0.5, 0.8, 1.25, 2.0, 3.2, 5.0, 8.0)


def column(
    count: int, aspect: float, seed: int, ledger: Ledger, *, tolerance: float = TOLERANCE
) -> tuple[Sample, float, float]:
    """Disks settled between two smooth walls, and the column's half width and height, m.

    The half width is chosen for the aspect ratio (height to half width) at a packing fraction of 0.8; the height is
    measured: twice that of the mass centre.
    """
    half = RADIUS * np.sqrt(count * np.pi / (2.0 * 0.8 * aspect))
    sample = loose(count, 2.0 * half, seed, left=-half)
    watched = sample.watched(
        walls=box(-half, half), friction=FRICTION, wall_friction=0.0, tolerance=tolerance, stabilisation=STABILISATION
    )
    settle(watched, speed=0.02)
    ledger.merge(watched.ledger)
    settled = sample.after(watched.sim)
    settled.velocity[:] = 0.0
    height = 2.0 * float(np.average(settled.position[:, 1], weights=settled.mass))
    return settled, float(half), height


def run_out(
    count: int,
    aspect: float,
    seed: int,
    ledger: Ledger,
    *,
    rough: bool = False,
    restitution: float = 0.0,
    tolerance: float = TOLERANCE,
) -> dict[str, Any]:
    """Lets a column go by taking both walls away.

    Args:
        count: Disks.
        aspect: Height to half width.
        seed: Of the disks.
        ledger: What the steps are entered into.
        rough: Whether the floor is a row of glued disks; a plane if not.
        restitution: Newton's.
        tolerance: Of the contact solver.

    Returns:
        aspect: Height to half width as they were. run_out: (R - R0)/R0, R from the outermost disks that hang together
        with the heap, both sides' mean; mass: the same for the 98% of the disks that stayed nearest; top: final height
        over R0.
    """
    sample, half, height = column(count, aspect, seed, ledger, tolerance=tolerance)
    fall = float(np.sqrt(2.0 * height / GRAVITY))
    if rough:
        reach = half + 3.0 * height
        sample = sample + glued_row(-reach, reach, 100 + seed, y=-1.25 * RADIUS)
    floor = None if rough else [[0.0, 0.0, 0.0, 1.0]]
    watched = sample.watched(
        walls=floor, friction=FRICTION, restitution=restitution, tolerance=tolerance, stabilisation=STABILISATION
    )
    free = ~sample.kinematic
    watched.step(round(FALLS * fall / watched.sim.time_step))
    ledger.merge(watched.ledger)
    position, radius = watched.sim.position[free], sample.radius[free]
    joined = heap(position, radius)
    x = position[joined, 0]
    spread = float(np.quantile(np.abs(position[:, 0]), 0.98))
    return {
        "count": count,
        "aspect": height / half,
        "seed": seed,
        "rough": rough,
        "restitution": restitution,
        "tolerance": tolerance,
        "run_out": (0.5 * float(x.max() - x.min()) - half) / half,
        "mass": (spread - half) / half,
        "top": float(position[joined, 1].max()) / half,
        "joined": float(joined.mean()),
        "half_width": half / DIAMETER,
    }


def heap(position: Array, radius: Array, reach: float = 0.02 * RADIUS) -> npt.NDArray[np.bool_]:
    """Which disks hang together with most others: (n,), by chains of gaps below `reach`."""
    n = len(radius)
    label = np.arange(n)
    order = np.argsort(position[:, 0])
    x, y, r = position[order, 0], position[order, 1], radius[order]
    pairs = []
    for shift in range(1, n):
        dx = x[shift:] - x[:-shift]
        if dx.min() > 2.0 * radius.max() + reach:
            break
        touching = np.hypot(dx, y[shift:] - y[:-shift]) - r[shift:] - r[:-shift] < reach
        pairs.append(np.stack([order[:-shift][touching], order[shift:][touching]], axis=1))
    edges = np.concatenate(pairs)
    while True:
        least = np.minimum(label[edges[:, 0]], label[edges[:, 1]])
        before = label.copy()
        np.minimum.at(label, edges[:, 0], least)
        np.minimum.at(label, edges[:, 1], least)
        label = label[label]
        if np.array_equal(label, before):
            break
    names, counts = np.unique(label, return_counts=True)
    return np.asarray(label == names[counts.argmax()])


def power(aspect: Array, run: Array) -> tuple[float, float, float]:
    """Prefactor and exponent of a power law fitted in logarithms, and the exponent's standard error."""
    design = np.stack([np.log(aspect), np.ones_like(aspect)], axis=1)
    solution, squares, _, _ = np.linalg.lstsq(design, np.log(run), rcond=None)
    freedom = max(1, len(run) - 2)
    variance = float(squares[0]) / freedom if len(squares) else 0.0
    error = np.sqrt(variance * np.linalg.inv(design.T @ design)[0, 0])
    return float(np.exp(solution[1])), float(solution[0]), float(error)


def measure(ledger: Ledger) -> dict[str, object]:
    """All columns, and the power laws that they follow."""

    def row(count: int, aspect: float, seed: int = 0, **others: object) -> dict[str, Any]:
        return {"count": count, "aspect": aspect, "seed": seed} | others

    parts = {
        "flat": [row(COUNT, aspect, seed) for aspect in reversed(ASPECTS) for seed in (0, 1)],
        "sizes": [row(count, ASPECT, seed) for count in (8000, 2000, 1000, 500) for seed in (0, 1)],
        "rough": [row(2000, aspect, rough=True) for aspect in ASPECTS[1::2]],
        "tolerances": [row(1000, ASPECT, seed, tolerance=1e-4) for seed in (0, 1)],
    }
    runs = iter(side_by_side(run_out, (options for part in parts.values() for options in part), ledger))
    found: dict[str, Any] = {name: [next(runs) for _ in part] for name, part in parts.items()}
    # Newton's law may add energy where there is friction: not a part of the ledger.
    own = Ledger()
    found["bouncing"] = side_by_side(run_out, (row(2000, aspect, restitution=0.5) for aspect in ASPECTS[1::2]), own)
    found["bouncing_ledger"] = own.as_dict()
    return found | {"fits": fits(found["flat"]), "limit": limit(found)}


def limit(found: dict[str, Any]) -> dict[str, Any]:
    """Run-out over aspect ratio, at a = 2, where disks are ever smaller: a straight line in 1/n, R0 being n diameters.

    Returns:
        value: At 1/n = 0. error: Its standard error. slope: By 1/n. runs: Those that it was fitted to.
    """
    runs = found["sizes"] + [run for run in found["flat"] if abs(run["aspect"] - ASPECT) < 0.1 * ASPECT]
    inverse = np.array([1.0 / run["half_width"] for run in runs])
    ratio = np.array([run["run_out"] / run["aspect"] for run in runs])
    return {**line(inverse, ratio), "runs": runs}


def fits(runs: list[dict[str, Any]], name: str = "run_out") -> list[dict[str, float]]:
    """The two power laws of some runs, below and from a = 2 on; and their prefactors with the paper's exponents."""
    aspect = np.array([r["aspect"] for r in runs], dtype=float)
    run = np.array([r[name] for r in runs], dtype=float)
    found = []
    for is_low, paper in zip((True, False), PAPER, strict=True):
        chosen = (aspect < 1.1 * ASPECT) if is_low else (aspect > 0.9 * ASPECT)
        prefactor, exponent, error = power(aspect[chosen], run[chosen])
        found.append(
            {
                "prefactor": prefactor,
                "exponent": exponent,
                "error": error,
                "with_paper_exponent": float(np.exp(np.mean(np.log(run[chosen] / aspect[chosen] ** paper[1])))),
                "paper_prefactor": paper[0],
                "paper_exponent": paper[1],
            }
        )
    return found
