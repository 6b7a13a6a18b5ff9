"""Pictures of the laboratory's parts of the validation."""

from pathlib import Path
from typing import Any

from matplotlib.ticker import NullFormatter

from validation.drawing import OTHER, OURS, PAPER, finish, plt
from validation.wheel_on_balls import measurements


def wheel_on_balls(data: dict[str, Any], path: Path) -> None:
    """Pull, lateral force and sinkage against slip beside the measurements."""
    figure, panels = plt.subplots(1, 3, figsize=(11.4, 4.0), dpi=110, layout="constrained")
    names = (("pull", "pull, N", 1.0), ("lateral", "lateral force, N", 1.0), ("sinkage", "sinkage, mm", 1e3))
    runs, sand = sorted(data["runs"], key=lambda run: run["radius"]), measurements()
    for column, (axes, (name, label, factor)) in enumerate(zip(panels, names, strict=True)):
        for degrees, style in ((0, "-"), (45, "--")):
            rows = [i for i, point in enumerate(runs[0]["points"]) if point["degrees"] == degrees]
            slips = [runs[0]["points"][i]["slip"] for i in rows]
            if sand:
                measured = [factor * sand[i][column] for i in rows]
                axes.plot(slips, measured, style, color=PAPER, marker="o", label=f"sand, {degrees}° slip angle")
            for run, colour in zip(runs, (OURS, OTHER), strict=False):
                values = [factor * run["points"][i][name] for i in rows]
                errors = [factor * run["points"][i][f"{name}_error"] for i in rows]
                balls = f"balls of {1e3 * run['radius']:g} mm, {degrees}°"
                axes.errorbar(slips, values, errors, ls=style, color=colour, marker="s", ms=4, capsize=2, label=balls)
        axes.set(xlabel="slip", ylabel=label)
        finish(axes)
    panels[-1].set_ylim(bottom=0.0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncol=3, frameon=False)
    figure.savefig(path)
    plt.close(figure)


def plate_on_balls(data: dict[str, Any], path: Path) -> None:
    """Pressure under a plate on beds of one size, with the spread of single beds, against CPU time."""
    figure, axes = plt.subplots(figsize=(6.4, 4.2), dpi=110, layout="constrained")
    rows = data["means"]
    seconds = [row["plate_cpu_seconds"] for row in rows]
    pressures, spreads = ([1e-3 * row[name] for row in rows] for name in ("pressure", "pressure_spread"))
    axes.errorbar(seconds, pressures, spreads, fmt="o-", color=OURS, capsize=3)
    for row, x, y in zip(rows, seconds, pressures, strict=True):
        text = f"{row['count']} balls of {1e3 * row['radius']:g} mm"
        axes.annotate(text, (x, y), (6, 8), textcoords="offset points", fontsize=9)
    axes.set(xscale="log", xlabel="CPU time of one plate test, s", ylabel="pressure 15 mm below first contact, kPa")
    ticks = [1, 2, 5, 10, 20, 50, 100]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(0.6 * min(seconds), 3.0 * max(seconds))
    axes.set_ylim(bottom=0.0)
    finish(axes)
    figure.savefig(path)
    plt.close(figure)


PICTURES = {"wheel_on_balls": wheel_on_balls, "plate_on_balls": plate_on_balls}
