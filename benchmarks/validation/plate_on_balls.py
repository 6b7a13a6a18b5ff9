"""What accuracy each size of balls costs: a plate test in one box on beds of ever smaller balls."""

import time
from typing import Any

import numpy as np

from rover_gym.ground.grains.ball_bed import settled_balls
from rover_gym.ground.grains.lab import fit_pressure, plate_test
from validation.watch import Ledger

#: Mean radius of the balls, m, number of them, which fill the box to 0.1 m, and seeds of the beds.
SIZES = ((0.012, 300, (0, 1, 2, 3)), (0.0085, 840, (0, 1, 2)), (0.006, 2400, (0, 1)))
SPREAD = 0.2
EDGE = 0.2  # of the box, m
PLATE, SINKAGE = 0.04, 0.02  # m
#: Depth below the first contact at which the pressures are compared, m.
COMPARED = 0.015
FRICTION = 0.55


def trial(radius: float, count: int, seed: int, *, sinkage: float = SINKAGE) -> dict[str, Any]:
    """One plate on one bed."""
    begin = time.process_time()
    limits = {"radius_min": radius * (1.0 - SPREAD), "radius_max": radius * (1.0 + SPREAD)}
    bed = settled_balls(count, EDGE, EDGE, **limits, seed=seed, friction=FRICTION)
    settled = time.process_time()
    points = plate_test(bed, PLATE, depth=sinkage, samples=15, plate_friction=FRICTION, friction=FRICTION)
    law = fit_pressure(points)
    return {
        "radius": radius,
        "count": count,
        "seed": seed,
        "n": law.n,
        "pressure": float(law(COMPARED)),
        "scatter": law.rms,
        "settling_cpu_seconds": settled - begin,
        "plate_cpu_seconds": time.process_time() - settled,
        "depth": [point.depth for point in points],
        "pressures": [point.pressure for point in points],
    }


def measure(ledger: Ledger) -> dict[str, Any]:
    """The plate on all beds, one after another, so that the times compare; the ledger stays empty."""
    del ledger
    runs = [trial(radius, count, seed) for radius, count, seeds in SIZES for seed in seeds]
    return {"runs": runs, "means": means(runs)}


def means(runs: list[dict[str, Any]]) -> list[dict[str, float]]:
    """A row for each size: means over the beds, the spread of one bed, and CPU seconds of one plate test."""
    rows = []
    for radius in sorted({run["radius"] for run in runs}, reverse=True):
        same = [run for run in runs if run["radius"] == radius]
        row = {"radius": radius, "count": same[0]["count"], "beds": len(same)}
        for name in ("pressure", "n"):
            values = np.array([run[name] for run in same])
            row |= {name: float(values.mean()), f"{name}_spread": float(values.std(ddof=1))}
        for name in ("scatter", "settling_cpu_seconds", "plate_cpu_seconds"):
            row[name] = float(np.mean([run[name] for run in same]))
        rows.append(row)
    return rows
