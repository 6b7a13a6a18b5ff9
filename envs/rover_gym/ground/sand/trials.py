"""Trials of a whole rover on sand, from the processed files of the RoSE Lab's mobility data set."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import number

Array = npt.NDArray[np.float64]

#: Columns of a processed trial that are read: time (s), place with z up (m), and rates of the wheels (rad/s).
COLUMNS = ("time_s", "pos_x", "pos_y", "pos_z", *(f"vel{wheel}_rad_s" for wheel in range(1, 5)))

#: Part of its usual rate at which a wheel counts as driven.
DRIVEN = 0.5

#: Time between the places that are joined to the way, s: over shorter times the noise of motion capture adds to it.
CHORD = 1.0


@dataclass(frozen=True)
class Trial:
    """Means over the middle half of the time in which the wheels turn.

    Args:
        name: Folders of the file, such as `5.0_120.0_Right_0.0/Trial_1`.
        seconds: Duration of that half, s.
        slope_deg: Rise over the level way, degrees; negative downhill.
        speed: Of the rover, m/s.
        rim_speed: Of the wheels, whatever their direction, m/s.
        slip: 1 - speed / rim speed.
    """

    name: str
    seconds: float
    slope_deg: float
    speed: float
    rim_speed: float
    slip: float


def read_trial(path: Path, radius: float) -> Trial:
    """Reads speed, slope and slip of a `Processed_Data.csv`.

    The slip of a rover that turns on the spot is near 1, because its centre hardly moves.

    Args:
        path: The file.
        radius: Radius of the wheels, m; the files do not have it.

    Returns:
        The trial.

    Raises:
        OptionError: The radius is not positive, a column is missing, a cell is no number, times do not increase, or
            the wheels turn for less than two seconds.
    """
    radius = number("radius", radius, above=0.0)
    table = _read(path)
    time, places, rates = table[:, 0], table[:, 1:4], np.abs(table[:, 4:])
    if np.any(np.diff(time) <= 0.0):
        raise OptionError(f"{path.name}: time_s must increase")
    mean = rates.mean(axis=1)
    driven = np.flatnonzero(mean > DRIVEN * np.percentile(mean, 90))
    begin, end = (float(time[driven[k]]) for k in (0, -1)) if len(driven) else (0.0, 0.0)
    quarter = 0.25 * (end - begin)
    if 2.0 * quarter < CHORD:
        raise OptionError(
            f"{path.name}: the wheels must turn for at least {2.0 * CHORD:g} s, turn for {end - begin:g} s"
        )
    begin, end = begin + quarter, end - quarter
    ends = np.linspace(begin, end, 1 + int((end - begin) / CHORD))
    chords = np.diff(np.stack([np.interp(ends, time, places[:, d]) for d in range(3)], axis=1), axis=0)
    seconds, rise = end - begin, float(chords[:, 2].sum())
    level = float(np.hypot(chords[:, 0], chords[:, 1]).sum())
    steady = (time >= begin) & (time <= end)
    speed = float(np.linalg.norm(chords, axis=1).sum()) / seconds
    rim_speed = radius * float(mean[steady].mean())
    name = "/".join(path.resolve().parts[-3:-1])
    return Trial(name, seconds, math.degrees(math.atan2(rise, level)), speed, rim_speed, 1.0 - speed / rim_speed)


def _read(path: Path) -> Array:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [name for name in COLUMNS if name not in (reader.fieldnames or [])]
        if missing:
            raise OptionError(f"{path.name}: has no column {missing[0]}")
        rows = [
            [_cell(cells[name], name, path, line) for name in COLUMNS] for line, cells in enumerate(reader, start=2)
        ]
    if not rows:
        raise OptionError(f"{path.name}: has no rows")
    return np.array(rows, dtype=np.float64)


def _cell(text: str | None, column: str, path: Path, line: int) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise OptionError(f"{path.name}: line {line}: {column} must be a number, is {text!r}")
    return value
