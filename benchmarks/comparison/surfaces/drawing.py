"""Draws what inner edges do, and error against CPU time."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, NullLocator

from comparison.curves import finish, label, plot, plt, save

#: The first variant of an engine is drawn with the first.
STYLES = ("-", "--")
#: What is smaller is drawn here: it is rounding.
LEAST_IMPULSE, LEAST_ERROR = 1e-6, 1e-7  # 1, m
#: Map over whose edges errors are drawn against costs.
SPACING = 0.05  # m


def _curves(axes: Axes, points: list[dict[str, Any]], x: str, y: str, least: float) -> None:
    """One curve an engine and variant, in logarithms."""
    axes.loglog()
    variants: dict[str, list[str]] = {}
    for p in points:
        own = variants.setdefault(p["engine"], [])
        if p["variant"] not in own:
            own.append(p["variant"])
    for engine, names in variants.items():
        for name, style in zip(names, STYLES, strict=False):
            rows = [p for p in points if (p["engine"], p["variant"]) == (engine, name) and y in p]
            curve = [(p[x], max(p[y], least)) for p in rows]
            plot(axes, curve, engine, linestyle=style, label=f"{engine}, {name}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    if x == "spacing":
        sizes = sorted({p[x] for p in points})
        axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axes.xaxis.set_minor_locator(NullLocator())
    if any(p.get(y, least) < least for p in points):
        corner = {"xycoords": "axes fraction", "ha": "right", "color": "#777777", "fontsize": 9}
        axes.annotate("bottom: 0 to rounding", (0.98, 0.02), **corner)
    axes.margins(0.12)
    finish(axes)


def draw(data: dict[str, Any], path: Path) -> None:
    """Two rows of three panels and a common legend."""
    finest = min(p["step"] for p in data["points"])
    at_finest, cost = f"steps of {1e3 * finest:g} ms", "CPU time, ms per simulated second"
    figure, panels = plt.subplots(2, 3, figsize=(15.0, 9.4), dpi=80)

    def scene(name: str, **fixed: float) -> list[dict[str, Any]]:
        own = [p for p in data["points"] if p["scene"] == name and p.get("spacing", 1.0)]
        return [p for p in own if all(p[key] == value for key, value in fixed.items())]

    cells = "size of the cells, m"
    _curves(panels[0, 0], scene("edges", step=finest), "spacing", "impulse", LEAST_IMPULSE)
    label(panels[0, 0], f"ball over a flat map, {at_finest}", cells, "largest false impulse / (m g h)")
    _curves(panels[0, 1], scene("edges", spacing=SPACING), "cpu_ms_per_s", "error", LEAST_ERROR)
    label(panels[0, 1], f"ball over a flat map, cells of {SPACING:g} m", cost, "RMS error of the path, m")
    _curves(panels[0, 2], scene("rest", step=finest), "spacing", "error", LEAST_ERROR)
    label(panels[0, 2], f"box at rest on a flat map, {at_finest}", cells, "largest way of its centre, m")
    _curves(panels[1, 0], scene("sine", step=finest), "spacing", "from_sine", LEAST_ERROR)
    label(panels[1, 0], f"ball on a sine as a map, {at_finest}", cells, "RMS distance from the path on the sine, m")
    panels[1, 0].set_ylim(1e-2, 1.0)
    _curves(panels[1, 1], scene("level", spacing=SPACING), "cpu_ms_per_s", "error", LEAST_ERROR)
    title = f"rover over a flat map, cells of {SPACING:g} m"
    label(panels[1, 1], title, cost, "RMS distance from the own plane's path, m")
    _curves(panels[1, 2], scene("hills"), "cpu_ms_per_s", "error", LEAST_ERROR)
    label(panels[1, 2], "rover over hills, cells of 0.25 m", cost, "median of the paths' RMS errors, m")

    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="lower center", ncols=4, frameon=False, fontsize=10)
    save(figure, path, rect=(0, 0.06, 1, 1))
