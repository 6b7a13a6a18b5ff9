"""The figure of any planar run: path over the ground, speed, gaps and energy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.figures.saving import save_figures
from rover_gym.figures.style import circle, plain
from rover_gym.mechanics import PlanarSimulation, Polyline
from rover_gym.record.trajectory import Trajectory, read_trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS, GROUND, FRICTION = "#0072B2", "#8c6d46", "#D55E00"


def draw_planar_run(sim: PlanarSimulation, recording: str | Path, path: str | Path) -> Path:
    """Draws a recorded planar run: the machine's path over its ground, and speed, gaps, loads and energy against time.

    Args:
        sim: A simulation on the same ground.
        recording: What `record` wrote.
        path: PNG file to write.

    Raises:
        MissingExtraError: matplotlib or h5py is not installed.
    """
    trajectory = read_trajectory(recording)
    path = Path(path)
    return save_figures({path.stem: lambda figure: _run(figure, sim, trajectory)}, path.parent)[0]


def speed_of(trajectory: Trajectory) -> npt.NDArray[np.float64]:
    """Speed of the centre of the run's first body, (n,), m/s."""
    return np.linalg.norm(trajectory["v"][:, :2], axis=1)  # type: ignore[no-any-return]


def _run(figure: Figure, sim: PlanarSimulation, trajectory: Trajectory) -> None:
    grid = figure.add_gridspec(2, 3)
    way = figure.add_subplot(grid[0, :])
    speed, gaps, energy = (figure.add_subplot(grid[1, k]) for k in range(3))
    centres, time = trajectory["centres"], trajectory["time"]
    machine = sim.parameters
    radii = np.atleast_1d(machine["radius"] if "radius" in machine else machine["wheel_radius"])
    low, high = centres[:, :, 0].min() - 2.0 * radii.max(), centres[:, :, 0].max() + 2.0 * radii.max()
    x = np.linspace(low, high, 2000)
    if isinstance(sim.ground, Polyline):
        x = np.sort(np.concatenate((x, sim.ground.x - 1e-9, sim.ground.x)))
    way.plot(x, sim.ground.height(x), color=GROUND)
    colours = (OURS, FRICTION)
    names = ("ball",) if len(radii) == 1 else ("wheel A (back)", "wheel B (front)")
    for i, (name, colour) in enumerate(zip(names, colours, strict=False)):
        way.plot(*centres[:, i].T, color=colour, linewidth=0.8, label=f"centre of {name}")
        gaps.plot(time, 1e3 * trajectory["gaps"][:, i], color=colour, label=name)
    for row in np.linspace(0, len(time) - 1, 6).astype(int):
        for i, radius in enumerate(radii):
            circle(way, centres[row, i, 0], centres[row, i, 1], radius, color=colours[i])
        if len(radii) > 1:
            way.plot(*centres[row].T, color="0.3", linewidth=2.0)
    way.set(xlabel="x (m)", ylabel="y (m)", title=f"{plain(str(trajectory.attributes['title']))}, {time[-1]:g} s")
    way.set_aspect("equal", adjustable="datalim")
    way.legend(loc="upper right")
    speed.plot(time, speed_of(trajectory), color=OURS)
    speed.set(xlabel="time (s)", ylabel="speed (m/s)")
    gaps.set(xlabel="time (s)", ylabel="gap (mm)")
    gaps.legend()
    kinetic, potential = trajectory["kinetic_energy"], trajectory["potential_energy"]
    potential = potential - potential.min()
    for values, label, colour in (
        (kinetic, "kinetic", OURS),
        (potential, "potential, from its lowest", FRICTION),
        (kinetic + potential, "sum", "0.2"),
    ):
        energy.plot(time, values, color=colour, label=label)
    energy.set(xlabel="time (s)", ylabel="energy (J)")
    energy.legend()
