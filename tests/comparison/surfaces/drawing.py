"""Draws what inner edges do, and error against CPU time."""

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

COLOURS = {"rover-gym": "#d1361f", "Drake": "#2f6db3", "MuJoCo": "#3f8f4f", "Bullet": "#8a5fb0"}
#: The first variant of an engine is drawn with the first.
STYLES = ("-", "--")
#: What is smaller is drawn here: it is rounding.
LEAST_IMPULSE, LEAST_ERROR = 1e-6, 1e-5  # 1, m
#: Map over whose edges errors are drawn against costs.
SPACING = 0.05  # m


def _curves(axes: Axes, points: list[dict[str, Any]], x: str, y: str, least: float) -> None:
    """One curve an engine and variant, in logarithms."""
    variants: dict[str, list[str]] = {}
    for p in points:
        own = variants.setdefault(p["engine"], [])
        if p["variant"] not in own:
            own.append(p["variant"])
    for engine, names in variants.items():
        for name, style in zip(names, STYLES, strict=False):
            rows = [p for p in points if (p["engine"], p["variant"]) == (engine, name) and y in p]
            axes.plot(
                [p[x] for p in rows],
                [max(p[y], least) for p in rows],
                color=COLOURS[engine],
                linestyle=style,
                linewidth=2.4 if engine == "rover-gym" else 1.5,
                marker="o",
                markersize=4.5,
                label=f"{engine}, {name}",
            )
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(0.12)
    axes.grid(which="major", color="#dddddd", linewidth=0.7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def draw(data: dict[str, Any], path: Path) -> None:
    """Two rows of two panels and a common legend."""
    finest = min(p["step"] for p in data["points"])
    figure, panels = plt.subplots(2, 2, figsize=(11.0, 9.4), dpi=90)

    def scene(name: str) -> list[dict[str, Any]]:
        return [p for p in data["points"] if p["scene"] == name]

    axes = panels[0, 0]
    rows = [p for p in scene("edges") if p["step"] == finest and p["spacing"]]
    _curves(axes, rows, "spacing", "impulse", LEAST_IMPULSE)
    axes.set_title(f"ball over a flat map, steps of {1e3 * finest:g} ms", fontsize=11, loc="left")
    axes.set_xlabel("size of the cells, m")
    axes.set_ylabel(f"largest false impulse / (m g h) (rounding drawn at {LEAST_IMPULSE:g})")

    axes = panels[0, 1]
    rows = [p for p in scene("edges") if p["spacing"] == SPACING]
    _curves(axes, rows, "cpu_ms_per_s", "error", LEAST_ERROR)
    axes.set_title(f"ball over a flat map, cells of {SPACING:g} m", fontsize=11, loc="left")
    axes.set_xlabel("CPU time, ms per simulated second")
    axes.set_ylabel(f"RMS error of the path, m (rounding drawn at {LEAST_ERROR:g})")

    axes = panels[1, 0]
    _curves(axes, [p for p in scene("sine") if p["step"] == finest], "spacing", "from_sine", LEAST_ERROR)
    axes.set_title(f"ball on a sine given as a map, steps of {1e3 * finest:g} ms", fontsize=11, loc="left")
    axes.set_xlabel("size of the cells, m")
    axes.set_ylabel("RMS distance from the path on the sine, m")

    axes = panels[1, 1]
    _curves(axes, scene("hills"), "cpu_ms_per_s", "error", LEAST_ERROR)
    axes.set_title("rover over hills, 5, 2 and 1 ms", fontsize=11, loc="left")
    axes.set_xlabel("CPU time, ms per simulated second")
    axes.set_ylabel("median of the paths' RMS errors, m")

    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="lower center", ncols=4, frameon=False, fontsize=9.5)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    figure.savefig(path)
    plt.close(figure)
