"""Draws error against CPU time, one panel a scene."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

from comparison.spheres.tables import ERRORS

mpl.use("Agg")
from matplotlib import pyplot as plt

COLOURS = {"rover-gym": "#d1361f", "Drake": "#2f6db3", "MuJoCo": "#3f8f4f", "Bullet": "#8a5fb0"}
STYLES = {
    "projection to convergence": "-",
    "projection": "--",
    "velocity level": ":",
    "defaults": "--",
    "SAP": "--",
}
#: Of rolling one direction stands for three.
PANELS = ("666", "elastic 666", "bouncing", "rolling, diagonal")

#: Penetrations below this are drawn here, m²: they are rounding.
FLOOR = 1e-17


def draw(data: dict[str, Any], path: Path) -> None:
    """Two rows of two panels."""
    figure, panels = plt.subplots(2, 2, figsize=(11.0, 9.0), dpi=90)
    for axes, scene in zip(panels.flat, PANELS, strict=True):
        error = ERRORS[scene]
        points = [p for p in data["points"] if p["scene"] == scene and error.key in p]
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in points):
            curve = [p for p in points if (p["engine"], p["variant"]) == (engine, variant)]
            is_only = len({p["variant"] for p in points if p["engine"] == engine}) == 1
            axes.plot(
                [p["cpu_ms_per_s"] for p in curve],
                [max(p[error.key], FLOOR if scene == "666" else 0.0) for p in curve],
                color=COLOURS[engine],
                linestyle="-" if is_only else STYLES.get(variant, "-"),
                linewidth=2.4 if engine == "rover-gym" else 1.5,
                marker="o",
                markersize=4.5,
                label=f"{engine}, {variant}",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(0.12)
        axes.set_title(scene, fontsize=11, loc="left")
        axes.set_xlabel("CPU time, ms per simulated second")
        axes.set_ylabel(error.label + (f" (rounding drawn at {FLOOR:g})" if scene == "666" else ""))
        axes.grid(which="major", color="#dddddd", linewidth=0.7)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * (high / low) ** 0.4)  # room for the legend
        axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)
