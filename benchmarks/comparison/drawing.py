"""Draws the chart: one large picture of the flat drive, one of the other scenes, one of our own variants."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from comparison.curves import COLOURS, OURS, finish, label, plt, save, style
from comparison.tables import rows_of

Array = npt.NDArray[np.float64]
Curve = tuple[dict[str, Any], Array, Array, Array]

#: Of our variants in the picture of ours.
OWN_COLOURS = ("#d1361f", "#e8a33d", "#7a4fa3", "#2b7a78")
STYLES = {"SAP, stiff": (0, (4, 2)), "defaults": (0, (1, 1.5))}
#: Errors below this are drawn here: they are rounding.
FLOOR = {"parked": 1e-12}
#: The goal for the flat drive: ms per simulated second, m.
GOAL = (1.0, 0.01)


def curves(data: dict[str, Any], scene: str) -> list[Curve]:
    """Variant, steps, costs (ms per simulated second) and errors of every curve of a scene."""
    out = []
    for engine in data["engines"]:
        if rows := rows_of(data, scene, engine["engine"], engine["variant"])[::-1]:
            step, cost, error = (np.array([p[k] for p in rows]) for k in ("step", "cpu_ms_per_s", "error"))
            out.append((engine, step, cost, np.maximum(error, FLOOR.get(scene, 0.0))))
    return out


def pareto(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """(cost, error) pairs that no other pair beats in both, by rising cost."""
    front: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if np.isfinite(error) and (not front or error < front[-1][1]):
            front.append((cost, error))
    return front


def _shade(axes: Axes, shown: list[Curve]) -> None:
    """Below the Pareto front: what nothing here reaches."""
    front = np.array(pareto([(c, e) for _, _, cost, error in shown for c, e in zip(cost, error, strict=True)]))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    cost = np.concatenate([[left, front[0, 0]], front[:, 0], [right]])
    error = np.concatenate([[high, high], front[:, 1], [front[-1, 1]]])
    axes.fill_between(cost, low, error, color="#f3e3d3", alpha=0.6, linewidth=0, zorder=0)
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)


def _finish(axes: Axes) -> None:
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    finish(axes)


def _steps(axes: Axes, curve: Curve, wanted: tuple[float, ...], size: float) -> None:
    """Writes step sizes beside points of our curve."""
    _, step, cost, error = curve
    for h, x, y in zip(step, cost, error, strict=True):
        if np.isclose(h, wanted).any():
            place = {"textcoords": "offset points", "ha": "right", "va": "top"}
            axes.annotate(f"{h * 1e3:g} ms", (x, y), (-7, -5), fontsize=size, color=COLOURS[OURS], **place)


def _plot(axes: Axes, shown: list[Curve]) -> None:
    axes.margins(0.1)
    for engine, _, cost, error in shown:
        own = {"linewidth": 2.6, "markersize": 6, "zorder": 4} if engine["engine"] == OURS else {"markersize": 4}
        linestyle = STYLES.get(engine["variant"], "-")
        axes.loglog(cost, error, **style(engine["engine"], linestyle=linestyle, **({"zorder": 3} | own)))


#: Text of a curve's label.
LABELS = {
    (OURS, "linearised"): OURS,
    ("Drake", "lagged, stiff"): "Drake, lagged",
    ("Drake", "SAP, stiff"): "Drake, SAP",
    ("MuJoCo", "discrete, elliptic"): "MuJoCo, best",
    ("MuJoCo", "defaults"): "MuJoCo, defaults",
    ("Bullet", "50 iterations"): "Bullet",
    ("Pinocchio", "ADMM in a Python loop"): "Pinocchio, ADMM\n(Python loop)",
    ("Siconos", "NSGS in a Python loop"): "Siconos\n(Python loop)",
}
LINE = 0.055  # height of a line of a label, of the axes


def _names(axes: Axes, shown: list[Curve]) -> None:
    """Names the curves at the right edge, in the order of their ends and one below the other, each with a thin line."""
    low, high = np.log(axes.get_ylim())
    ends = []
    for engine, _, cost, error in shown:
        k = int(np.argmax(cost))
        height = (np.log(error[k]) - low) / (high - low)
        ends.append((height, (cost[k], error[k]), LABELS[engine["engine"], engine["variant"]], engine["engine"]))
    top = 1.0
    for height, end, text, engine in sorted(ends, reverse=True, key=lambda one: one[0]):
        half = 0.5 * LINE * (1 + text.count("\n"))
        middle = min(height, top - half)
        top = middle - half
        axes.annotate(
            text,
            end,
            (1.02, middle),
            xycoords="data",
            textcoords="axes fraction",
            ha="left",
            va="center",
            fontsize=10.0,
            color=COLOURS[engine],
            fontweight="bold" if engine == OURS else "normal",
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": COLOURS[engine], "linewidth": 0.6, "alpha": 0.6, "shrinkB": 4.0},
        )


def flat_drive(data: dict[str, Any], path: Path) -> Path:
    """The picture of the README."""
    figure, axes = plt.subplots(figsize=(8.0, 5.6), dpi=125)
    fill_flat_drive(axes, data)
    return save(figure, path)


def fill_flat_drive(axes: Axes, data: dict[str, Any]) -> None:
    """Error of the flat drive against its cost, every engine at its best."""
    shown = [c for c in curves(data, "flat_drive") if c[0]["best"]]
    _plot(axes, shown)
    left, right = axes.get_xlim()
    axes.set_xlim(0.5 * left, right)  # room for the step sizes
    _shade(axes, shown)
    _names(axes, shown)
    for curve in shown:
        if curve[0]["engine"] == OURS:
            _steps(axes, curve, (1e-1, 2e-2, 5e-3, 1e-3, 1e-4), 9)
    axes.axhline(GOAL[1], color="#999999", linewidth=0.9, linestyle=(0, (2, 3)), zorder=1)
    above = {"textcoords": "offset points", "ha": "left", "fontsize": 9}
    axes.annotate("1 cm", (3.0 * GOAL[0], GOAL[1]), (0, 3), color="#777777", **above)
    beyond = {"transform": axes.transAxes, "fontsize": 9, "color": "#a98d6d", "style": "italic"}
    axes.text(0.02, 0.03, "reached by nothing here", **beyond)
    axes.set_xlabel("CPU time of one thread, ms per simulated second", fontsize=10.5)
    axes.set_ylabel("error of the path (RMS), m", fontsize=10.5)
    axes.set_title("A drive of 22 m in a curve, one point per step size, 0.1 to 100 ms", fontsize=11.5, loc="left")
    _finish(axes)


def _row(data: dict[str, Any], without: str, height: float) -> tuple[Any, list[tuple[Axes, str]]]:
    """A figure with a panel for each scene but one, by its name."""
    names = [name for name in data["scenes"] if name != without and curves(data, name)]
    figure, panels = plt.subplots(1, len(names), figsize=(4.4 * len(names), height), dpi=100, squeeze=False)
    return figure, list(zip(panels[0], names, strict=True))


def others(data: dict[str, Any], path: Path) -> Path:
    """Rug, rocks and parking, with a common legend."""
    figure, panels = _row(data, "flat_drive", 4.7)
    for axes, name in panels:
        scene = data["scenes"][name]
        shown = [c for c in curves(data, name) if c[0]["best"]]
        _plot(axes, shown)
        _shade(axes, shown)
        for curve in shown:
            if curve[0]["engine"] == OURS:
                _steps(axes, curve, (2e-2, 5e-3, 1e-3), 8.5)
        label(axes, scene["title"], "CPU time, ms per simulated second", f"{scene['error']}, {scene['unit']}")
        _finish(axes)
    lines = []
    for e in (e for e in data["engines"] if e["best"]):
        name = OURS if e["engine"] == OURS else f"{e['engine']}: {e['variant']}"
        own = style(e["engine"], linestyle=STYLES.get(e["variant"], "-"), markersize=mpl.rcParams["lines.markersize"])
        lines.append(plt.Line2D([], [], label=name, **(own | ({"linewidth": 2.6} if e["engine"] == OURS else {}))))
    figure.legend(handles=lines, loc="lower center", ncols=4, frameon=False, fontsize=9.5)
    return save(figure, path, rect=(0, 0.11, 1, 1))


def variants(data: dict[str, Any], path: Path) -> Path:
    """Our own variants and tolerances."""
    figure, panels = _row(data, "parked", 4.5)
    for axes, name in panels:
        own = [c for c in curves(data, name) if c[0]["engine"] == OURS]
        for (engine, _, cost, error), colour in zip(own, OWN_COLOURS, strict=True):
            axes.loglog(cost, error, **style(OURS, color=colour, linewidth=1.6, label=engine["variant"]))
        label(axes, data["scenes"][name]["title"], "CPU time, ms per simulated second", "RMS error of the path, m")
        _finish(axes)
    handles = panels[0][0].get_legend_handles_labels()
    figure.legend(*handles, loc="lower center", ncols=4, frameon=False, fontsize=9.5)
    return save(figure, path, rect=(0, 0.07, 1, 1))


def draw(data: dict[str, Any], folder: Path) -> list[Path]:
    """All pictures of the chart."""
    mpl.rcParams.update({"font.family": "DejaVu Sans"})
    return [
        flat_drive(data, folder / "flat_drive.png"),
        others(data, folder / "scenes.png"),
        variants(data, folder / "variants.png"),
    ]
