"""The curves beside a page of balls: loads and sinkage of the wheels, energy, contacts and overlap."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.replay.page import WHEEL_COLOURS
from rover_gym.replay.panel import Chart, load_chart, panel_contents

if TYPE_CHECKING:
    from rover_gym.grains.grain_run import GrainRun

COLOURS = ("#332288", "#CC6677")


def grain_curves(run: GrainRun) -> dict[str, Any]:
    """Contents of the panel."""
    data = run.trajectory
    charts: list[Chart] = []
    if run.model is not None:
        wheels = list(zip(run.model.wheel_names, cycle(WHEEL_COLOURS), strict=False))
        charts += [
            load_chart("wheel load", run.time, run.wheel_forces[..., 1], 1, wheels),
            Chart("sinkage", "mm", 1e3 * run.sinkage, 2, wheels),
        ]
    potential = data["potential_energy"] - data["potential_energy"][0]
    energy = np.stack((data["kinetic_energy"], potential), axis=1)
    overlap = 100.0 * data["penetration"] / float(run.radius.min())
    parts = list(zip(("kinetic", "potential, from the start"), COLOURS, strict=True))
    charts += [
        Chart("energy", "J", energy, 4, parts),
        Chart("contacts", "1", data["n_contacts"][:, None], 0, [("contacts", COLOURS[0])]),
        Chart("deepest overlap", "% of a radius", overlap[:, None], 4, [("overlap", COLOURS[0])]),
    ]
    return panel_contents(run.title, run.time, charts)
