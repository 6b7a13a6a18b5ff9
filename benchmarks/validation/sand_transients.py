"""Sinkage of a wheel on sand over its travel, beside measurements: the tables of `validation.sand`.

The wheel rolls with rim speed and speed of travel equal until its sinkage is steady. Then the rim speed jumps. Slip
sinkage is what the sinkage gains from there beyond that of a wheel that goes on rolling.
"""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from reports import table as table_of

from rover_gym.core import WheelBed
from rover_gym.ground.sand import Runs, SingleWheel, Soil
from rover_gym.ground.sand.measurements import GRAVITY

Array = npt.NDArray[np.float64]

#: Speed of travel of all runs, m/s.
SPEED = 0.01

#: Step, s, and travel before the jump, m. A tenth of the step changes no error by 0.1 mm.
STEP = 0.05
ROLLED = 0.1

#: Accuracy of the forces by which the points of a wheel are chosen: that of a rover's wheels.
ACCURACY = 0.05

#: Slip sinkage at the end, mm, from which on the shape of a curve is compared.
SHAPED = 2.0

#: Part of the slip sinkage at the end that is reached after the length of an exponential approach.
MOST = 1.0 - math.exp(-1.0)


@dataclass(frozen=True)
class Curve:
    """Slip sinkage of a wheel after its rim speed has jumped.

    Args:
        wheel: Name of the wheel.
        degrees: Slip angle.
        rim: Rim speed after the jump, mm/s.
        travel: Travel after it, (n,), mm.
        measured: Slip sinkage there, mean of the trials, (n,), mm.
        spread: Standard deviation of the trials, (n,), mm.
    """

    wheel: str
    degrees: int
    rim: int
    travel: Array
    measured: Array
    spread: Array


def read_curves(path: Path) -> list[Curve]:
    """The curves of `sinkage_transients.csv`."""
    groups: dict[tuple[str, int, int], list[list[float]]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            key = (row["wheel"], int(row["slip_angle_deg"]), int(row["nominal_rim_speed_mm_s"]))
            point = [float(row[name]) for name in ("travel_mm", "slip_sinkage_mm", "std_mm")]
            groups.setdefault(key, []).append(point)
    return [Curve(*key, *np.array(points).T) for key, points in groups.items()]


def mean_load(runs: Sequence[Runs], curve: Curve, wheel: SingleWheel) -> float:
    """Load in the steady runs at the angle and the nearest rim speed of a curve, N."""
    own = next(own for own in runs if own.wheel == curve.wheel)
    here = own.where(np.degrees(own.slip_angle).round() == curve.degrees)
    nearest = np.argmin(np.abs(1e3 * here.rate * wheel.radius - curve.rim))
    return float(here.load[nearest])


def predicted(bed: WheelBed, wheel: SingleWheel, curve: Curve, load: float) -> Array:
    """Slip sinkage at the places of a curve, (n,), mm."""
    before, after = (round(way / SPEED / STEP) for way in (ROLLED, 1e-3 * curve.travel[-1]))

    def sinkage(rim: float) -> Array:
        rows = [[SPEED, speed / wheel.radius, math.radians(curve.degrees), load, GRAVITY] for speed in (SPEED, rim)]
        drives = np.repeat(rows, [before, after + 1], axis=0)
        return 1e3 * bed.run(drives, load / GRAVITY, STEP)[before - 1 :, 0]

    gained = sinkage(1e-3 * curve.rim) - sinkage(SPEED)
    return np.interp(curve.travel, 1e3 * SPEED * STEP * np.arange(len(gained)), gained)


def bed_of(soil: Soil, wheel: SingleWheel) -> WheelBed:
    """A wheel on a soil, with as few points as a rover's wheels have."""
    return WheelBed(
        soil,
        wheel.radius,
        wheel.width,
        grouser_height=wheel.grouser_height,
        grousers=wheel.grousers,
        accuracy=ACCURACY,
    )


def errors(found: Array, curve: Curve) -> tuple[float, float, float]:
    """Root mean squares over the travel of a curve, mm.

    The first is the error of a prediction, the second that of the prediction times the number that makes its end the
    measured one: what is left if the steady value were right. Curves that end within `SHAPED` have none (nan). The
    third is the spread of the trials.
    """
    scale = curve.measured[-1] / found[-1] if min(curve.measured[-1], found[-1]) > SHAPED else math.nan
    whole, shaped = (float(np.sqrt(np.mean((found * by - curve.measured) ** 2))) for by in (1.0, scale))
    return whole, shaped, float(np.sqrt(np.mean(curve.spread**2)))


def length(slip_sinkage: Array, travel: Array) -> str:
    """Travel to `MOST` of the slip sinkage at the end, mm; none where that is small."""
    if slip_sinkage[-1] < SHAPED:
        return "-"
    reached = int(np.argmax(slip_sinkage >= MOST * slip_sinkage[-1]))
    return f"{np.interp(MOST * slip_sinkage[-1], slip_sinkage[: reached + 1], travel[: reached + 1]):.0f}"


def transients(soil: Soil, runs: Sequence[Runs], wheels: dict[str, SingleWheel], path: Path) -> list[str]:
    """Tables of the slip sinkage over the travel: errors by wheel, slip angle and rim speed; lengths at 0 degrees."""
    curves = read_curves(path)
    beds = {name: bed_of(soil, wheel) for name, wheel in wheels.items()}
    found, lengths = {}, {}
    for curve in curves:
        wheel = wheels[curve.wheel]
        slip_sinkage = predicted(beds[curve.wheel], wheel, curve, mean_load(runs, curve, wheel))
        found[curve.wheel, curve.degrees, curve.rim] = errors(slip_sinkage, curve)
        if curve.degrees == 0:
            both = (curve.measured, slip_sinkage)
            lengths[curve.wheel, curve.rim] = " / ".join(length(own, curve.travel) for own in both)
    rims = sorted({curve.rim for curve in curves})

    def row(wheel: str, name: str, angles: Sequence[int]) -> list[str]:
        own = np.array([[found[wheel, angle, rim] for angle in angles] for rim in rims])
        by_rim = np.sqrt((own[:, :, 0] ** 2).mean(axis=1))
        return [wheel, name, *(f"{mm:.1f}" for mm in (*by_rim, *np.sqrt(np.nanmean(own**2, axis=(0, 1)))))]

    lines = []
    for name in wheels:
        angles = sorted({curve.degrees for curve in curves if curve.wheel == name})
        lines += [row(name, f"{angle}°", [angle]) for angle in angles]
        lines.append(row(name, "below 90°", [angle for angle in angles if angle < 90]))
    speeds = [f"{rim} mm/s" for rim in rims]
    heads = ["wheel", "slip angle", *speeds, "all", "ends as measured", "spread of trials"]
    ways = [[name, *(lengths[name, rim] for rim in rims)] for name in wheels]
    return [table_of(heads, lines), table_of(["wheel", *speeds], ways)]
