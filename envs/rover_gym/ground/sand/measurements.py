"""Measurements of one wheel on a test bed: tables of runs, read from CSV files."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, WheelBed
from rover_gym.ground.sand.soils import Soil

Array = npt.NDArray[np.float64]

#: Columns of a table: what was prescribed, then what was measured.
COLUMNS = ("wheel", "slip_angle_deg", "rim_speed_mm_s", "speed_mm_s", "drawbar_N", "lateral_N", "load_N", "sinkage_mm")

#: Gravity of a test bed on Earth, m/s².
GRAVITY = 9.81


@dataclass(frozen=True)
class SingleWheel:
    """Geometry of a wheel of a test bed.

    Args:
        radius: Radius without grousers, m.
        width: Width, m.
        grouser_height: Height of the grousers, m.
        grousers: Their number.
    """

    radius: float
    width: float
    grouser_height: float = 0.0
    grousers: int = 0

    def on(self, soil: Soil) -> WheelBed:
        """This wheel on a bed of a soil.

        Args:
            soil: The soil.

        Returns:
            The bed.
        """
        return WheelBed(soil, self.radius, self.width, grouser_height=self.grouser_height, grousers=self.grousers)


@dataclass(frozen=True)
class Runs:
    """Steady runs of one wheel.

    Args:
        wheel: Its name.
        slip_angle: Angle from the wheel's plane to its travel, (n,), rad.
        speed: Speed of travel, (n,), m/s.
        rate: Rate of the wheel, positive forward, (n,), rad/s.
        load: Vertical force of the soil, (n,), N.
        measured: Drawbar pull (N), force across the wheel against its travel (N) and sinkage (m), (n, 3).
    """

    wheel: str
    slip_angle: Array
    speed: Array
    rate: Array
    load: Array
    measured: Array

    def __len__(self) -> int:
        return len(self.load)

    def where(self, chosen: npt.NDArray[np.bool_]) -> "Runs":
        """Some of the runs.

        Args:
            chosen: Which, (n,) bool.

        Returns:
            Those.
        """
        fields = (self.slip_angle, self.speed, self.rate, self.load, self.measured)
        return Runs(self.wheel, *(values[chosen] for values in fields))

    @property
    def drives(self) -> Array:
        """What `WheelBed.steady` takes, (n, 5)."""
        gravity = np.full(len(self), GRAVITY)
        return np.stack([self.speed, self.rate, self.slip_angle, self.load, gravity], axis=1)

    def predicted(self, bed: WheelBed) -> Array:
        """Drawbar pull (N), force across (N) and sinkage (m) on a bed, (n, 3); nan where it does not bear the load.

        Args:
            bed: The wheel on a soil.

        Returns:
            The prediction.
        """
        found = bed.steady(self.drives)
        return np.stack([found[:, 1], -found[:, 2], found[:, 0]], axis=1)


def read_runs(path: Path, wheels: Mapping[str, SingleWheel]) -> list[Runs]:
    """Reads a table of runs, and averages those with the same nominal speeds.

    Args:
        path: A CSV file with at least the columns of `COLUMNS`, and `nominal_rim_speed_mm_s`.
        wheels: Geometry of each wheel by the name in the table.

    Returns:
        The runs of each wheel.

    Raises:
        OptionError: A column is missing, a cell is no number, or a wheel is unknown.
    """
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [name for name in COLUMNS if name not in (reader.fieldnames or [])]
        if missing:
            raise OptionError(f"{path.name}: has no column {missing[0]}")
        groups: dict[tuple[str, float, float], list[list[float]]] = {}
        for number, row in enumerate(reader, start=2):
            if row["wheel"] not in wheels:
                raise OptionError(f"{path.name}: line {number}: unknown wheel {row['wheel']!r}")
            cells = _numbers(row, path.name, number)
            nominal = row.get("nominal_rim_speed_mm_s")
            key = (row["wheel"], cells[0], float(nominal) if nominal else float(number))
            groups.setdefault(key, []).append(cells)
    return [_runs(name, wheel.radius, groups) for name, wheel in wheels.items()]


def _numbers(row: Mapping[str, Any], name: str, line: int) -> list[float]:
    cells = []
    for column in COLUMNS[1:]:
        try:
            cells.append(float(row[column]))
        except (TypeError, ValueError):
            raise OptionError(f"{name}: line {line}: {column} must be a number, is {row[column]!r}") from None
    return cells


def _runs(name: str, radius: float, groups: Mapping[tuple[str, float, float], Sequence[list[float]]]) -> Runs:
    means = [np.mean(rows, axis=0) for key, rows in groups.items() if key[0] == name]
    table = np.array(means, dtype=np.float64).reshape(-1, len(COLUMNS) - 1)
    angle, rim, speed, drawbar, lateral, load, sinkage = table.T
    measured = np.stack([drawbar, lateral, 1e-3 * sinkage], axis=1)
    return Runs(name, np.radians(angle), 1e-3 * speed, 1e-3 * rim / radius, load, measured)
