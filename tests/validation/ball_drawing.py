"""Pictures of the validation of balls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from validation.ball_collapse import lube
from validation.ball_drum import GLASS, YIELD
from validation.drawing import OTHER, OURS, PAPER, finish

VIRIDIS = mpl.colormaps["viridis"]


def packing(data: dict[str, Any], path: Path) -> None:
    """Packing fraction and contacts against friction."""
    figure = Figure(figsize=(9.2, 3.8), dpi=110)
    left, right = figure.subplots(1, 2)
    friction = [row["friction"] for row in data["means"]]
    for axes, name, lines in (
        (left, "fraction", ((0.64, "random close, 0.64"), (0.55, "random loose, 0.55"))),
        (right, "coordination", ((6.0, "isostatic, 6"), (4.0, "isostatic with friction, 4"))),
    ):
        for (value, label), style in zip(lines, ("-", "--"), strict=True):
            axes.axhline(value, color=PAPER, linestyle=style, linewidth=1.2, label=label)
        axes.plot([r["friction"] for r in data["poured"]], [r[name] for r in data["poured"]], ".", color=OTHER)
        values, errors = ([row[key] for row in data["means"]] for key in (name, f"{name}_error"))
        axes.errorbar(friction, values, errors, fmt="o", color=OURS, capsize=3, label="900 balls, 3 beds")
        axes.set_xlabel("friction µ")
        axes.legend(frameon=False, fontsize=8.5)
        finish(axes)
    left.set_ylabel("packing fraction")
    right.set_ylabel("contacts that bear load")
    figure.tight_layout()
    figure.savefig(path)


def impact(data: dict[str, Any], path: Path) -> None:
    """Depth of a sphere against the law."""
    figure = Figure(figsize=(5.2, 4.2), dpi=110)
    axes = figure.subplots()
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
    axes.legend(frameon=False, fontsize=8.5)
    finish(axes)
    figure.tight_layout()
    figure.savefig(path)


def collapse(data: dict[str, Any], path: Path) -> None:
    """Run-out against aspect ratio, and against the size of the balls."""
    figure = Figure(figsize=(9.2, 3.9), dpi=110)
    left, right = figure.subplots(1, 2)
    aspect = np.linspace(0.3, 5.5, 200)
    for span in (aspect[aspect < 1.7], aspect[aspect >= 1.7]):
        label = "Lube et al. 2004: 1.24 a, 1.6 a$^{1/2}$" if span[0] < 1.0 else None
        left.plot(span, [lube(a) for a in span], color=PAPER, label=label)
    runs = data["runs"]
    left.plot([r["aspect"] for r in runs], [r["run_out"] for r in runs], "o", color=OURS, label="700 balls")
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
        axes.legend(frameon=False, fontsize=8.5)
        finish(axes)
    figure.tight_layout()
    figure.savefig(path)


def silo(data: dict[str, Any], path: Path) -> None:
    """Discharge against the hole."""
    figure = Figure(figsize=(5.2, 3.9), dpi=110)
    axes = figure.subplots()
    hole = np.linspace(max(1.4, data["fit"]["k"]), 1.05 * max(run["hole"] for run in data["runs"]), 100)
    axes.plot(hole, (0.58 * (hole - 1.4) ** 2.5) ** 0.4, color=PAPER, label="Beverloo: C 0.58, k 1.4")
    fit = data["fit"]
    label = f"C {fit['C']:.2f}, k {fit['k']:.2f}"
    axes.plot(hole, fit["C"] ** 0.4 * (hole - fit["k"]), "--", color=OURS, linewidth=1.2, label=label)
    axes.plot([r["hole"] for r in data["runs"]], [r["scaled"] ** 0.4 for r in data["runs"]], "o", color=OURS)
    axes.set_xlabel("width of the hole, diameters of a ball")
    axes.set_ylabel(r"(W / $\rho_b$ g$^{1/2}$ d$^{5/2}$)$^{2/5}$")
    axes.legend(frameon=False, fontsize=8.5)
    finish(axes)
    figure.tight_layout()
    figure.savefig(path)


def janssen(data: dict[str, Any], path: Path) -> None:
    """Load against filling."""
    figure = Figure(figsize=(5.6, 4.0), dpi=110)
    axes = figure.subplots()
    runs, rows, mass = data["runs"], data["means"], data["saturation"]
    filling = np.linspace(0.0, 1.05 * max(run["filling"] for run in runs), 100)
    axes.plot(filling, filling, ":", color=OTHER, label="whole weight")
    label = f"Janssen, m = {mass:.2f} ± {data['saturation_error']:.2f}"
    axes.plot(filling, mass * -np.expm1(-filling / mass), color=PAPER, label=label)
    axes.plot([r["filling"] for r in runs], [r["borne"] for r in runs], ".", color=OURS, alpha=0.5)
    columns = ([row[name] for row in rows] for name in ("filling", "borne"))
    errors = [2.0 * row["error"] for row in rows]
    axes.errorbar(*columns, errors, fmt="o", color=OURS, capsize=3, label="means and two standard errors")
    axes.plot(data["smooth"]["filling"], data["smooth"]["borne"], "s", color=OTHER, label="smooth tube")
    axes.set_ylim(0.0, 1.25 * data["smooth"]["borne"])
    axes.set_xlabel("filling, in fillings as high as wide")
    axes.set_ylabel("load on the bottom")
    axes.legend(frameon=False, fontsize=8.5)
    finish(axes)
    figure.tight_layout()
    figure.savefig(path)


def drum(data: dict[str, Any], path: Path) -> None:
    """Surfaces in a drum, and their slope against friction, against the rate and against the size of the balls."""
    figure = Figure(figsize=(9.6, 7.4), dpi=110)
    (surfaces, frictions), (rates, sizes) = figure.subplots(2, 2)
    _surfaces(surfaces, data)
    frictions.plot(
        list(YIELD),
        list(YIELD.values()),
        "s",
        color=PAPER,
        label="slow shear: Peyneau and Roux 2008, Chialvo et al. 2012",
    )
    frictions.axhspan(*GLASS, color=PAPER, alpha=0.12, label="glass beads: Jop et al. 2006")
    _angles(frictions, data, "drum with a rough wall")
    smooth = data["smooth"]
    label = "drum with a smooth wall"
    frictions.plot([r["friction"] for r in smooth], [r["angle"] for r in smooth], "D", color=OTHER, label=label)
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
        finish(axes)
    for axes in (rates, sizes):
        axes.set_xlim(left=0.0)
    figure.tight_layout()
    figure.savefig(path)


def _runs(axes: Axes, name: str, runs: list[dict[str, Any]], marker: str, label: str) -> None:
    """Slopes of runs, with the standard errors over their quarters."""
    blocks = np.array([run["blocks"] for run in runs])
    errors = blocks.std(axis=1, ddof=1) / np.sqrt(blocks.shape[1])
    places, values = ([run[key] for run in runs] for key in (name, "angle"))
    axes.errorbar(places, values, errors, fmt=marker, color=OURS, capsize=3, label=label)


def repose(data: dict[str, Any], path: Path) -> None:
    """Slopes that remain, and their angle against friction."""
    figure = Figure(figsize=(9.2, 3.8), dpi=110)
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    _surfaces(left, data)
    right.axhspan(*GLASS, color=PAPER, alpha=0.12, label="glass beads: Jop et al. 2006")
    _angles(right, data, "slope that remains")
    larger = data["larger"]
    label = "a bed half as long and high again"
    right.plot([r["friction"] for r in larger], [r["angle"] for r in larger], "x", color=OTHER, label=label)
    right.set_ylabel("angle of repose, degrees")
    right.set_ylim(0.0, 40.0)
    right.legend(frameon=False, fontsize=8)
    finish(right)
    figure.tight_layout()
    figure.savefig(path)


def _surfaces(axes: Axes, data: dict[str, Any]) -> None:
    """One surface for each friction, to scale."""
    for mean, shade in zip(data["means"], np.linspace(0.0, 0.85, len(data["means"])), strict=True):
        run = next(r for r in data["runs"] if r["friction"] == mean["friction"])
        axes.plot(*run["surface"], color=VIRIDIS(shade), label=f"µ {mean['friction']:g}")
    axes.set_aspect("equal")
    axes.set_xlabel("x, diameters")
    axes.set_ylabel("surface, diameters")
    axes.legend(frameon=False, fontsize=8, ncols=2)
    finish(axes)


def _angles(axes: Axes, data: dict[str, Any], label: str) -> None:
    """Angles of all runs, and their means with standard errors."""
    axes.plot([r["friction"] for r in data["runs"]], [r["angle"] for r in data["runs"]], ".", color=OURS, alpha=0.4)
    columns = ([row[name] for row in data["means"]] for name in ("friction", "angle", "error"))
    axes.errorbar(*columns, fmt="o-", color=OURS, markersize=5, capsize=3, linewidth=1.0, label=label)
    axes.set_xlabel("friction µ")


PICTURES = {
    "ball_packing": packing,
    "ball_impact": impact,
    "ball_collapse": collapse,
    "ball_silo": silo,
    "ball_drum": drum,
    "ball_repose": repose,
    "ball_janssen": janssen,
}
