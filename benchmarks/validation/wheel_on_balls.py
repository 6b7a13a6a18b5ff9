"""A single wheel on beds of balls, in the dimensions of measurements on dry sand.

Wheel, load, density and the angle of repose are those of the measurements; friction is the tangent of that angle, and
nothing is fitted to the wheel's forces. Two sizes of balls are extrapolated to none, linearly in the radius.
"""

import csv
import math
import os
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.ground.grains.ball_bed import BallBed, settled_balls
from rover_gym.ground.grains.lab import wheel_test
from validation.watch import Ledger

#: Mean radius of the balls, m, number of them, and seeds of the beds.
SIZES = ((0.010, 770, (0,)), (0.006, 3550, (0,)))
SPREAD = 0.2
#: Box, m: as long as the wheel's way asks for, as wide as a wheel at 45° does.
WIDTH, DEPTH = 0.29, 0.17
BULK_DENSITY = 1330.0  # kg/m³
FRICTION = math.tan(math.radians(29.0))
WHEEL = {"radius": 0.058, "width": 0.05, "wheel_friction": FRICTION, "friction": FRICTION}
RUN_IN, DISTANCE = 0.05, 0.06  # m
SPEED = 0.05  # m/s; measured at a fifth
#: Slip angle, degrees, slip, and the load measured there, N.
POINTS = (
    (0, -0.7, 21.8),
    (0, 0.0, 24.6),
    (0, 0.5, 25.3),
    (45, -0.2, 21.9),
    (45, 0.5, 21.9),
)
#: Names the file of the measurements, `wheel_on_sand.csv` of the public data beside "3D terramechanics" (Carnegie
#: Mellon University, MIT licence, copyright 2022). Without it nothing is compared.
FILE = "WHEEL_ON_SAND"
QUANTITIES = ("pull", "lateral", "sinkage")


def measurements() -> list[list[float]]:
    """Pull and lateral force, N, and sinkage, m, measured at `POINTS`; empty without the file.

    Means of the smooth wheel's runs at the rim speed whose slip is nearest.
    """
    path = os.environ.get(FILE)
    if not path:
        return []
    with Path(path).open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["wheel"] == "smooth"]
    found = []
    for angle, slip, _ in POINTS:
        groups: dict[str, list[dict[str, str]]] = {}
        for row in rows:
            if float(row["slip_angle_deg"]) == angle:
                groups.setdefault(row["nominal_rim_speed_mm_s"], []).append(row)
        runs = min(groups.values(), key=lambda runs: abs(_mean(runs, "slip") - slip))
        pull, lateral = _mean(runs, "drawbar_N"), _mean(runs, "lateral_N") if angle else 0.0
        found.append([pull, lateral, _mean(runs, "sinkage_mm") / 1e3])
    return found


def _mean(rows: list[dict[str, str]], column: str) -> float:
    return float(np.mean([float(row[column]) for row in rows]))


def bed_of(radius: float, count: int, seed: int) -> BallBed:
    """A settled bed with the sand's bulk density."""
    bed = settled_balls(
        count,
        WIDTH,
        DEPTH,
        radius_min=radius * (1.0 - SPREAD),
        radius_max=radius * (1.0 + SPREAD),
        density=BULK_DENSITY / 0.55,
        seed=seed,
        friction=FRICTION,
    )
    # A common factor of all masses changes no motion under gravity.
    return replace(bed, mass=bed.mass * (0.55 / bed.packing))


def trial(radius: float, count: int, seed: int) -> dict[str, Any]:
    """All points on one bed."""
    begin = time.process_time()
    bed = bed_of(radius, count, seed)
    settled = time.process_time()
    points = []
    for angle, slip, load in POINTS:
        start = time.process_time()
        (point,) = wheel_test(
            bed,
            [slip],
            slip_angle=math.radians(angle),
            load=load,
            speed=SPEED,
            run_in=RUN_IN,
            distance=DISTANCE,
            **WHEEL,
        )
        points.append(asdict(point) | {"degrees": angle, "cpu_seconds": time.process_time() - start})
    return {
        "radius": radius,
        "count": count,
        "seed": seed,
        "packing": bed.packing,
        "surface": bed.surface,
        "settling_cpu_seconds": settled - begin,
        "points": points,
    }


def measure(ledger: Ledger) -> dict[str, Any]:
    """The wheel on all beds, one after another, and what is extrapolated from them; the ledger stays empty."""
    del ledger
    runs = [trial(radius, count, seed) for radius, count, seeds in SIZES for seed in seeds]
    return {"runs": runs, **summary(runs)}


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Means by size, their extrapolation to balls of radius 0, and RMS errors against the measurements."""
    radii = sorted({run["radius"] for run in runs})
    means = {radius: np.mean([_values(run) for run in runs if run["radius"] == radius], axis=0) for radius in radii}
    fine, coarse = radii
    share = fine / (coarse - fine)
    found = {
        "coarse": means[coarse],
        "fine": means[fine],
        "extrapolated": means[fine] + share * (means[fine] - means[coarse]),
    }
    measured = measurements()
    return {
        "rms": {
            name: dict(zip(QUANTITIES, np.sqrt(np.mean((values - measured) ** 2, axis=0)).tolist(), strict=True))
            for name, values in found.items()
            if measured
        },
        "values": {name: values.tolist() for name, values in found.items()},
    }


def _values(run: dict[str, Any]) -> list[list[float]]:
    return [[point[name] for name in QUANTITIES] for point in run["points"]]
