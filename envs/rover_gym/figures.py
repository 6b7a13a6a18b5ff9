"""The report's figures 6.2 to 6.5, drawn from a recorded run, and those of its section 6.2.

Ours in colour, one colour a wheel; a Siconos run of the same scene dotted in black where it exists; the report's own
curves in grey or in a panel of their own, since they were made with other parameters (the data's `meta` says which).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym._core import SphereField
from rover_gym.extras import MissingExtraError
from rover_gym.recording import Trajectory, read_trajectory
from rover_gym.report import WHEEL_RADIUS, reference_data, report_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WHEELS = ("FL", "FR", "ML", "BL", "MR", "BR")
NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "BL": "back left",
    "MR": "middle right",
    "BR": "back right",
}
SIDES = (("FL", "ML", "BL"), ("FR", "MR", "BR"))
# Okabe and Ito's colours, told apart by colour-blind readers too.
COLOURS = {"FL": "#0072B2", "FR": "#56B4E9", "ML": "#009E73", "BL": "#D55E00", "MR": "#CC79A7", "BR": "#E69F00"}
PUBLISHED_STEP = 0.02  # s, of the runs behind the report's figures (inferred from the figures themselves)
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "grid.alpha": 0.3,
    "legend.fontsize": "small",
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.2,
}


def draw_all(recording: str | Path, folder: str | Path) -> list[Path]:
    """Draws the four figures as PNG files into the folder and returns their paths.

    Raises:
        MissingExtraError: matplotlib or h5py is not installed.
    """
    return _draw(
        recording,
        folder,
        {
            "figure-6.2-wheel-traces": wheel_traces,
            "figure-6.3-contact-distances": contact_distances,
            "figure-6.4-reaction-force": reaction_force,
            "figure-6.5-steering-angles": steering_angles,
        },
    )


def draw_rug(recording: str | Path, folder: str | Path) -> list[Path]:
    """Draws the figures of the run over the rug as PNG files into the folder and returns their paths.

    Raises:
        MissingExtraError: matplotlib or h5py is not installed.
    """
    return _draw(
        recording,
        folder,
        {
            "section-6.2-wheel-traces": rug_wheel_traces,
            "section-6.2-contact-distances": rug_contact_distances,
            "section-6.2-reaction-forces": rug_reaction_forces,
        },
    )


def _draw(
    recording: str | Path, folder: str | Path, figures: Mapping[str, Callable[[Figure, Trajectory], None]]
) -> list[Path]:
    """Draws figures, by file name, from one recording."""
    try:
        import matplotlib as mpl  # noqa: PLC0415 - only who draws needs it
        from matplotlib.figure import Figure  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "demo") from error

    trajectory = read_trajectory(recording)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        for name, draw in figures.items():
            figure = Figure(figsize=(11.0, 5.0))
            draw(figure, trajectory)
            paths.append(folder / f"{name}.png")
            figure.savefig(paths[-1])
    return paths


def wheel_traces(figure: Figure, trajectory: Trajectory) -> None:
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


def contact_distances(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.3: the six gaps against time, with a close view of the ground."""
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    _plot_wheels(ours, trajectory["time"], 100.0 * trajectory["wheel_gaps"])
    _plot_siconos(ours, "gap", 100.0)
    _plot_published(published, "fig_6_3_gaps")
    ours.set(
        title=f"ours, step {_step(trajectory)}",
        xlabel="time (s)",
        ylabel="contact distance (cm)",
        xlim=(0.0, 10.0),
        ylim=(-1.0, 5.0),
    )
    published.set(title="the report's: plane (0.15, 0, 0.15), steering +0.1 rad, step 20 ms", xlabel="time (s)")
    for axes in (ours, published):
        axes.legend(loc="upper right")
    figure.suptitle("Figure 6.3: contact distance between wheels and plane")


def reaction_force(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.4: normal force on a front wheel against time."""
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    forces = trajectory["wheel_forces"][:, :, 0]
    for wheel in ("FR", "FL"):
        ours.plot(trajectory["time"], forces[:, WHEELS.index(wheel)], color=COLOURS[wheel], label=NAMES[wheel])
    # Its percussions are in kg cm/s a step, and cut at 500; labelled FL, they are FR's.
    _plot_published(published, "fig_6_4_reaction", 0.01 / PUBLISHED_STEP, ("FR",))
    ours.set(
        title=f"ours, mean over each step of {_step(trajectory)}",
        xlabel="time (s)",
        ylabel="normal force on the wheel (N)",
        xlim=(0.0, 10.0),
        ylim=(0.0, None),
        yscale="symlog",
    )
    published.set(title="the report's: plane (0.15, 0, 0.15), step 20 ms, cut at 250 N", xlabel="time (s)")
    for axes in (ours, published):
        axes.legend(loc="upper right")
    figure.suptitle("Figure 6.4: reaction force of the front wheels")


def steering_angles(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.5: the six steering angles against time."""
    columns = [7, 8, 12, 13, 17, 18]
    ours, published = figure.subplots(1, 2, sharex=True)
    _plot_wheels(ours, trajectory["time"], trajectory["q"][:, columns])
    _plot_siconos(ours, "steering")
    _plot_published(published, "fig_6_5_steering")
    ours.set(
        title=f"ours, step {_step(trajectory)}; set-points -0.1 rad in front, else 0",
        xlabel="time (s)",
        ylabel="steering angle (rad)",
        xlim=(0.0, 10.0),
    )
    published.set(title="the report's: set-points +0.1 rad in front, torque 0.3 N m, step 20 ms", xlabel="time (s)")
    ours.legend(loc="lower right")
    published.legend(loc="right")
    figure.suptitle("Figure 6.5: steering angles under the PD controller")


def rug_wheel_traces(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: the paths of the wheel centres from above, and those of the left wheels from the side."""
    centres = trajectory["wheel_centres"]
    above, side = figure.subplots(1, 2, width_ratios=(1, 1.6))
    field = SphereField.rug()
    # The wheels lean, so they touch a little beside their centres' z.
    touching = report_model().wheel_contact_points(trajectory["q"][-1], field, coordinates="state")[:, 2]
    for (x, _, z), radius in zip(field.centres, field.radii, strict=True):
        _circle(above, z, x, radius, color="0.85")
    for i, wheel in enumerate(WHEELS):
        colour = COLOURS[wheel]
        above.plot(centres[:, i, 2], centres[:, i, 0], color=colour, label=NAMES[wheel])
        above.plot(centres[0, i, 2], centres[0, i, 0], "o", color=colour, markersize=4)
        if wheel in SIDES[0]:
            side.plot(centres[:, i, 0], centres[:, i, 1], color=colour)
            side.plot(centres[0, i, 0], centres[0, i, 1], "o", color=colour, markersize=4)
            x, y = centres[-1, i, :2]
            _circle(side, x, y, WHEEL_RADIUS, color=colour)
            across = x + np.linspace(-1.2 * WHEEL_RADIUS, 1.2 * WHEEL_RADIUS, 200)
            side.plot(across, field.heights(np.stack((across, np.full(200, touching[i])), axis=1)), color="0.4")
    above.set(title="from above; dots are the start", xlabel="to the right, z (m)", ylabel="forward, x (m)")
    side.set(
        title="the left wheels from the right; at the end, with the rug under them",
        xlabel="forward, x (m)",
        ylabel="up, y (m)",
    )
    _close_up(above, centres[..., 2], centres[..., 0], 0.7)
    _close_up(side, centres[..., 0], centres[..., 1], 0.4)
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    figure.suptitle(f"Section 6.2: traces of the wheel centres on the rug over {trajectory['time'][-1]:g} s")


def rug_contact_distances(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: the six gaps against time, left and right wheels apart."""
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, wheels, name in zip(panels, SIDES, ("left", "right"), strict=True):
        _plot_wheels(axes, trajectory["time"], 100.0 * trajectory["wheel_gaps"], wheels)
        axes.set(
            title=f"{name} wheels, step {_step(trajectory)}", xlabel="time (s)", xlim=(0.0, 25.0), ylim=(-1.0, 5.0)
        )
        axes.legend(loc="upper right")
    figure.axes[0].set_ylabel("contact distance (cm)")
    figure.suptitle("Section 6.2: contact distance between wheels and spheres")


def rug_reaction_forces(figure: Figure, trajectory: Trajectory) -> None:
    """Section 6.2: normal force on each wheel against time, left and right wheels apart."""
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, wheels, name in zip(panels, SIDES, ("left", "right"), strict=True):
        _plot_wheels(axes, trajectory["time"], trajectory["wheel_forces"][:, :, 0], wheels)
        axes.set(title=f"{name} wheels, mean over each step of {_step(trajectory)}", xlabel="time (s)", yscale="symlog")
        axes.set(xlim=(0.0, 25.0), ylim=(0.0, None))
        axes.legend(loc="upper right")
    figure.axes[0].set_ylabel("normal force on the wheel (N)")
    figure.suptitle("Section 6.2: reaction forces of the wheels")


def _circle(axes: Axes, x: float, y: float, radius: float, color: str) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    axes.plot(x + radius * np.cos(turn), y + radius * np.sin(turn), color=color, linewidth=0.8)


def _close_up(axes: Axes, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], margin: float) -> None:
    """Shows the traces with a margin (m), at one scale; what lies beyond is cut."""
    axes.set_xlim(x.min() - margin, x.max() + margin)
    axes.set_ylim(y.min() - margin, y.max() + margin)
    axes.set_aspect("equal", adjustable="box")


def _plot_wheels(axes: Axes, time: Any, values: Any, wheels: tuple[str, ...] = WHEELS) -> None:
    for wheel in wheels:
        i = WHEELS.index(wheel)
        axes.plot(time, values[:, i], color=COLOURS[wheel], label=NAMES[wheel])


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


def _step(trajectory: Trajectory) -> str:
    return f"{1e3 * trajectory.attributes['solver']['time_step']:g} ms"
