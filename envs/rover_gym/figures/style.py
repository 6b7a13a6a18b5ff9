"""What every figure shares: the wheels, their colours, sizes of type, and a few strokes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.recording import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WHEELS = ("FL", "FR", "ML", "BL", "MR", "BR")
NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "BL": "back left",
    "MR": "middle right",
    "BR": "back right",
}
SIDES = (("FL", "ML", "BL"), ("FR", "MR", "BR"))
# Okabe and Ito's colours, told apart by colour-blind readers too.
COLOURS = {"FL": "#0072B2", "FR": "#56B4E9", "ML": "#009E73", "BL": "#D55E00", "MR": "#CC79A7", "BR": "#E69F00"}
SIZE = (11.0, 5.0)  # inches
STYLE: dict[str, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "grid.alpha": 0.3,
    "legend.fontsize": "small",
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.2,
}


def circle(axes: Axes, x: float, y: float, radius: float, color: str) -> None:
    """Draws a circle's line."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=color, linewidth=0.8)


def close_up(axes: Axes, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], margin: float) -> None:
    """Shows the traces with a margin (m), at one scale; what lies beyond is cut."""
    axes.set_xlim(x.min() - margin, x.max() + margin)
    axes.set_ylim(y.min() - margin, y.max() + margin)
    axes.set_aspect("equal", adjustable="box")


def plot_wheels(axes: Axes, time: Any, values: Any, wheels: tuple[str, ...] = WHEELS) -> None:
    """One line a wheel, in its colour: values (n, 6) over time (n,), s."""
    for wheel in wheels:
        i = WHEELS.index(wheel)
        axes.plot(time, values[:, i], color=COLOURS[wheel], label=NAMES[wheel])


def step_size(trajectory: Trajectory) -> str:
    """The time step of the run, as text."""
    return f"{1e3 * trajectory.attributes['solver']['time_step']:g} ms"
