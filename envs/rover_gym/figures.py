"""The report's figures 6.2 to 6.5, drawn from a recorded run.

Ours in colour, one colour a wheel; a Siconos run of the same scene dashed in black where it exists; the report's own
curves in grey or in a panel of their own, since they were made with other parameters (the data's `meta` says which).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rover_gym.recording import MissingExtraError, Trajectory, read_trajectory
from rover_gym.report import reference_data

if TYPE_CHECKING:
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
        for name, draw in (
            ("figure-6.2-wheel-traces", wheel_traces),
            ("figure-6.3-contact-distances", contact_distances),
            ("figure-6.4-reaction-force", reaction_force),
            ("figure-6.5-steering-angles", steering_angles),
        ):
            figure = Figure(figsize=(11.0, 5.0))
            draw(figure, trajectory)
            paths.append(folder / f"{name}.png")
            figure.savefig(paths[-1])
    return paths


def wheel_traces(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.2: the paths of the six wheel centres, from above and in the report's perspective."""
    centres = trajectory["wheel_centres"]
    above, perspective = figure.subplots(1, 2)
    for i, wheel in enumerate(WHEELS):
        above.plot(-centres[:, i, 2], centres[:, i, 0], color=COLOURS[wheel], label=NAMES[wheel])
        above.plot(-centres[0, i, 2], centres[0, i, 0], "o", color=COLOURS[wheel], markersize=4)
        perspective.plot(*_on_the_page(100.0 * centres[:, i].T), color=COLOURS[wheel])
    above.set(title="from above; dots: the start", xlabel="to the left, -z (m)", ylabel="forward, x (m)")
    above.invert_xaxis()
    above.set_aspect("equal", adjustable="datalim")
    above.legend(title="wheel centre")

    published = reference_data()["published"]["fig_6_2_wheel_traces"]["curves"]
    for n, curve in enumerate(published.values()):
        px, py = np.array(curve).T
        perspective.plot(
            px, py, color="0.55", linewidth=0.9, linestyle="--", label="" if n else "the report's (other parameters)"
        )
    perspective.set(
        title="in the report's perspective", xlabel="across its page (points)", ylabel="up its page (points)"
    )
    perspective.legend()
    figure.suptitle(f"Figure 6.2: traces of the wheels over {_duration(trajectory)}")


def contact_distances(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.3: the six gaps against time, with a close view of the ground."""
    gaps = 100.0 * trajectory["wheel_gaps"]
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    for i, wheel in enumerate(WHEELS):
        ours.plot(trajectory["time"], gaps[:, i], color=COLOURS[wheel], label=NAMES[wheel])
    reference = _finest_siconos()
    for i in range(len(WHEELS)):
        ours.plot(
            reference["t"],
            100.0 * np.array(reference["gap"])[:, i],
            "k:",
            linewidth=0.9,
            label="" if i else f"Siconos 4.4, step {1e3 * reference['step']:g} ms",
        )
    for n, curve in enumerate(reference_data()["published"]["fig_6_3_gaps"]["curves"].values()):
        k, gap = np.array(curve).T
        published.plot(PUBLISHED_STEP * k, gap, color=COLOURS[WHEELS[n]])
    ours.set(title=f"ours, step {_step(trajectory)}", xlabel="time (s)", ylabel="contact distance (cm)")
    published.set(title="the report's: plane (0.15, 0, 0.15), steering +0.1 rad, step 20 ms", xlabel="time (s)")
    ours.set(ylim=(-1.0, 5.0), xlim=(0.0, min(20.0, trajectory["time"][-1])))
    ours.legend()
    figure.suptitle("Figure 6.3: contact distance between wheels and plane")


def reaction_force(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.4: normal force on a front wheel against time."""
    ours, published = figure.subplots(1, 2, sharey=True, sharex=True)
    for wheel in ("FL", "FR"):
        force = trajectory["wheel_forces"][:, WHEELS.index(wheel), 0]
        ours.plot(trajectory["time"], force, color=COLOURS[wheel], label=NAMES[wheel])
    (curve,) = reference_data()["published"]["fig_6_4_reaction"]["curves"].values()
    k, percussion = np.array(curve).T
    # The report's percussion is in kg cm/s a step; it is labelled FL, its code writes FR.
    published.plot(PUBLISHED_STEP * k, 0.01 * percussion / PUBLISHED_STEP, color=COLOURS["FR"])
    ours.set(
        title=f"ours, mean over each step of {_step(trajectory)}",
        xlabel="time (s)",
        ylabel="normal force on the wheel (N)",
    )
    published.set(title="the report's front wheel: other parameters, step 20 ms, cut at 250 N", xlabel="time (s)")
    ours.set(yscale="symlog")
    ours.legend()
    figure.suptitle("Figure 6.4: reaction force of the front wheels")


def steering_angles(figure: Figure, trajectory: Trajectory) -> None:
    """Figure 6.5: the six steering angles against time."""
    columns = [7, 8, 12, 13, 17, 18]
    ours, published = figure.subplots(1, 2)
    for i, wheel in enumerate(WHEELS):
        ours.plot(trajectory["time"], trajectory["q"][:, columns[i]], color=COLOURS[wheel], label=NAMES[wheel])
    for n, curve in enumerate(reference_data()["published"]["fig_6_5_steering"]["curves"].values()):
        k, angle = np.array(curve).T
        published.plot(PUBLISHED_STEP * k, angle, color=COLOURS[WHEELS[n]])
    ours.legend()
    figure.suptitle("Figure 6.5: steering angles under the PD controller")


def _on_the_page(centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The report's perspective of points (3, n) in cm, recovered from its figure 6.2 (points of its page)."""
    x, y, z = centres
    px = 2625.0 + 2.51143 * (x + 1200.0) - 2.61 * (z + 500.0)
    py = 1234.0 + 0.447143 * (x + 1200.0) + 2.34333 * (z + 500.0) + 8.5125 * (y + 80.0)
    return px, py


def _finest_siconos() -> Any:
    return min(reference_data()["siconos"], key=lambda run: run["step"])


def _duration(trajectory: Trajectory) -> str:
    return f"{trajectory['time'][-1]:g} s"


def _step(trajectory: Trajectory) -> str:
    return f"{1e3 * trajectory.attributes['solver']['time_step']:g} ms"
