"""A ball on an incline, simulated and in closed form: where it sticks and where it slips."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.scenes.incline import Incline, acceleration
from rover_gym.show.figures.planar_drawing import path_over_ground
from rover_gym.show.figures.style import DARK, QUANTITY_COLOURS, panel_legend, save_figures
from rover_gym.show.frames.appearance import PLANAR_WHEEL_COLOURS

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from rover_gym.record.planar_run import PlanarRun
    from rover_gym.show.figures.style import Sheet

Array = npt.NDArray[np.float64]

RIM, CENTRE = PLANAR_WHEEL_COLOURS[:2]
ANALYTIC: dict[str, Any] = {"color": DARK, "linestyle": (0, (2, 2)), "linewidth": 1.2}
STEEPEST = 60.0  # degrees, of the panel over the slope
SLOPES = 13  # that are simulated there


def down_slope(run: PlanarRun, case: Incline) -> tuple[Array, Array]:
    """Speeds of the centre and of the rim down the slope, (n,), m/s."""
    v = run.trajectory["v"]
    centre = v[:, 0] * np.cos(case.slope) - v[:, 1] * np.sin(case.slope)
    return centre, -v[:, 2] * float(run.radius[0])


def fill_incline(figure: Sheet, run: PlanarRun, case: Incline) -> None:
    """Draws the path, the speeds, the ratio of friction to load, and the acceleration over the slope."""
    panels = figure.subplots(2, 2)
    path_over_ground(panels[0, 0], run)
    panel_legend(panels[0, 0], 2)
    _speeds(panels[0, 1], run, case)
    _ratio(panels[1, 0], run, case)
    _accelerations(panels[1, 1], case)
    kind = "slides" if not np.isfinite(case.end_of_sliding) else "rolls" if case.speed == 0.0 else "slides, then rolls"
    figure.suptitle(f"A ball on a slope of {np.degrees(case.slope):.3g} degrees with friction {case.friction:g} {kind}")


def _speeds(axes: Axes, run: PlanarRun, case: Incline) -> None:
    centre, rim = down_slope(run, case)
    axes.plot(run.time, centre, color=CENTRE, linewidth=2.5, alpha=0.6, label="centre")
    axes.plot(run.time, rim, color=RIM, linewidth=2.5, alpha=0.6, label="rim")
    for k, values in enumerate(case.speeds(run.time)):
        axes.plot(run.time, values, label="_" if k else "analytic", **ANALYTIC)
    _shade_slip(axes, run, case)
    axes.set(xlabel="time (s)", ylabel="speed down the slope (m/s)")
    panel_legend(axes)


def _shade_slip(axes: Axes, run: PlanarRun, case: Incline) -> None:
    end = min(case.end_of_sliding, float(run.time[-1]))
    if end > 0.0:
        axes.axvspan(0.0, end, color=QUANTITY_COLOURS[1], alpha=0.12, linewidth=0.0, label="slip")


def _ratio(axes: Axes, run: PlanarRun, case: Incline) -> None:
    """Friction over load: between the dashed lines the ball sticks, on them it slips."""
    normal, tangential = run.trajectory["impulses"][1:, 0].T
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(normal > 0.0, tangential / normal, np.nan)
    axes.plot(run.time[1:], ratio, color=RIM, linewidth=2.5, alpha=0.6, label="friction / load")
    rolling = -np.tan(case.slope) * case.inertia_ratio / (1.0 + case.inertia_ratio)
    analytic = np.where(run.time < case.end_of_sliding, -case.friction, rolling)
    axes.plot(run.time, analytic, label="analytic", **ANALYTIC)
    for sign in (-1.0, 1.0):
        axes.axhline(sign * case.friction, color="0.6", linewidth=0.8)
    _shade_slip(axes, run, case)
    reach = 1.3 * max(case.friction, 0.05)
    axes.set(xlabel="time (s)", ylabel="ratio, grey: the cone's edge (1)", ylim=(-reach, reach))
    panel_legend(axes)


def _accelerations(axes: Axes, case: Incline) -> None:
    fine = np.radians(np.linspace(0.0, STEEPEST, 200))
    at_rest = replace(case, speed=0.0)
    axes.plot(
        np.degrees(fine),
        [replace(at_rest, slope=slope).final for slope in fine],
        label="analytic, from rest",
        **ANALYTIC,
    )
    for kind, colour in (("rolls", CENTRE), ("slides", RIM)):
        slopes = [
            slope
            for slope in np.radians(np.linspace(0.0, STEEPEST, SLOPES))
            if (slope <= case.steepest) == (kind == "rolls")
        ]
        values = [acceleration(replace(at_rest, slope=slope)) for slope in slopes]
        axes.plot(np.degrees(slopes), values, "o", color=colour, markersize=4.0, label=kind)
    axes.axvline(np.degrees(case.slope), color="0.6", linewidth=0.8)
    axes.set(xlabel="slope, grey: this run (°)", ylabel="acceleration (m/s²)")
    panel_legend(axes)


def draw_incline(run: PlanarRun, case: Incline, path: Path) -> Path:
    """Draws the figure into a file of one of the formats of `draw_run`.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    drawing = {path.stem: lambda figure: fill_incline(figure, run, case)}
    return save_figures(drawing, path.parent, height=7.0, file_format=path.suffix[1:])[0]
