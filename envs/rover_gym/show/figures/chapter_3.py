"""Figures 3.2 to 3.5 of the report: the ball on a line and on a sine.

The report's ball makes contact with its centre; for comparison, a second ball makes contact with its rim.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.record.saved_runs import record_run
from rover_gym.record.trajectory import Trajectory, read_trajectory
from rover_gym.scenes.report_scenes import ball_on_incline, ball_on_sine, published
from rover_gym.show.figures.planar_drawing import GROUND
from rover_gym.show.figures.style import circle, save_figures
from rover_gym.show.frames.appearance import PLANAR_WHEEL_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STEP = 0.0005  # s, of the report's runs
RIM, PUBLISHED = "#009E73", "0.55"
OURS, FRICTION = PLANAR_WHEEL_COLOURS[1], PLANAR_WHEEL_COLOURS[0]


def draw_chapter_3(folder: str | Path) -> list[Path]:
    """Runs both examples, records them and draws figures 3.2 to 3.5 as PNG files; returns their paths.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    folder = Path(folder)
    runs: dict[str, tuple[Trajectory, Trajectory]] = {}
    for name, scene in (("incline", ball_on_incline), ("sine", ball_on_sine)):
        pair = []
        for contact in ("centre_height", "nearest"):
            sim, duration = scene(contact)
            path = folder / f"ball-{name}-{contact.replace('_', '-')}.h5"
            # Impulses are those of a row's last step, drawn for the report's contact rule only.
            fps = None if contact == "centre_height" else 0.1 / sim.time_step
            record_run(sim, duration, path, fps, title=f"chapter 3 of the report: ball, {name}")
            pair.append(read_trajectory(path))
        runs[name] = (pair[0], pair[1])
    return save_figures(
        {
            "figure-3.2-ball-on-a-line": lambda figure: _incline_path(figure, *runs["incline"]),
            "figure-3.3-speed-and-impulses": lambda figure: _incline_curves(figure, runs["incline"][0]),
            "figure-3.4-ball-on-a-sine": lambda figure: _sine_path(figure, *runs["sine"]),
            "figure-3.5-speed-and-impulses": lambda figure: _sine_curves(figure, runs["sine"][0]),
        },
        folder,
    )


def _curve(figure: str, curve: str) -> npt.NDArray[np.float64]:
    """A published curve as (2, n)."""
    return np.array(published()[figure]["curves"][curve]).T


def _plot_published(axes: Axes, figure: str) -> None:
    axes.plot(*_curve(figure, "Ball position"), color=PUBLISHED, linewidth=3.0, label="the report's")


def _incline_path(figure: Figure, centre: Trajectory, rim: Trajectory) -> None:
    whole, begin = figure.subplots(1, 2)
    x = np.array([0.0, 190.0])
    for axes in (whole, begin):
        axes.plot(x, -0.5 * x + 0.5, color=GROUND, label="ground, y = -x/2 + 1/2")
        _plot_published(axes, "fig_3_2_ball_incline")
        axes.plot(*centre["q"][:, :2].T, color=OURS, label="ours, centre stops at the ground")
        axes.plot(*rim["q"][:, :2].T, color=RIM, linestyle="--", label="ours, rim touches")
        axes.set(xlabel="x (m)", ylabel="y (m)")
    whole.set(title="12 s")
    begin.set(title="the first bounces", xlim=(4.0, 40.0), ylim=(-20.0, 11.0))
    whole.legend(loc="upper right")
    figure.suptitle("Figure 3.2: a ball on an inclined line, from (5, 10)")


def _incline_curves(figure: Figure, centre: Trajectory) -> None:
    speed, impulses = figure.subplots(1, 2)
    name = "fig_3_3_ball_incline_velocity_forces"
    _against(speed, name, "Ball Velocity", centre["time"], _speed_of(centre), OURS, "speed, ours")
    normal, tangential = centre["impulses"][:, 0].T
    _against(impulses, name, "reaction", centre["time"], normal, OURS, "reaction, ours")
    _against(impulses, name, "friction", centre["time"], tangential, FRICTION, "friction, ours")
    speed.set(title="speed of the centre", xlabel="time (s)", ylabel="speed (m/s)")
    impulses.set(title="impulses of a step of 0.5 ms", xlabel="time (s)", ylabel="impulse (N s)")
    for axes in (speed, impulses):
        axes.legend()
    figure.suptitle("Figure 3.3: speed, reaction and friction of the ball on the line")


def _sine_path(figure: Figure, centre: Trajectory, rim: Trajectory) -> None:
    axes = figure.subplots()
    x = np.linspace(-5.0, 2.0, 400)
    axes.plot(x, np.sin(x), color=GROUND, label="ground, y = sin x")
    _plot_published(axes, "fig_3_4_ball_sine")
    axes.plot(*centre["q"][:, :2].T, color=OURS, label="ours, centre stops at the ground")
    axes.plot(*rim["q"][:, :2].T, color=RIM, linestyle="--", label="ours, rim touches, from 1.5 m higher")
    _outlines(axes, rim)
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(-5.0, 2.0))
    axes.set_aspect("equal", adjustable="box")
    figure.legend(loc="outside lower center", ncols=2, title="circles: the ball at start and end", title_fontsize=9.0)
    figure.suptitle("Figure 3.4: a ball on a sine over 10 s, from (-2.5, 1)")


def _outlines(axes: Axes, rim: Trajectory) -> None:
    """Draws the ball that touches with its rim, at the start and where it has come to rest."""
    radius = float(rim.attributes["scene"]["machine"]["radius"])
    for row in (0, -1):
        x, y, angle = rim["q"][row]
        circle(axes, x, y, radius, color=RIM)
        axes.plot([x, x + radius * np.cos(angle)], [y, y + radius * np.sin(angle)], color=RIM, linewidth=0.8)


def _sine_curves(figure: Figure, centre: Trajectory) -> None:
    speed, impulses = figure.subplots(1, 2)
    name = "fig_3_5_ball_sine_velocity_forces"
    _against(speed, name, "Velocity", centre["time"], _speed_of(centre), OURS, "speed, ours", STEP)
    normal, tangential = centre["impulses"][:, 0].T
    _against(impulses, name, "Reaction", centre["time"], normal, OURS, "reaction, ours", STEP)
    _against(impulses, name, "Friction", centre["time"], tangential, FRICTION, "friction, ours", STEP)
    speed.set(title="speed of the centre", xlabel="time (s)", ylabel="speed (m/s)")
    impulses.set(
        title="impulses of a step of 0.5 ms\nthe report's frame was up to 1.4 times too short",
        xlabel="time (s)",
        ylabel="impulse (N s)",
    )
    for axes in (speed, impulses):
        axes.legend()
    figure.suptitle("Figure 3.5: speed, reaction and friction of the ball on the sine")


def _against(
    axes: Axes,
    figure: str,
    curve: str,
    time: npt.NDArray[np.float64],
    ours: npt.NDArray[np.float64],
    colour: str,
    label: str,
    scale: float = 1.0,
) -> None:
    """Our curve over the report's; `scale` converts its abscissa to seconds."""
    t, value = _curve(figure, curve)
    is_first = not axes.lines
    axes.plot(scale * t, value, color=PUBLISHED, linewidth=3.0, alpha=0.7, label="the report's" if is_first else "")
    axes.plot(time, ours, color=colour, label=label)


def _speed_of(trajectory: Trajectory) -> npt.NDArray[np.float64]:
    """Speed of the ball's centre, (n,), m/s."""
    return np.linalg.norm(trajectory["v"][:, :2], axis=1)  # type: ignore[no-any-return]
