"""How curves of engines are drawn, and how a picture is finished and kept."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

OURS = "rover-gym"
COLOURS = {
    OURS: "#d1361f",
    "Drake": "#2f6db3",
    "MuJoCo": "#3f8f4f",
    "Bullet": "#8a5fb0",
    "Pinocchio": "#b07a1e",
    "Siconos": "#5b6770",
}


def style(engine: str, **more: Any) -> dict[str, Any]:
    """Of an engine's curve: ours is thicker."""
    width = 2.4 if engine == OURS else 1.5
    return {"color": COLOURS[engine], "linewidth": width, "marker": "o", "markersize": 4.5} | more


def plot(axes: Axes, points: Iterable[tuple[float, float]], engine: str, **more: Any) -> None:
    """Draws a curve of an engine in logarithms."""
    axes.loglog(*zip(*points, strict=True), **style(engine, **more))


def finish(axes: Axes) -> None:
    """A faint grid, and no frame above and to the right."""
    axes.grid(which="major", color="#dddddd", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def label(axes: Axes, title: str, x: str, y: str) -> None:
    """Names a panel and its axes."""
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def save(figure: Figure, path: Path, **layout: Any) -> Path:
    """Arranges and writes a picture."""
    figure.tight_layout(**layout)
    figure.savefig(path)
    plt.close(figure)
    return path
