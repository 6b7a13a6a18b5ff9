"""Shared style of the figures: wheels, their colours, type sizes, and drawing helpers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.record.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from rover_gym.record.rover_run import RoverRun

    #: A figure or part of a page.
    Sheet: TypeAlias = Figure | SubFigure

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
# Okabe and Ito's palette, safe for colour-blind readers.
COLOURS = {"FL": "#0072B2", "FR": "#56B4E9", "ML": "#009E73", "BL": "#D55E00", "MR": "#CC79A7", "BR": "#E69F00"}
#: Colours for everything but wheels (Paul Tol's "muted" palette, safe for colour-blind readers).
QUANTITY_COLOURS = ("#332288", "#CC6677", "#117733", "#882255", "#999933")
DARK = "0.25"
#: Of nested lines: front, middle and back wheels, points.
NESTED_WIDTHS = {"F": 0.8, "M": 1.6, "B": 2.6}
#: Width of a figure, inches. Shown 800 pixels wide, as a README does, type of 10 points is 12 pixels high.
WIDTH = 9.0
STYLE: dict[str, Any] = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "axes.xmargin": 0.01,
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "figure.titlesize": "large",
    "font.size": 10.0,
    "grid.alpha": 0.3,
    "legend.fontsize": 9.0,
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "rover-gym",  # identical figures give identical files
}


def plain(text: str) -> str:
    """Escapes dollar signs in a file's text, so that they start no formula."""
    return text.replace("$", r"\$")


def title(figure: Sheet, what: str, run: RoverRun) -> None:
    """Titles a figure with its subject and its run."""
    broken_off = "" if run.trajectory.attributes.get("complete", True) else " (the recording was broken off)"
    figure.suptitle(f"{what}\n{plain(run.title)}{broken_off}")


def panel_legend(axes: Axes, columns: int = 4) -> None:
    """The legend of one panel, in a row above it, where it covers no curve."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, borderaxespad=0.1)


def circle(axes: Axes, x: float, y: float, radius: float, color: str) -> None:
    """Draws the outline of a circle."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=color, linewidth=0.8)


def close_up(axes: Axes, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], margin: float) -> None:
    """Limits the view to the traces plus a margin (m), with equal scales."""
    axes.set_xlim(x.min() - margin, x.max() + margin)
    axes.set_ylim(y.min() - margin, y.max() + margin)
    axes.set_aspect("equal", adjustable="box")


def step_size(trajectory: Trajectory) -> str:
    """The time step of the run, as text."""
    return f"{1e3 * trajectory.attributes['solver']['time_step']:g} ms"
