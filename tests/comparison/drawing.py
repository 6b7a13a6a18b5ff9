"""Draws the chart: one large picture of the flat drive, one of the other scenes."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

COLOURS = {
    "rover-gym": "#d1361f",
    "Drake": "#2f6db3",
    "MuJoCo": "#3f8f4f",
    "Bullet": "#8a5fb0",
    "Pinocchio": "#b07a1e",
    "Siconos": "#5b6770",
}
STYLES = {"SAP, stiff": (0, (4, 2)), "defaults": (0, (1, 1.5))}
#: Errors below this are drawn here: they are rounding.
FLOOR = {"parked": 1e-12}


def _curves(data: dict[str, Any], scene: str, best: bool) -> list[tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray]]:
    out = []
    for engine in data["engines"]:
        if best and not engine["best"]:
            continue
        rows = [
            p
            for p in data["points"]
            if p["scene"] == scene
            and (p["engine"], p["variant"]) == (engine["engine"], engine["variant"])
            and "error" in p
        ]
        if rows:
            rows.sort(key=lambda p: p["step"])
            step, cost, error = (np.array([p[k] for p in rows]) for k in ("step", "cpu_ms_per_s", "error"))
            out.append((engine, step, cost, np.maximum(error, FLOOR.get(scene, 0.0))))
    return out


def _panel(axes: Axes, data: dict[str, Any], scene: str, *, labels: dict[str, Any], size: float) -> None:
    """One scene: curves, step sizes at ours, the Pareto front shaded."""
    curves = _curves(data, scene, best=True)
    everything = sorted((c, e) for _, _, cost, error in curves for c, e in zip(cost, error, strict=True))
    best = np.minimum.accumulate([e for _, e in everything])
    front = np.array([c for c, _ in everything])
    low = axes.get_ylim()[0]
    for engine, step, cost, error in curves:
        ours = engine["engine"] == "rover-gym"
        axes.plot(
            cost,
            error,
            color=COLOURS[engine["engine"]],
            linestyle=STYLES.get(engine["variant"], "-"),
            linewidth=2.6 if ours else 1.5,
            marker="o",
            markersize=6 if ours else 4,
            zorder=4 if ours else 3,
        )
        if ours:
            for h, x, y in zip(step, cost, error, strict=True):
                if scene != "flat_drive" and not np.isclose(h, [1e-3, 1e-2, 1e-1]).any():
                    continue
                axes.annotate(
                    f"{h * 1e3:g} ms", (x, y), (-6, -4), textcoords="offset points", ha="right", va="top",
                    fontsize=size - 2, color=COLOURS["rover-gym"],
                )
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    left, right = axes.get_xlim()
    axes.step(
        np.append(front, right), np.append(best, best[-1]), where="post", color="#d1361f", alpha=0.35, linewidth=5, zorder=1
    )
    axes.fill_between(np.append(front, right), low, np.append(best, best[-1]), step="post", color="#d1361f", alpha=0.05)
    axes.set_ylim(low, high)
    axes.set_xlim(left, right)
    for engine, _, cost, error in curves:
        key = engine["engine"] if engine["engine"] != "MuJoCo" and engine["engine"] != "Drake" else (
            f"{engine['engine']}, {engine['variant'].split(',')[0]}"
        )
        if key not in labels:
            continue
        index, offset, text = labels[key]
        index = min(index, len(cost) - 1) if index >= 0 else max(index, -len(cost))
        axes.annotate(
            text, (cost[index], error[index]), offset, textcoords="offset points", fontsize=size,
            color=COLOURS[engine["engine"]], fontweight="bold" if engine["engine"] == "rover-gym" else "normal",
        )
    axes.grid(which="major", color="#dddddd", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


#: Which point of a curve carries its label (sorted by step, finest first), where it stands from it (points), and what it says.
DRIVE_LABELS = {
    "rover-gym": (2, (8, 6), "rover-gym"),
    "Drake, lagged": (-1, (6, 6), "Drake, lagged"),
    "Drake, SAP": (-1, (6, 4), "Drake, SAP"),
    "MuJoCo, discrete": (0, (6, 2), "MuJoCo, best settings"),
    "MuJoCo, defaults": (0, (6, 4), "MuJoCo, defaults"),
    "Bullet": (-1, (6, 6), "Bullet"),
    "Pinocchio": (-1, (4, 8), "Pinocchio ADMM (Python loop)"),
    "Siconos": (0, (6, 0), "Siconos"),
}


def draw(data: dict[str, Any], folder: Path) -> list[Path]:
    """The two pictures of the chart."""
    mpl.rcParams.update({"font.family": "DejaVu Sans", "svg.hashsalt": "chart"})
    pictures = []
    figure, axes = plt.subplots(figsize=(8.0, 5.6), dpi=140)
    _panel(axes, data, "flat_drive", labels=DRIVE_LABELS, size=10)
    axes.axhline(0.01, color="#888888", linewidth=0.8, linestyle=(0, (2, 3)), zorder=0)
    axes.set_xlabel("CPU time, ms per simulated second (one thread)")
    axes.set_ylabel("RMS error of the path, m")
    axes.set_title(
        "Driving 22 m in a curve: error against cost, one point per step size from 0.1 to 100 ms", fontsize=10.5, loc="left"
    )
    figure.tight_layout()
    pictures.append(folder / "flat_drive.png")
    figure.savefig(pictures[-1])
    plt.close(figure)

    others = [name for name in data["scenes"] if name != "flat_drive" and _curves(data, name, best=True)]
    if others:
        figure, panels = plt.subplots(1, len(others), figsize=(4.6 * len(others), 4.6), dpi=110, squeeze=False)
        for axes, name in zip(panels[0], others, strict=True):
            scene = data["scenes"][name]
            _panel(axes, data, name, labels={}, size=9)
            axes.set_title(scene["title"], fontsize=10.5, loc="left")
            axes.set_xlabel("CPU time, ms per simulated second")
            axes.set_ylabel(f"{scene['error']}, {scene['unit']}")
        lines = [
            plt.Line2D([], [], color=COLOURS[e["engine"]], linestyle=STYLES.get(e["variant"], "-"), marker="o",
                       linewidth=2.6 if e["engine"] == "rover-gym" else 1.5,
                       label=e["engine"] if e["engine"] == "rover-gym" else f"{e['engine']}: {e['variant']}")
            for e in data["engines"] if e["best"]
        ]
        figure.legend(handles=lines, loc="lower center", ncols=4, frameon=False, fontsize=9)
        figure.tight_layout(rect=(0, 0.09, 1, 1))
        pictures.append(folder / "scenes.png")
        figure.savefig(pictures[-1])
        plt.close(figure)
    return pictures
