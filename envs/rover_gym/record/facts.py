"""The metadata of a recording: scene, seed, solver settings and versions."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from rover_gym.mechanics import OptionError, Simulation, __version__
from rover_gym.record.trajectory_format import (
    FORMAT,
    FORMAT_VERSION,
    RecordingError,
    import_h5py,
)
from rover_gym.validation import checked, number, refuse

if TYPE_CHECKING:
    import h5py


#: Most rows of a run, which limits file size and run time.
MOST_ROWS = 10_000_000


def versions() -> dict[str, Any]:
    """The file format, and the versions of the software that writes it."""
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "rover_gym_version": __version__,
        "numpy_version": np.__version__,
        "gymnasium_version": gymnasium.__version__,
        "python_version": platform.python_version(),
    }


def storable(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Converts metadata to what HDF5 stores: strings, numbers and arrays of numbers as they are, the rest as JSON."""
    result: dict[str, Any] = {}
    for key, value in attributes.items():
        plain = isinstance(value, (str, float, np.number)) or (
            (isinstance(value, int) and -(2**63) <= value < 2**63)
            or (isinstance(value, np.ndarray) and value.dtype.kind in "biuf")
        )
        try:
            stored = value if plain else json.dumps(value, default=_to_plain)
            if isinstance(stored, str):
                stored.encode()
        except (TypeError, ValueError, RecursionError) as error:
            refuse(RecordingError, str(key), value, f"cannot be stored ({error})")
        if isinstance(stored, str) and "\0" in stored:
            refuse(RecordingError, str(key), value, "must not hold the character NUL")
        result[key] = stored
    return result


@checked(time_step=float)
def row_count(duration: float, time_step: float, steps_per_row: int = 1) -> int:
    """The number of rows of a run after the first.

    Args:
        duration: Simulated time, s.
        time_step: Step size, s.
        steps_per_row: Steps between rows.

    Raises:
        OptionError: `duration` is no positive number, `steps_per_row` is no positive whole number, or there would be
            more than `MOST_ROWS` rows.
    """
    seconds = number("duration", duration, above=0.0)
    per_row = number("steps_per_row", steps_per_row, at_least=1.0)
    if per_row != math.floor(per_row):
        refuse(OptionError, "steps_per_row", steps_per_row, "must be a whole number")
    rows = seconds / time_step / per_row
    if not rows <= MOST_ROWS:
        reason = f"at a step of {time_step:g} s makes more than {MOST_ROWS} rows"
        refuse(OptionError, "duration", duration, reason)
    return round(rows)


@checked(sim="Simulation", scene=(Mapping, None))
def describe(
    sim: Simulation, title: str, scene: Mapping[str, Any] | None = None, *, seed: int | str = "none"
) -> dict[str, Any]:
    """The attributes of a recording, taken from the simulation at its start.

    Args:
        sim: The simulation, whose model, state, commands and settings are stored.
        title: Title of the run.
        scene: Further parameters of the scene.
        seed: Seed of the run, or why there is none.
    """
    return {
        "title": title,
        "scene": {
            **(scene or {}),
            "model": sim.model.to_dict(),
            "q": sim.q,
            "steering": sim.steering,
            "wheel_torques": sim.wheel_torques,
        },
        "seed": seed,
        "solver": sim.settings,
    }


def write_attribute(item: Any, key: str, value: Any) -> None:
    """Stores an attribute; text is stored as UTF-8 of fixed length."""
    if isinstance(value, str):
        text = value.encode()
        item.attrs.create(key, text, dtype=import_h5py().string_dtype("utf-8", max(1, len(text))))
    else:
        item.attrs[key] = value


def write_description(data: h5py.Dataset, unit: str, description: str, columns: Sequence[str]) -> None:
    """Stores unit, description and column names in a data set's attributes."""
    write_attribute(data, "unit", unit)
    write_attribute(data, "description", description)
    if columns:
        write_texts(data, "columns", columns)


def write_texts(item: Any, key: str, texts: Sequence[str]) -> None:
    """Stores several texts in an attribute."""
    encoded = [text.encode() for text in texts]
    item.attrs.create(key, encoded, dtype=import_h5py().string_dtype("utf-8", max(1, *map(len, encoded))))


def _to_plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory's attributes")
