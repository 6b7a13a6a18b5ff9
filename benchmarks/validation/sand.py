"""Sand beside measurements: `python -m validation.sand --data FOLDER` writes tables and a figure.

The folder has `wheel_on_sand.csv`, `sinkage_transients.csv` and `single_wheels.csv`, which are not in the repository;
`docs/sand.md` says where the public data are. Without a folder the command says so and ends.
"""

import argparse
import csv
import math
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from reports import DOCS, table as table_of

from rover_gym.ground.sand import (
    FittedSoil,
    Runs,
    SingleWheel,
    Soil,
    climbed_slope,
    errors_of,
    fit_soil,
    named_soil,
    read_runs,
)
from validation.sand_transients import transients

mpl.use("Agg")
import matplotlib.pyplot as plt

FOLDER = DOCS / "validation"
VARIABLE = "ROVER_GYM_SOIL_DATA"

#: The wheel of the data set. The number of grousers is not stated there; 30 hold sand all around the rim.
WHEELS = {"smooth": SingleWheel(0.058, 0.05), "grousered": SingleWheel(0.058, 0.05, 0.005, 30)}

#: Errors of the model published with the data, which has coefficients for each slip angle: N, N, mm.
PUBLISHED = {"smooth": (6.8, 7.3, 7.5), "grousered": (5.1, 6.9, 9.0)}

#: NASA's MGRU3 wheel on GRC-1: slope, degrees, and slip, as Project Chrono's scripts quote the measurement.
MGRU3 = ((0.3, 0.032), (5.2, 0.052), (10.0, 0.135), (15.0, 0.434), (20.2, 0.756), (25.1, 0.885))
MGRU3_MASS = 17.5

#: Heads of columns of errors.
QUANTITIES = ("pull, N", "across, N", "sinkage, mm")

#: Titles of the tables of slip sinkage over the travel.
OVER_TRAVEL = (
    "Errors of the slip sinkage, by rim speed, over 400 mm of travel at 10 mm/s, root mean squares, mm",
    "Travel to 63% of the slip sinkage at 400 mm, slip angle 0°, measured / predicted, mm",
)

SIDEWAYS = math.radians(89.0)


def weights(runs: Sequence[Runs]) -> list[npt.NDArray[np.float64]]:
    """1, but 0 for the pull at 90 degrees: by symmetry a locked wheel has none there, and 7 N were measured."""
    found = []
    for own in runs:
        weight = np.ones((len(own), 3))
        weight[own.slip_angle > SIDEWAYS, 0] = 0.0
        found.append(weight)
    return found


def cells(values: Iterable[float]) -> list[str]:
    """Of a table, with one decimal."""
    return [f"{value:.1f}" for value in values]


def rms(errors: npt.NDArray[np.float64]) -> list[str]:
    """Root mean squares of errors (n, 3) in N, N and mm, as cells of a table."""
    return cells(np.sqrt((errors**2).mean(axis=0)) * (1.0, 1.0, 1e3))


def table(soil: Soil, runs: Sequence[Runs]) -> str:
    """Errors by wheel and slip angle."""
    lines = []
    for own in runs:
        errors = errors_of(soil, [own], WHEELS)
        degrees = np.degrees(own.slip_angle).round()
        lines += [[own.wheel, f"{angle:.0f}°", *rms(errors[degrees == angle])] for angle in np.unique(degrees)]
        lines.append([own.wheel, "below 90°", *rms(errors[own.slip_angle < SIDEWAYS])])
        lines.append([own.wheel, "all", *rms(errors)])
        lines.append([own.wheel, "all, published model", *cells(PUBLISHED[own.wheel])])
    return table_of(["wheel", "slip angles", *QUANTITIES], lines)


def fitted(fit: FittedSoil) -> str:
    """The fitted numbers with their standard deviations."""
    pairs = zip(fit.free, fit.deviations.tolist(), strict=True)
    return ", ".join(f"`{name}` {fit.soil.numbers[name]:.3f} ± {deviation:.3f}" for name, deviation in pairs)


def predictions(start: Soil, runs: Sequence[Runs]) -> str:
    """Fits on some of the runs, and the errors of the others."""
    lines = []
    for wheel, other in (("grousered", "smooth"), ("smooth", "grousered")):
        chosen = [own for own in runs if own.wheel == wheel]
        fit = fit_soil(start, chosen, WHEELS, weights=weights(chosen))
        rest = [own for own in runs if own.wheel == other]
        below = [own.where(own.slip_angle < SIDEWAYS) for own in rest]
        lines.append([f"the {wheel} wheel", f"the {other} wheel", *rms(errors_of(fit.soil, rest, WHEELS))])
        lines.append(["", "the same below 90°", *rms(errors_of(fit.soil, below, WHEELS))])
    degrees = [np.degrees(own.slip_angle).round() for own in runs]
    chosen = [own.where(np.isin(angle, (0, 45))) for own, angle in zip(runs, degrees, strict=True)]
    fit = fit_soil(start, chosen, WHEELS, weights=weights(chosen))
    for angle in (15, 60, 90):
        rest = [own.where(of == angle) for own, of in zip(runs, degrees, strict=True)]
        lines.append(["0° and 45°, both wheels", f"{angle}°", *rms(errors_of(fit.soil, rest, WHEELS))])
    return table_of(["fitted on", "predicted", *QUANTITIES], lines)


def mgru3() -> str:
    """Slope at equal slip of the MGRU3 wheel, nothing fitted."""
    lines = []
    soil = named_soil("grc-1")
    wheels = (SingleWheel(0.225, 0.2), SingleWheel(0.225, 0.2, 0.01, 24))
    for slope, slip in MGRU3:
        found = [math.degrees(climbed_slope(wheel, soil, MGRU3_MASS, slip)[0]) for wheel in wheels]
        lines.append([f"{slip:.3f}", f"{slope}°", *(f"{angle:.1f}°" for angle in found)])
    return table_of(["slip", "slope measured", "without grousers", "24 grousers of 10 mm"], lines)


def own_soils(cells: dict[str, str]) -> list[Soil]:
    """The soil of a row from its own published numbers, in both laws."""
    friction = math.tan(math.radians(float(cells["friction_angle_deg"])))
    grains = named_soil("hit-simulant").having(density=float(cells["density_kg_m3"]), internal_friction=friction)
    # The modulus for this wheel in one number, as one of the two parts may be negative.
    width = float(cells["wheel_width_m"])
    modulus = 1e3 * (float(cells["k_c_kN_per_m_n1"]) / width + float(cells["k_phi_kN_per_m_n2"]))
    bekker = named_soil("hit-simulant-bekker").having(
        cohesive_modulus=0.0,
        frictional_modulus=modulus,
        exponent=float(cells["n"]),
        cohesion=1e3 * float(cells["cohesion_kPa"]),
        internal_friction=friction,
        shear_modulus=float(cells["shear_modulus_m"]),
    )
    return [grains, bekker]


def single_wheels(path: Path) -> str:
    """Pull and torque of other wheels from their soils' own numbers, nothing fitted."""
    lines = []
    groups: dict[str, list[npt.NDArray[np.float64]]] = {}
    with path.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            radius, height = float(row["wheel_radius_m"]), float(row["grouser_height_m"])
            wheel = SingleWheel(radius, float(row["wheel_width_m"]), height, int(row["grouser_count"]))
            slip, pull, rim = float(row["slip"]), float(row["drawbar_N"]), float(row["torque_Nm"]) / radius
            drive = [0.1 * (1.0 - slip), 0.1 / radius, 0.0, float(row["load_N"]), 9.81]
            found = np.array([wheel.on(soil).steady([drive])[0, [1, 4]] / (1.0, radius) for soil in own_soils(row)])
            name = f"{row['source']}, grousers {1e3 * height:.0f} mm"
            for group in (name, f"{row['source']}, all"):
                groups.setdefault(group, []).append(np.abs(found[:, 0] - pull) / abs(pull))
            lines.append([name, f"{slip}", f"{pull}", *cells(found[:, 0]), f"{rim:.1f}", *cells(found[:, 1])])
    for name, errors in groups.items():
        medians = [f"{100.0 * value:.0f}%" for value in np.median(errors, axis=0)]
        lines.append([name, "median error", "", *medians, "", "", ""])
    heads = ["wheel", "slip", "pull, N", "resistive", "Bekker", "torque / radius, N", "resistive", "Bekker"]
    return table_of(heads, lines)


def draw(soil: Soil, runs: Sequence[Runs], path: Path) -> None:
    """Measured and predicted forces and sinkage over slip, by slip angle."""
    names = ("drawbar pull, N", "force across, N", "sinkage, mm")
    figure, axes = plt.subplots(len(runs), 3, figsize=(11, 3.2 * len(runs)), squeeze=False)
    for line, own in zip(axes, runs, strict=True):
        rim = own.rate * WHEELS[own.wheel].radius
        slip = (rim - own.speed) / np.maximum(rim, own.speed)
        predicted = own.predicted(WHEELS[own.wheel].on(soil))
        degrees = np.degrees(own.slip_angle).round()
        for k, (axis, name) in enumerate(zip(line, names, strict=True)):
            scale = 1e3 if k == 2 else 1.0
            for n, angle in enumerate(np.unique(degrees)):
                of = np.flatnonzero(degrees == angle)
                of = of[np.argsort(slip[of])]
                axis.plot(slip[of], scale * predicted[of, k], color=f"C{n}", label=f"{angle:.0f}°")
                axis.plot(slip[of], scale * own.measured[of, k], "o", color=f"C{n}", markersize=3)
            axis.set(title=f"{own.wheel}: {name}", xlabel="slip")
    axes[0, 0].legend(title="slip angle", fontsize="small")
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def main() -> None:
    """Writes `docs/validation/sand.md` and `sand.png`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=os.environ.get(VARIABLE))
    data = parser.parse_args().data
    if data is None:
        sys.stdout.write(f"validate-sand: skipped, no data: give --data FOLDER or set {VARIABLE}\n")
        return
    runs = read_runs(Path(data) / "wheel_on_sand.csv", WHEELS)
    start = named_soil("cmu-sand")
    fit = fit_soil(start, runs, WHEELS, weights=weights(runs))
    parts = {
        "Fitted numbers": fitted(fit),
        "Errors of the soil `cmu-sand`, root mean squares": table(start, runs),
        "Errors of predictions, root mean squares": predictions(start, runs),
        **dict(zip(OVER_TRAVEL, transients(start, runs, WHEELS, Path(data) / "sinkage_transients.csv"), strict=True)),
        "MGRU3 wheel on GRC-1, nothing fitted": mgru3(),
        "Other wheels, nothing fitted": single_wheels(Path(data) / "single_wheels.csv"),
    }
    text = "\n\n".join(f"## {title}\n\n{part}" for title, part in parts.items())
    head = "---\norphan: true\n---\n\n# Sand: tables\n\nBy `make validate-sand`; [sand](../sand.md) explains them."
    (FOLDER / "sand.md").write_text(f"{head}\n\n{text}\n", encoding="utf-8")
    draw(start, runs, FOLDER / "sand.png")
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    main()
