"""Figures of the report's section 6.2, the run over the rug of spheres; the report shows no curves of this run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.figures.saving import save_figures
from rover_gym.figures.signals import SMOOTHED, linear_then_log, plot_raw_and_smooth
from rover_gym.figures.style import COLOURS, NAMES, SIDES, WHEELS, circle, close_up, step_size
from rover_gym.figures.wheel_style import WheelStyle
from rover_gym.mechanics import SphereField
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.reproduction.report_rover import WHEEL_RADIUS, report_model
from rover_gym.validation import checked

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked(recording=Path, folder=Path)
def draw_section_6_2(recording: str | Path, folder: str | Path) -> list[Path]:
    """Draws the figures of the run over the rug as PNG files into the folder and returns their paths.

    Raises:
        MissingExtraError: matplotlib or h5py is not installed.
    """
    trajectory = read_trajectory(recording)
    drawings = {
        "section-6.2-wheel-traces": wheel_traces,
        "section-6.2-contact-distances": contact_distances,
        "section-6.2-reaction-forces": reaction_forces,
    }
    return save_figures({name: partial(draw, trajectory=trajectory) for name, draw in drawings.items()}, folder)


def wheel_traces(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: the paths of the wheel centres from above, and those of the left wheels from the side."""
    centres = trajectory["wheel_centres"]
    above, side = figure.subplots(1, 2, width_ratios=(1, 1.6))
    field = SphereField.rug()
    # The wheels lean, so they touch a little beside their centres' z.
    touching = report_model().wheel_contact_points(trajectory["q"][-1], field, coordinates="state")[:, 2]
    for (x, _, z), radius in zip(field.centres, field.radii, strict=True):
        circle(above, z, x, radius, color="0.85")
    for i, wheel in enumerate(WHEELS):
        colour = COLOURS[wheel]
        above.plot(centres[:, i, 2], centres[:, i, 0], color=colour, label=NAMES[wheel])
        above.plot(centres[0, i, 2], centres[0, i, 0], "o", color=colour, markersize=4)
        if wheel in SIDES[0]:
            side.plot(centres[:, i, 0], centres[:, i, 1], color=colour)
            side.plot(centres[0, i, 0], centres[0, i, 1], "o", color=colour, markersize=4)
            x, y = centres[-1, i, :2]
            circle(side, x, y, WHEEL_RADIUS, color=colour)
            across = x + np.linspace(-1.2 * WHEEL_RADIUS, 1.2 * WHEEL_RADIUS, 200)
            side.plot(across, field.heights(np.stack((across, np.full(200, touching[i])), axis=1)), color="0.4")
    above.set(title="from above; dots are the start", xlabel="to the right, z (m)", ylabel="forward, x (m)")
    side.set(
        title="the left wheels from the right;\nat the end, with the rug under them",
        xlabel="forward, x (m)",
        ylabel="up, y (m)",
    )
    close_up(above, centres[..., 2], centres[..., 0], 0.7)
    close_up(side, centres[..., 0], centres[..., 1], 0.4)
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    figure.suptitle(f"Section 6.2: traces of the wheel centres on the rug over {trajectory['time'][-1]:g} s")


def contact_distances(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: the six gaps against time, left and right wheels in separate panels."""
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, wheels, name in zip(panels, SIDES, ("left", "right"), strict=True):
        WheelStyle.of(report_model()).plot(axes, trajectory["time"], 100.0 * trajectory["wheel_gaps"], wheels)
        axes.set(
            title=f"{name} wheels, step {step_size(trajectory)}", xlabel="time (s)", xlim=(0.0, 25.0), ylim=(-1.0, 5.0)
        )
        axes.legend(loc="upper right")
    figure.axes[0].set_ylabel("contact distance (cm)")
    figure.suptitle("Section 6.2: contact distance between wheels and spheres")


def reaction_forces(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: normal force on each wheel against time, left and right wheels in separate panels."""
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, wheels, name in zip(panels, SIDES, ("left", "right"), strict=True):
        plot_raw_and_smooth(
            axes, WheelStyle.of(report_model()), trajectory["time"], trajectory["wheel_forces"][:, :, 0], wheels
        )
        axes.set(title=f"{name} wheels, mean over each step of {step_size(trajectory)}", xlabel="time (s)")
        axes.set_xlim(0.0, 25.0)
        axes.legend(loc="upper right", title=SMOOTHED.replace("; ", "\n"), title_fontsize=8.0)
    linear_then_log(panels[0], 40.0, 0.0, float(trajectory["wheel_forces"][:, :, 0].max()))
    figure.axes[0].set_ylabel("normal force on the wheel (N)")
    figure.suptitle("Section 6.2: reaction forces of the wheels")
