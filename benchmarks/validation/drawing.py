"""Pictures of the validation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from validation.ball_collapse import lube
from validation.ball_drum import GLASS, YIELD
from validation.wheel_on_balls import measurements

OURS, PAPER, OTHER = "#d1361f", "#2f6db3", "#5b6770"
VIRIDIS = mpl.colormaps["viridis"]

#: What draws the data of a part into a file, by the part's name.
PICTURES: dict[str, Callable[[dict[str, Any], Path], None]] = {}


def picture(name: str, size: tuple[float, float], *shape: int, layout: str | None = None, **options: Any) -> Any:
    """Makes a function that fills panels with data the picture of a part.

    Args:
        name: Of the part.
        size: Of the figure, inches.
        *shape: Rows and columns of panels; one panel by default.
        layout: Of the figure; tight by default.
        **options: Of the panels.
    """

    def decorate(fill: Callable[[Any, dict[str, Any]], None]) -> Callable[[Any, dict[str, Any]], None]:
        def draw(data: dict[str, Any], path: Path) -> None:
            figure = Figure(figsize=size, dpi=110, layout=layout)
            fill(figure.subplots(*shape, **options), data)
            for axes in figure.axes:
                axes.grid(which="major", color="#dddddd", linewidth=0.7)
                axes.set_axisbelow(True)
                axes.spines[["top", "right"]].set_visible(False)
            if layout is None:
                figure.tight_layout()
            figure.savefig(path)

        PICTURES[name] = draw
        return fill

    return decorate


def columns(rows: list[dict[str, Any]], *names: str) -> list[list[float]]:
    """Values of quantities, one list each."""
    return [[row[name] for row in rows] for name in names]


def dots(axes: Axes, rows: list[dict[str, Any]], x: str, y: str, marker: str, color: str = OURS, **style: Any) -> None:
    """One mark a row."""
    axes.plot(*columns(rows, x, y), marker, color=color, **style)


def legend(axes: Axes) -> None:
    """Small and without a frame."""
    axes.legend(frameon=False, fontsize=8.5)


@picture("collapse", (10.4, 4.6), 1, 2, width_ratios=(1.5, 1.0))
def collapse(panels: Any, data: dict[str, Any]) -> None:
    """Run-out against aspect ratio, both logarithmic; and against the size of the disks, at one aspect ratio."""
    (axes, sizes) = panels
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
        dots(axes, runs, "aspect", "run_out", marker, color=colour, markersize=5, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    axes.set_xticks([0.5, 1, 2, 4, 8])
    axes.set_yticks([1, 2, 5, 10])
    axes.set_xlabel("aspect ratio a = H$_0$/R$_0$")
    axes.set_ylabel("run-out (R - R$_0$)/R$_0$")
    legend(axes)
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
    legend(sizes)


@picture("packing", (8.4, 3.6), 1, 2)
def packing(panels: Any, data: dict[str, Any]) -> None:
    """Packing fraction and contacts against friction."""
    for axes, name in zip(panels, ("fraction", "coordination"), strict=True):
        series = (("poured", 0, "o", OURS), ("20 shakes", 20, "^", OTHER), ("60 shakes", 60, "s", "#3f8f4f"))
        for label, shakes, marker, colour in series:
            runs = [r for r in data["poured"] + data["shaken"] if r["shakes"] == shakes]
            dots(axes, runs, "friction", name, marker, color=colour, label=label)
        axes.set_xlabel("friction µ")
    panels[0].axhspan(0.81, 0.84, color=PAPER, alpha=0.12, label="0.81 to 0.84")
    panels[0].set_ylabel("packing fraction")
    legend(panels[0])
    for level, text in ((4.0, "isostatic, no friction"), (3.0, "isostatic, friction")):
        panels[1].axhline(level, color=PAPER, linewidth=1.0, linestyle=":")
        panels[1].text(1.0, level + 0.02, text, fontsize=8, color=PAPER, ha="right")
    panels[1].set_ylabel("contacts of a disk that bears")


@picture("repose", (8.4, 3.6), 1, 2, width_ratios=(1.5, 1.0))
def repose(panels: Any, data: dict[str, Any]) -> None:
    """Slopes, and their angle against friction."""
    (left, right) = panels
    _surfaces(left, data)
    _angles(right, data)
    right.set_ylabel("angle of repose, degrees")
    right.set_ylim(bottom=0.0)


@picture("janssen", (5.8, 4.2))
def janssen(axes: Any, data: dict[str, Any]) -> None:
    """Borne against filled mass."""
    _janssen(axes, data, "all of it", f"{data['saturation']:.2f}", "walls with µ 0.5, means and two standard errors")
    dots(axes, data["smooth"], "filling", "borne", "s", OTHER, label="smooth walls")
    axes.set_ylim(0.0, 1.2 * max(r["borne"] for r in data["runs"] + data["smooth"]))
    axes.set_xlabel("mass of the filling, in fillings as high as wide")
    axes.set_ylabel("mass that the bottom bears")
    legend(axes)


@picture("hourglass", (8.4, 3.6), 1, 2)
def hourglass(panels: Any, data: dict[str, Any]) -> None:
    """Rate to the power 2/3 against the opening, and over the law's power of the opening."""
    (left, right) = panels
    runs, fixed, free = data["runs"], data["fixed"], data["free"]
    opening, rate, error = (np.array([r[name] for r in runs], dtype=float) for name in ("opening", "rate", "error"))
    spans = np.linspace(fixed["k"], 1.05 * opening.max(), 200)
    label = f"{fixed['C']:.2f} (D/d - {fixed['k']:.2f})$^{{3/2}}$"
    left.plot(spans, fixed["C"] ** (2.0 / 3.0) * (spans - fixed["k"]), color=PAPER, label=label)
    bars = {"fmt": "o", "color": OURS, "capsize": 3.0}
    left.errorbar(opening, rate ** (2.0 / 3.0), 4.0 / 3.0 * error / rate ** (1.0 / 3.0), **bars)
    left.set_xlim(left=0.0)
    left.set_ylim(bottom=0.0)
    left.set_ylabel(r"W$^{2/3}$, W in $\rho\sqrt{g}\,$d$^{3/2}$")
    legend(left)
    spans = np.linspace(0.9 * opening.min(), 1.05 * opening.max(), 200)
    over = (opening - fixed["k"]) ** 1.5
    right.axhline(fixed["C"], color=PAPER)
    label = f"{free['C']:.2f} (D/d - {free['k']:.2f})$^{{{free['n']:.2f}}}$"
    fit = free["C"] * (spans - free["k"]) ** free["n"] / (spans - fixed["k"]) ** 1.5
    right.plot(spans, fit, "--", color=OURS, linewidth=1.2, label=label)
    right.errorbar(opening, rate / over, 2.0 * error / over, **bars)
    for name, marker, label in (("lower", "s", "half the filling"), ("finer", "^", "and half the step")):
        place, height = data[name]["opening"] + 0.3, data[name]["rate"] / (data[name]["opening"] - fixed["k"]) ** 1.5
        right.plot(place, height, marker, color=OTHER, label=label)
    right.set_ylabel(f"W / (D/d - {fixed['k']:.2f})$^{{3/2}}$")
    legend(right)
    for axes in (left, right):
        axes.set_xlabel("opening D, diameters d")


@picture("ball_packing", (9.2, 3.8), 1, 2)
def ball_packing(panels: Any, data: dict[str, Any]) -> None:
    """Packing fraction and contacts against friction."""
    left, right = panels
    for axes, name, lines in (
        (left, "fraction", ((0.64, "random close, 0.64"), (0.55, "random loose, 0.55"))),
        (right, "coordination", ((6.0, "isostatic, 6"), (4.0, "isostatic with friction, 4"))),
    ):
        for (value, label), style in zip(lines, ("-", "--"), strict=True):
            axes.axhline(value, color=PAPER, linestyle=style, linewidth=1.2, label=label)
        dots(axes, data["poured"], "friction", name, ".", color=OTHER)
        means = columns(data["means"], "friction", name, f"{name}_error")
        axes.errorbar(*means, fmt="o", color=OURS, capsize=3, label="900 balls, 3 beds")
        axes.set_xlabel("friction µ")
        legend(axes)
    left.set_ylabel("packing fraction")
    right.set_ylabel("contacts that bear load")


@picture("ball_impact", (5.2, 4.2))
def ball_impact(axes: Any, data: dict[str, Any]) -> None:
    """Depth of a sphere against the law."""
    densities = sorted({run["density"] for run in data["runs"]})
    for density, marker in zip(densities, "vo^", strict=False):
        runs = [run for run in data["runs"] if run["density"] == density]
        share = density / densities[len(densities) // 2]
        law, depth = ([1e3 * run[name] for run in runs] for name in ("law", "depth"))
        axes.plot(law, depth, marker, color=OURS, markersize=5, label=f"{share:g} times the density")
    top = 1.15e3 * max(max(run["law"], run["depth"]) for run in data["runs"])
    axes.plot([0.0, top], [0.0, top], color=PAPER, label="equal")
    axes.set_xlabel(r"0.14/µ ($\rho_p/\rho_g$)$^{1/2}$ D$^{2/3}$ H$^{1/3}$, mm (Uehara et al. 2003)")
    axes.set_ylabel("depth of the sphere, mm")
    legend(axes)


@picture("ball_collapse", (9.2, 3.9), 1, 2)
def ball_collapse(panels: Any, data: dict[str, Any]) -> None:
    """Run-out against aspect ratio, and against the size of the balls."""
    left, right = panels
    aspect = np.linspace(0.3, 5.5, 200)
    for span in (aspect[aspect < 1.7], aspect[aspect >= 1.7]):
        label = "Lube et al. 2004: 1.24 a, 1.6 a$^{1/2}$" if span[0] < 1.0 else None
        left.plot(span, [lube(a) for a in span], color=PAPER, label=label)
    runs = data["runs"]
    dots(left, runs, "aspect", "run_out", "o", color=OURS, label="700 balls")
    left.set_xlabel("aspect ratio a = H$_0$/R$_0$")
    left.set_ylabel("run-out (R - R$_0$)/R$_0$")
    limit = data["limit"]
    near = data["sizes"] + [r for r in runs if 0.8 < r["aspect"] < 1.4]
    inverse = np.array([0.0, 1.1 * max(1.0 / r["grains"] for r in near)])
    label = f"{limit['value']:.2f} ± {limit['error']:.2f} at 0"
    right.plot(inverse, limit["value"] + limit["slope"] * inverse, "--", color=OURS, linewidth=1.2, label=label)
    right.plot([1.0 / r["grains"] for r in near], [r["run_out"] / lube(r["aspect"]) for r in near], "o", color=OURS)
    right.axhline(1.0, color=PAPER)
    right.set_xlabel("diameter of a ball over R$_0$")
    right.set_ylabel("run-out over the law, a = 1")
    for axes in (left, right):
        axes.set_ylim(bottom=0.0)
        legend(axes)


@picture("ball_silo", (5.2, 3.9))
def ball_silo(axes: Any, data: dict[str, Any]) -> None:
    """Discharge against the hole."""
    hole = np.linspace(max(1.4, data["fit"]["k"]), 1.05 * max(run["hole"] for run in data["runs"]), 100)
    axes.plot(hole, (0.58 * (hole - 1.4) ** 2.5) ** 0.4, color=PAPER, label="Beverloo: C 0.58, k 1.4")
    fit = data["fit"]
    label = f"C {fit['C']:.2f}, k {fit['k']:.2f}"
    axes.plot(hole, fit["C"] ** 0.4 * (hole - fit["k"]), "--", color=OURS, linewidth=1.2, label=label)
    axes.plot([r["hole"] for r in data["runs"]], [r["scaled"] ** 0.4 for r in data["runs"]], "o", color=OURS)
    axes.set_xlabel("width of the hole, diameters of a ball")
    axes.set_ylabel(r"(W / $\rho_b$ g$^{1/2}$ d$^{5/2}$)$^{2/5}$")
    legend(axes)


@picture("ball_janssen", (5.6, 4.0))
def ball_janssen(axes: Any, data: dict[str, Any]) -> None:
    """Load against filling."""
    mass = f"{data['saturation']:.2f} ± {data['saturation_error']:.2f}"
    _janssen(axes, data, "whole weight", mass, "means and two standard errors")
    dots(axes, [data["smooth"]], "filling", "borne", "s", OTHER, label="smooth tube")
    axes.set_ylim(0.0, 1.25 * data["smooth"]["borne"])
    axes.set_xlabel("filling, in fillings as high as wide")
    axes.set_ylabel("load on the bottom")
    legend(axes)


@picture("ball_drum", (9.6, 7.4), 2, 2)
def ball_drum(panels: Any, data: dict[str, Any]) -> None:
    """Surfaces in a drum, and their slope against friction, against the rate and against the size of the balls."""
    (surfaces, frictions), (rates, sizes) = panels
    _surfaces(surfaces, data)
    label = "slow shear: Peyneau and Roux 2008, Chialvo et al. 2012"
    frictions.plot(list(YIELD), list(YIELD.values()), "s", color=PAPER, label=label)
    frictions.axhspan(*GLASS, color=PAPER, alpha=0.12, label="glass beads: Jop et al. 2006")
    _angles(frictions, data, "drum with a rough wall")
    smooth = data["smooth"]
    label = "drum with a smooth wall"
    dots(frictions, smooth, "friction", "angle", "D", color=OTHER, label=label)
    for mu, marker in ((0.5, "o"), (0.0, "^")):
        runs = [run for run in data["rates"] + data["runs"] if run["friction"] == mu]
        _runs(rates, "rate", runs, marker, f"µ {mu:g}")
        rates.axhline(YIELD[mu], color=PAPER, linestyle="-" if mu else "--", linewidth=1.2)
    rates.set_xlabel("rate of the drum, rad/s")
    runs = [run for run in data["sizes"] + data["runs"] if run["friction"] == 0.5]
    _runs(sizes, "inverse", [run | {"inverse": 1.0 / run["wall"]} for run in runs], "o", "µ 0.5")
    end, inverse = data["limit"], np.array([0.0, 0.18])
    label = f"{end['value']:.1f} ± {end['error']:.1f} at 0"
    sizes.plot(inverse, end["value"] + end["rise"] * inverse, "--", color=OURS, linewidth=1.2, label=label)
    sizes.axhline(YIELD[0.5], color=PAPER, linewidth=1.2, label="slow shear, µ 0.5")
    sizes.set_xlabel("diameter of a ball over the drum's radius")
    for axes in (frictions, rates, sizes):
        axes.set_ylabel("slope, degrees")
        axes.set_ylim(-1.0, 40.0)
        axes.legend(frameon=False, fontsize=8)
    for axes in (rates, sizes):
        axes.set_xlim(left=0.0)


@picture("ball_repose", (9.2, 3.8), 1, 2, width_ratios=(1.5, 1.0))
def ball_repose(panels: Any, data: dict[str, Any]) -> None:
    """Slopes that remain, and their angle against friction."""
    left, right = panels
    _surfaces(left, data)
    right.axhspan(*GLASS, color=PAPER, alpha=0.12, label="glass beads: Jop et al. 2006")
    _angles(right, data, "slope that remains")
    larger = data["larger"]
    label = "a bed half as long and high again"
    dots(right, larger, "friction", "angle", "x", color=OTHER, label=label)
    right.set_ylabel("angle of repose, degrees")
    right.set_ylim(0.0, 40.0)
    right.legend(frameon=False, fontsize=8)


@picture("wheel_on_balls", (11.4, 4.0), 1, 3, layout="constrained")
def wheel_on_balls(panels: Any, data: dict[str, Any]) -> None:
    """Pull, lateral force and sinkage against slip beside the measurements."""
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
    panels[-1].set_ylim(bottom=0.0)
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].figure.legend(handles, labels, loc="outside upper center", ncol=3, frameon=False)


@picture("plate_on_balls", (6.4, 4.2), layout="constrained")
def plate_on_balls(axes: Any, data: dict[str, Any]) -> None:
    """Pressure under a plate on beds of one size, with the spread of single beds, against CPU time."""
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


def _janssen(axes: Axes, data: dict[str, Any], whole: str, mass: str, means: str) -> None:
    """The whole weight, Janssen's law, runs, and means with errors, with their labels."""
    filling, m = np.linspace(0.0, 1.05 * max(run["filling"] for run in data["runs"]), 200), data["saturation"]
    axes.plot(filling, filling, ":", color=OTHER, label=whole)
    axes.plot(filling, m * -np.expm1(-filling / m), color=PAPER, label=f"Janssen, m = {mass}")
    dots(axes, data["runs"], "filling", "borne", ".", alpha=0.5)
    errors = [2.0 * row["error"] for row in data["means"]]
    axes.errorbar(*columns(data["means"], "filling", "borne"), errors, fmt="o", color=OURS, capsize=3, label=means)


def _runs(axes: Axes, name: str, runs: list[dict[str, Any]], marker: str, label: str) -> None:
    """Slopes of runs, with the standard errors over their quarters."""
    blocks = np.array([run["blocks"] for run in runs])
    errors = blocks.std(axis=1, ddof=1) / np.sqrt(blocks.shape[1])
    axes.errorbar(*columns(runs, name, "angle"), errors, fmt=marker, color=OURS, capsize=3, label=label)


def _surfaces(axes: Axes, data: dict[str, Any]) -> None:
    """One surface for each friction, to scale."""
    for mean, shade in zip(data["means"], np.linspace(0.0, 0.85, len(data["means"])), strict=True):
        run = next(r for r in data["runs"] if r["friction"] == mean["friction"])
        axes.plot(*run["surface"], color=VIRIDIS(shade), label=f"µ {mean['friction']:g}")
    axes.set_aspect("equal")
    axes.set_xlabel("x, diameters")
    axes.set_ylabel("surface, diameters")
    axes.legend(frameon=False, fontsize=8, ncols=2)


def _angles(axes: Axes, data: dict[str, Any], label: str | None = None) -> None:
    """Angles of all runs, and their means with standard errors."""
    dots(axes, data["runs"], "friction", "angle", ".", color=OURS, alpha=0.4)
    means = columns(data["means"], "friction", "angle", "error")
    axes.errorbar(*means, fmt="o-", color=OURS, markersize=5, capsize=3, linewidth=1.0, label=label)
    axes.set_xlabel("friction µ")
