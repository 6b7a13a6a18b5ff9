"""Pictures of the validation."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter, ScalarFormatter

OURS, PAPER, OTHER = "#d1361f", "#2f6db3", "#5b6770"


def finish(axes: Axes) -> None:
    axes.grid(which="major", color="#dddddd", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def collapse(data: dict[str, Any], path: Path) -> None:
    """Run-out against aspect ratio, both logarithmic; and against the size of the disks, at one aspect ratio."""
    figure, (axes, sizes) = plt.subplots(1, 2, figsize=(10.4, 4.6), dpi=110, width_ratios=(1.5, 1.0))
    low, high = np.array([0.4, 2.0]), np.array([2.0, 10.0])
    axes.plot(low, 2.5 * low, color=PAPER, label="Staron and Hinch 2005: 2.5 a, 3.25 a$^{0.7}$")
    axes.plot(high, 3.25 * high**0.7, color=PAPER)
    for fit, span in zip(data["fits"], (low, high), strict=True):
        label = f"{fit['prefactor']:.2f} a$^{{{fit['exponent']:.2f}}}$"
        axes.plot(span, fit["prefactor"] * span ** fit["exponent"], "--", color=OURS, linewidth=1.2, label=label)
    series = (
        ("flat", "o", OURS, f"{data['flat'][0]['count']} disks, flat floor"),
        ("rough", "s", OTHER, f"floor of glued disks, {data['rough'][0]['count']} disks"),
        ("bouncing", "^", "#3f8f4f", f"restitution 0.5, {data['bouncing'][0]['count']} disks"),
    )
    for name, marker, colour, label in series:
        runs = data[name]
        axes.plot(
            [r["aspect"] for r in runs], [r["run_out"] for r in runs], marker, color=colour, markersize=5, label=label
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.5, 1, 2, 4, 8])
    axes.set_yticks([1, 2, 5, 10])
    axes.set_xlabel("aspect ratio a = H$_0$/R$_0$")
    axes.set_ylabel("run-out (R - R$_0$)/R$_0$")
    axes.legend(frameon=False, fontsize=8.5)
    finish(axes)
    limit = data["limit"]
    inverse = np.array([0.0, 0.1])
    line = f"{limit['value']:.2f} ± {limit['error']:.2f} at 0"
    sizes.plot(inverse, limit["value"] + limit["slope"] * inverse, "--", color=OURS, linewidth=1.2, label=line)
    for run in limit["runs"]:
        sizes.plot(1.0 / run["half_width"], run["run_out"] / run["aspect"], "o", color=OURS, markersize=5)
    sizes.axhline(2.5, color=PAPER, label="Staron and Hinch 2005")
    sizes.set_xlabel("mean diameter / R$_0$")
    sizes.set_ylabel("run-out / a, at a = 2")
    sizes.set_ylim(bottom=0.0)
    sizes.legend(frameon=False, fontsize=8.5)
    finish(sizes)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def packing(data: dict[str, Any], path: Path) -> None:
    """Packing fraction and contacts against friction."""
    figure, panels = plt.subplots(1, 2, figsize=(8.4, 3.6), dpi=110)
    for axes, name in zip(panels, ("fraction", "coordination"), strict=True):
        series = (("poured", 0, "o", OURS), ("20 shakes", 20, "^", OTHER), ("60 shakes", 60, "s", "#3f8f4f"))
        for label, shakes, marker, colour in series:
            runs = [r for r in data["poured"] + data["shaken"] if r["shakes"] == shakes]
            axes.plot([r["friction"] for r in runs], [r[name] for r in runs], marker, color=colour, label=label)
        axes.set_xlabel("friction µ")
        finish(axes)
    panels[0].axhspan(0.81, 0.84, color=PAPER, alpha=0.12, label="0.81 to 0.84")
    panels[0].set_ylabel("packing fraction")
    panels[0].legend(frameon=False, fontsize=8.5)
    for level, text in ((4.0, "isostatic, no friction"), (3.0, "isostatic, friction")):
        panels[1].axhline(level, color=PAPER, linewidth=1.0, linestyle=":")
        panels[1].text(1.0, level + 0.02, text, fontsize=8, color=PAPER, ha="right")
    panels[1].set_ylabel("contacts of a disk that bears")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def repose(data: dict[str, Any], path: Path) -> None:
    """Slopes, and their angle against friction."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.6), dpi=110, width_ratios=(1.5, 1.0))
    colours = plt.get_cmap("viridis")(np.linspace(0.0, 0.85, len(data["means"])))
    for mean, colour in zip(data["means"], colours, strict=True):
        run = next(r for r in data["runs"] if r["friction"] == mean["friction"])
        left.plot(*run["surface"], color=colour, label=f"µ {mean['friction']:g}")
    left.set_aspect("equal")
    left.set_xlabel("x, diameters")
    left.set_ylabel("surface, diameters")
    left.legend(frameon=False, fontsize=8, ncols=2)
    right.plot([r["friction"] for r in data["runs"]], [r["angle"] for r in data["runs"]], ".", color=OURS, alpha=0.4)
    columns = ([r[name] for r in data["means"]] for name in ("friction", "angle", "error"))
    right.errorbar(*columns, fmt="o-", color=OURS, markersize=5, capsize=3, linewidth=1.0)
    right.set_xlabel("friction µ")
    right.set_ylabel("angle of repose, degrees")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        finish(axes)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def janssen(data: dict[str, Any], path: Path) -> None:
    """Borne against filled mass."""
    figure, axes = plt.subplots(figsize=(5.8, 4.2), dpi=110)
    runs = data["runs"]
    filling = np.linspace(0.0, 1.05 * max(r["filling"] for r in runs), 200)
    mass = data["saturation"]
    axes.plot(filling, filling, ":", color=OTHER, label="all of it")
    axes.plot(filling, mass * -np.expm1(-filling / mass), color=PAPER, label=f"Janssen, m = {mass:.2f}")
    axes.plot([r["filling"] for r in runs], [r["borne"] for r in runs], ".", color=OURS, alpha=0.5)
    axes.errorbar(
        [r["filling"] for r in data["means"]],
        [r["borne"] for r in data["means"]],
        [2.0 * r["error"] for r in data["means"]],
        fmt="o",
        color=OURS,
        capsize=3.0,
        label="walls with µ 0.5, means and two standard errors",
    )
    smooth = data["smooth"]
    axes.plot([r["filling"] for r in smooth], [r["borne"] for r in smooth], "s", color=OTHER, label="smooth walls")
    axes.set_ylim(0.0, 1.2 * max([r["borne"] for r in runs] + [r["borne"] for r in smooth]))
    axes.set_xlabel("mass of the filling, in fillings as high as wide")
    axes.set_ylabel("mass that the bottom bears")
    axes.legend(frameon=False, fontsize=8.5)
    finish(axes)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def hourglass(data: dict[str, Any], path: Path) -> None:
    """Rate to the power 2/3 against the opening, and over the law's power of the opening."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.6), dpi=110)
    runs, fixed, free = data["runs"], data["fixed"], data["free"]
    opening, rate, error = (np.array([r[name] for r in runs], dtype=float) for name in ("opening", "rate", "error"))
    spans = np.linspace(fixed["k"], 1.05 * opening.max(), 200)
    left.plot(
        spans,
        fixed["C"] ** (2.0 / 3.0) * (spans - fixed["k"]),
        color=PAPER,
        label=f"{fixed['C']:.2f} (D/d - {fixed['k']:.2f})$^{{3/2}}$",
    )
    left.errorbar(
        opening, rate ** (2.0 / 3.0), 4.0 / 3.0 * error / rate ** (1.0 / 3.0), fmt="o", color=OURS, capsize=3.0
    )
    left.set_xlim(left=0.0)
    left.set_ylim(bottom=0.0)
    left.set_ylabel(r"W$^{2/3}$, W in $\rho\sqrt{g}\,$d$^{3/2}$")
    left.legend(frameon=False, fontsize=8.5)
    spans = np.linspace(0.9 * opening.min(), 1.05 * opening.max(), 200)
    over = (opening - fixed["k"]) ** 1.5
    right.axhline(fixed["C"], color=PAPER)
    right.plot(
        spans,
        free["C"] * (spans - free["k"]) ** free["n"] / (spans - fixed["k"]) ** 1.5,
        "--",
        color=OURS,
        linewidth=1.2,
        label=f"{free['C']:.2f} (D/d - {free['k']:.2f})$^{{{free['n']:.2f}}}$",
    )
    right.errorbar(opening, rate / over, 2.0 * error / over, fmt="o", color=OURS, capsize=3.0)
    for name, marker, label in (("lower", "s", "half the filling"), ("finer", "^", "and half the step")):
        run = data[name]
        right.plot(
            run["opening"] + 0.3, run["rate"] / (run["opening"] - fixed["k"]) ** 1.5, marker, color=OTHER, label=label
        )
    right.set_ylabel(f"W / (D/d - {fixed['k']:.2f})$^{{3/2}}$")
    right.legend(frameon=False, fontsize=8.5)
    for axes in (left, right):
        axes.set_xlabel("opening D, diameters d")
        finish(axes)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


PICTURES = {
    "collapse": collapse,
    "packing": packing,
    "repose": repose,
    "janssen": janssen,
    "hourglass": hourglass,
}
