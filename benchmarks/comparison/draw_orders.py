"""Draws the curves that `make orders` measured: error against step for every time-stepping scheme.

Run: `python benchmarks/comparison/draw_orders.py runs/orders.json docs/comparison/orders.png`.
"""

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

SCENES = {
    "flight": ("Two-wheel rover in flight", "error of coordinates (m, rad)"),
    "rolling": ("Ball rolling in a valley (stick)", "error of coordinates (m, rad)"),
    "sliding": ("Ball sliding in a valley (slip)", "error of coordinates (m, rad)"),
    "driving": ("Two-wheel rover driving on a sine", "error of coordinates (m, rad)"),
    "impacts": ("Bouncing ball, e = 0.8, 16 heights", "mean error of velocity (m/s)"),
    "drift": ("Largest |gap| while driving on the sine", "gap (m)"),
}
FLOOR = 1e-14  # what is below is rounding


def draw(measured: dict[str, Any], target: Path) -> None:
    """Draws one panel a scene.

    Args:
        measured: the JSON of the `orders` command.
        target: PNG to write.
    """
    figure, axes = plt.subplots(2, 3, figsize=(11.0, 7.4), sharex=False)
    markers = "os^Dv<>P"
    for axis, (key, (title, unit)) in zip(axes.flat, SCENES.items(), strict=True):
        steps: list[float] = []
        for i, scheme in enumerate(measured["schemes"]):
            curve = scheme[key]
            points = [
                (h * 1e3, max(e, FLOOR)) for h, e in zip(curve["h"], curve["error"], strict=True) if e is not None
            ]
            steps += [h * 1e3 for h in curve["h"]]
            if points:
                axis.loglog(
                    *zip(*points, strict=True),
                    marker=markers[i],
                    markersize=4.5,
                    linewidth=1.2,
                    linestyle="-" if i % 2 == 0 else "--",  # some lie on each other
                    color=f"C{i}",
                    label=scheme["name"],
                )
        # Slopes to compare with, in the middle of the panel where the reference leaves room.
        high = max(steps)
        low = high / 8
        bottom, top = axis.get_ylim()
        level = (bottom**0.45) * (top**0.55)
        for order in (1, 2):
            start = level * (low / high) ** order
            axis.loglog([low, high], [start, level], color="0.5", linewidth=0.9, linestyle=":")
            axis.annotate(f"{order}", (low, start), color="0.4", fontsize=8, ha="right", va="center")
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("step (ms)")
        axis.set_ylabel(unit)
        ticks = [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 40) if min(steps) * 0.9 <= t <= high * 1.1]
        axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axis.minorticks_off()
        axis.grid(visible=True, which="major", color="0.9")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, fontsize=8.5, frameon=False)
    figure.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
    figure.savefig(target, dpi=110)


def main() -> None:
    """Reads the first argument, writes the second."""
    source, target = Path(sys.argv[1]), Path(sys.argv[2])
    target.parent.mkdir(parents=True, exist_ok=True)
    draw(json.loads(source.read_text(encoding="utf-8")), target)


if __name__ == "__main__":
    main()
