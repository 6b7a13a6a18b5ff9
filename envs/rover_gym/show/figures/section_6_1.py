"""The figures of the report's sections 6.1 and 6.2, drawn from recorded runs.

Our run is in colour, one colour per wheel, and a Siconos run of the same scene, if there is one, dotted in black. The
report's curves are in grey or in a separate panel, because their parameters differ (listed in the data's `meta`).
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import SphereField
from rover_gym.core.validation import checked
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.scenes.report_scenes import WHEEL_RADIUS, reference_data, report_model
from rover_gym.show.figures.derived_signals import SMOOTHED, linear_then_log, plot_raw_and_smooth
from rover_gym.show.figures.style import (
    COLOURS,
    NAMES,
    QUANTITY_COLOURS,
    SIDES,
    WHEELS,
    WheelStyle,
    circle,
    close_up,
    save_figures,
    step_size,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


PUBLISHED_STEP = 0.02  # s, of the runs behind the report's figures (inferred from the figures themselves)


@checked(recording=Path, folder=Path)
def draw_section_6_1(recording: str | Path, folder: str | Path) -> list[Path]:
    """Draws the report's figures 6.2 to 6.5, and our path beside Siconos', as PNG files and returns their paths.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    drawings = {
        "figure-6.2-wheel-traces": _traces,
        "figure-6.3-contact-distances": _distances,
        "figure-6.4-reaction-force": reaction_force,
        "figure-6.5-steering-angles": steering_angles,
        "section-6.1-beside-siconos": beside_siconos,
    }
    return _draw(recording, folder, drawings)


@checked(recording=Path, folder=Path)
def draw_section_6_2(recording: str | Path, folder: str | Path) -> list[Path]:
    """Draws the figures of the run over the rug as PNG files into the folder and returns their paths.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    drawings = {
        "section-6.2-wheel-traces": wheel_traces,
        "section-6.2-contact-distances": contact_distances,
        "section-6.2-reaction-forces": reaction_forces,
    }
    return _draw(recording, folder, drawings)


def _draw(recording: str | Path, folder: str | Path, drawings: Mapping[str, Callable[..., None]]) -> list[Path]:
    trajectory = read_trajectory(recording)
    return save_figures({name: partial(draw, trajectory=trajectory) for name, draw in drawings.items()}, folder)


def _traces(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.2: the paths of the six wheel centres, from above and in the report's perspective."""
    centres = trajectory["wheel_centres"]
    above, perspective = figure.subplots(1, 2)
    curves = reference_data()["published"]["fig_6_2_wheel_traces"]["curves"].values()
    for n, curve in enumerate(curves):
        label = "" if n else "the report's (parameters not stated)"
        perspective.plot(*np.array(curve).T, color="0.6", linewidth=0.9, linestyle="--", label=label)
    for i, wheel in enumerate(WHEELS):
        colour = COLOURS[wheel]
        above.plot(centres[:, i, 2], centres[:, i, 0], color=colour, label=NAMES[wheel])
        above.plot(centres[0, i, 2], centres[0, i, 0], "o", color=colour, markersize=4)
        perspective.plot(
            *_on_the_page(100.0 * centres[:, i].T), color=colour, label="" if i else "ours, colours as left"
        )
    above.set(title="from above; dots are the start", xlabel="to the right, z (m)", ylabel="forward, x (m)")
    above.set_aspect("equal", adjustable="datalim")
    above.legend(title="wheel centre", loc="upper right")
    perspective.set(
        title="in the report's perspective", xlabel="across its page (pixels)", ylabel="up its page (pixels)"
    )
    perspective.legend()
    figure.suptitle(f"Figure 6.2: traces of the wheels over {trajectory['time'][-1]:g} s")


def _distances(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.3: the six gaps against time, with a close view of the ground."""
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    WheelStyle.of(report_model()).plot(ours, trajectory["time"], 100.0 * trajectory["wheel_gaps"])
    _plot_siconos(ours, "gap", 100.0)
    _plot_published(published, "fig_6_3_gaps")
    ours.set(
        title=f"ours, step {step_size(trajectory)}",
        xlabel="time (s)",
        ylabel="contact distance (cm)",
        xlim=(0.0, 10.0),
        ylim=(-1.0, 5.0),
    )
    published.set(title="the report's: plane (0.15, 0, 0.15),\nsteering +0.1 rad, step 20 ms", xlabel="time (s)")
    for axes in (ours, published):
        axes.legend(loc="upper right")
    figure.suptitle("Figure 6.3: contact distance between wheels and plane")


def reaction_force(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.4: normal force on a front wheel against time."""
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    forces = trajectory["wheel_forces"][:, :, 0]
    for wheel in ("FR", "FL"):
        ours.plot(trajectory["time"], forces[:, WHEELS.index(wheel)], color=COLOURS[wheel], label=NAMES[wheel])
    # Its percussions are in kg cm/s per step, clipped at 500; the label says FL, the data are FR's.
    _plot_published(published, "fig_6_4_reaction", 0.01 / PUBLISHED_STEP, ("FR",))
    ours.set(
        title=f"ours, mean over each step of {step_size(trajectory)}",
        xlabel="time (s)",
        ylabel="normal force on the wheel (N)",
        xlim=(0.0, 10.0),
        ylim=(0.0, None),
        yscale="symlog",
    )
    published.set(title="the report's: plane (0.15, 0, 0.15),\nstep 20 ms, cut at 250 N", xlabel="time (s)")
    for axes in (ours, published):
        axes.legend(loc="upper right")
    figure.suptitle("Figure 6.4: reaction force of the front wheels")


def steering_angles(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.5: the six steering angles against time."""
    columns = [7, 8, 12, 13, 17, 18]
    ours, published = figure.subplots(1, 2, sharex=True)
    WheelStyle.of(report_model()).plot(ours, trajectory["time"], trajectory["q"][:, columns])
    _plot_siconos(ours, "steering")
    _plot_published(published, "fig_6_5_steering")
    ours.set(
        title=f"ours, step {step_size(trajectory)};\nset-points -0.1 rad in front, else 0",
        xlabel="time (s)",
        ylabel="steering angle (rad)",
        xlim=(0.0, 10.0),
    )
    published.set(title="the report's: set-points +0.1 rad in front,\ntorque 0.3 N m, step 20 ms", xlabel="time (s)")
    ours.legend(loc="lower right")
    published.legend(loc="right")
    figure.suptitle("Figure 6.5: steering angles under the PD controller")


def beside_siconos(figure: Figure, trajectory: Trajectory) -> None:
    """The trunk's path in our run and in those of Siconos 4.4 of the same scene, and the distance between them."""
    ways, distances = figure.subplots(1, 2)
    time, trunk = trajectory["time"], trajectory["q"][:, :3]
    for i, name in enumerate(("x, forward", "y, up", "z, to the right")):
        ways.plot(time, trunk[:, i], color=QUANTITY_COLOURS[i], label=f"{name}: ours")
    references = sorted(reference_data()["siconos"], key=lambda run: -run["step"])
    for i, run in enumerate(references):
        at, theirs = np.array(run["t"]), np.array(run["trunk"])
        seen = at <= time[-1] + 1e-9
        ours = np.stack([np.interp(at[seen], time, column) for column in trunk.T], axis=1)
        apart = 1e3 * np.linalg.norm(ours - theirs[seen], axis=1)
        step = f"Siconos, step {1e3 * run['step']:g} ms"
        distances.plot(at[seen], np.maximum(apart, 1e-4), color=QUANTITY_COLOURS[3 + i], label=f"from {step}")
    for column in range(3):  # the last one, of the smallest step
        ways.plot(at, theirs[:, column], "k:", linewidth=1.0, label="" if column else step)
    ways.set(title="the trunk's origin", xlabel="time (s)", ylabel="place (m)", xlim=(0.0, 10.0), ylim=(-1.2, 1.2))
    distances.set(
        title="how far ours is from theirs,\nwhich are rounded to 0.1 µm",
        xlabel="time (s)",
        ylabel="distance (mm)",
        yscale="log",
    )
    for axes in (ways, distances):
        axes.legend(loc="best")
    figure.suptitle(f"Section 6.1: our run, step {step_size(trajectory)}, beside Siconos 4.4")


def _plot_siconos(axes: Axes, name: str, scale: float = 1.0) -> None:
    reference = min(reference_data()["siconos"], key=lambda run: run["step"])
    values = scale * np.array(reference[name])
    for i in range(len(WHEELS)):
        label = "" if i else f"Siconos 4.4, step {1e3 * reference['step']:g} ms"
        axes.plot(reference["t"], values[:, i], "k:", linewidth=0.9, label=label)


def _plot_published(axes: Axes, figure: str, scale: float = 1.0, wheels: tuple[str, ...] = WHEELS) -> None:
    """The report's curves under the report's names, in SI time."""
    curves = reference_data()["published"][figure]["curves"].items()
    for wheel, (name, curve) in zip(wheels, curves, strict=True):
        step, value = np.array(curve).T
        axes.plot(PUBLISHED_STEP * step, scale * value, color=COLOURS[wheel], label=name)


def _on_the_page(centres: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The report's perspective of points (3, n) in cm, recovered from its figure 6.2 (points of its page)."""
    x, y, z = centres
    px = 2625.0 + 2.51143 * (x + 1200.0) - 2.61 * (z + 500.0)
    py = 1234.0 + 0.447143 * (x + 1200.0) + 2.34333 * (z + 500.0) + 8.5125 * (y + 80.0)
    return px, py


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
