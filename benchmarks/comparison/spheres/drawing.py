"""Draws error against CPU time, one panel a scene."""

from pathlib import Path
from typing import Any

from comparison.curves import finish, label, plot, plt, save
from comparison.spheres.tables import ERRORS

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
        axes.loglog()
        error = ERRORS[scene]
        points = [p for p in data["points"] if p["scene"] == scene and error.key in p]
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in points):
            curve = [p for p in points if (p["engine"], p["variant"]) == (engine, variant)]
            is_only = len({p["variant"] for p in points if p["engine"] == engine}) == 1
            least = FLOOR if scene == "666" else 0.0
            costs = [(p["cpu_ms_per_s"], max(p[error.key], least)) for p in curve]
            line = "-" if is_only else STYLES.get(variant, "-")
            plot(axes, costs, engine, linestyle=line, label=f"{engine}, {variant}")
        axes.margins(0.12)
        rounding = f" (rounding drawn at {FLOOR:g})" if scene == "666" else ""
        label(axes, scene, "CPU time, ms per simulated second", error.label + rounding)
        finish(axes)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * (high / low) ** 0.4)  # room for the legend
        axes.legend(fontsize=8, frameon=False, loc="upper right", ncols=2)
    save(figure, path)
