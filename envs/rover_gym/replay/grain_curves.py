"""The curves beside a page of balls: loads and sinkage of the wheels, energy, contacts and overlap."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.replay.page import WHEEL_COLOURS
from rover_gym.replay.player import rounded

if TYPE_CHECKING:
    from rover_gym.grains.grain_run import GrainRun

Array = npt.NDArray[np.float64]

COLOURS = ("#332288", "#CC6677")


def grain_curves(run: GrainRun) -> dict[str, Any]:
    """Contents of the panel: its title, the time, and for each chart its curves."""
    data = run.trajectory
    wheels = [] if run.model is None else _series(run.model.wheel_names, WHEEL_COLOURS)
    charts: list[dict[str, Any]] = []
    if run.model is not None:
        charts += [
            _chart("wheel load", "N", run.wheel_forces[..., 1], 1, wheels),
            _chart("sinkage", "mm", 1e3 * run.sinkage, 2, wheels),
        ]
    potential = data["potential_energy"] - data["potential_energy"][0]
    energy = np.stack((data["kinetic_energy"], potential), axis=1)
    overlap = 100.0 * data["penetration"] / float(run.radius.min())
    charts += [
        _chart("energy", "J", energy, 4, _series(("kinetic", "potential, from the start"), COLOURS)),
        _chart("contacts", "1", data["n_contacts"][:, None], 0, _series(("contacts",), COLOURS)),
        _chart("deepest overlap", "% of a radius", overlap[:, None], 4, _series(("overlap",), COLOURS)),
    ]
    return {
        "title": run.title,
        "time": [round(float(time - run.time[0]), 4) for time in run.time],
        "wheels": wheels,
        "charts": charts,
    }


def _series(names: tuple[str, ...] | list[str], colours: tuple[str, ...]) -> list[dict[str, str]]:
    return [{"name": name, "colour": colour} for name, colour in zip(names, cycle(colours), strict=False)]


def _chart(title: str, unit: str, values: Array, digits: int, series: list[dict[str, str]]) -> dict[str, Any]:
    curves = [rounded(column, digits) for column in values.T]
    return {"title": title, "unit": unit, "values": curves, "series": series}
