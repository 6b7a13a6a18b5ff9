"""Pictures of a soil: disks, wheels, force chains; the crossing as a video; slip, sinkage and drawbar pull."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym._core import SoilSimulation
from rover_gym.extras import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Frame", "draw_curves", "draw_soil", "film_soil", "frame_of"]

SAND, CHAIN, WHEEL, BODY = "#d8c39a", "#b3321b", "#4a5560", "#2f6f9f"


def _figure(width: float, height: float) -> Figure:
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "demo") from error
    return Figure(figsize=(width, height), layout="constrained")


class Frame:
    """What a picture shows of a soil at one time.

    Args:
        sim: The soil.
    """

    def __init__(self, sim: SoilSimulation) -> None:
        contacts = sim.contacts
        self.time = sim.time
        self.position = sim.position
        self.radius = sim.radius
        self.asleep = sim.asleep
        self.wheels = sim.wheels
        self.machine = sim.machine
        self.walls_right = float((self.position[:, 0] + self.radius).max())
        self.chains = _chains(sim, contacts.bodies, contacts.points)
        self.forces = np.linalg.norm(contacts.impulses, axis=1) / sim.time_step


def frame_of(sim: SoilSimulation) -> Frame:
    """The soil as it is now."""
    return Frame(sim)


def _chains(
    sim: SoilSimulation, bodies: npt.NDArray[np.int64], points: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """(n, 2, 2) a line for each contact: from centre to centre, or to the point on what does not move."""
    centres = np.concatenate((sim.position[:, :2], sim.wheels[:, :2]))
    is_wheel = bodies[:, 0] >= len(sim.radius)
    first = np.where(is_wheel[:, None], points, centres[bodies[:, 0]])
    second = np.where(bodies[:, 1:] < 0, points, centres[bodies[:, 1]])
    return np.stack((first, second), axis=1)


def _paint(axes: Axes, frame: Frame, strongest: float) -> None:
    from matplotlib.collections import EllipseCollection, LineCollection  # noqa: PLC0415 - an extra
    from matplotlib.patches import Circle  # noqa: PLC0415 - an extra

    axes.clear()
    size = 2.0 * frame.radius
    axes.add_collection(
        EllipseCollection(
            size,
            size,
            np.zeros(len(size)),
            units="xy",
            offsets=frame.position[:, :2],
            offset_transform=axes.transData,
            facecolors=[SAND if not asleep else "#c3c3c3" for asleep in frame.asleep],
            edgecolors="#8a744a",
            linewidths=0.4,
        )
    )
    # A mark on each disk shows how it turns.
    x, y, angle = frame.position.T
    tips = np.stack((x + frame.radius * np.cos(angle), y + frame.radius * np.sin(angle)), axis=1)
    axes.add_collection(
        LineCollection(list(np.stack((frame.position[:, :2], tips), axis=1)), colors="#8a744a", linewidths=0.4)
    )
    widths = 5.0 * np.sqrt(frame.forces / strongest)
    axes.add_collection(LineCollection(list(frame.chains), colors=CHAIN, linewidths=widths, capstyle="round", zorder=4))
    for k, (cx, cy, r) in enumerate(frame.wheels):
        axes.add_patch(Circle((cx, cy), r, facecolor="#00000018", edgecolor=WHEEL, linewidth=2.0, zorder=3))
        turn = frame.machine[3 + k] if len(frame.machine) == 5 else 0.0
        for spoke in range(3):
            a = turn + spoke * np.pi / 3.0
            dx, dy = r * np.cos(a), r * np.sin(a)
            axes.plot([cx - dx, cx + dx], [cy - dy, cy + dy], color=WHEEL, linewidth=0.8, zorder=3)
    if len(frame.wheels) == 2:
        axes.plot(frame.wheels[:, 0], frame.wheels[:, 1], color=BODY, linewidth=6.0, solid_capstyle="round", zorder=5)
    axes.axhline(0.0, color="black", linewidth=1.0)
    top = max(float((y + frame.radius).max()), float((frame.wheels[:, 1] + frame.wheels[:, 2]).max(initial=0.0)))
    axes.set_xlim(-0.02, frame.walls_right + 0.02)
    axes.set_ylim(-0.03, top + 0.05)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(f"t = {frame.time:.2f} s", loc="left", fontsize=9)


def _strongest(frames: Sequence[Frame]) -> float:
    return max(float(frame.forces.max(initial=1e-9)) for frame in frames)


def draw_soil(frame: Frame, path: str | Path) -> Path:
    """Draws one picture; the width of a red line goes with the root of the contact's force.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = _figure(12.0, 4.6)
    _paint(figure.subplots(), frame, _strongest([frame]))
    figure.savefig(path, dpi=100)
    return Path(path)


def film_soil(frames: Sequence[Frame], path: str | Path, *, frames_per_second: int = 25) -> Path:
    """Writes the frames as an MP4 video (H.264).

    Raises:
        MissingExtraError: matplotlib or imageio-ffmpeg is not installed.
    """
    figure = _figure(12.0, 4.6)
    try:
        import imageio_ffmpeg  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise MissingExtraError("imageio-ffmpeg", "render") from error
    from matplotlib import rc_context  # noqa: PLC0415 - an extra
    from matplotlib.animation import FFMpegWriter  # noqa: PLC0415 - an extra

    strongest = _strongest(frames)
    axes = figure.subplots()
    with rc_context({"animation.ffmpeg_path": imageio_ffmpeg.get_ffmpeg_exe()}):
        writer = FFMpegWriter(fps=frames_per_second, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])
        with writer.saving(figure, str(path), dpi=80):
            for frame in frames:
                _paint(axes, frame, strongest)
                writer.grab_frame()
    return Path(path)


def draw_curves(drives: Sequence[dict[str, float]], pulls: Sequence[dict[str, float]], path: str | Path) -> Path:
    """Draws slip and sinkage against torque, and the drawbar pull against slip.

    Args:
        drives: What `slip_on_soil` told, by torque.
        pulls: What `drawbar_pull` told, by slip.
        path: PNG file.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = _figure(13.0, 4.2)
    slip, sinkage, pull = figure.subplots(1, 3)
    torque = [drive["torque"] for drive in drives]
    slip.plot(torque, [drive["slip"] for drive in drives], "o-")
    slip.set(xlabel="torque of each wheel, N m", ylabel="slip over the run")
    sinkage.plot(torque, [1e3 * drive["sinkage"] for drive in drives], "o-")
    sinkage.set(xlabel="torque of each wheel, N m", ylabel="mean sinkage, mm")
    slips, means = [p["slip"] for p in pulls], [p["pull"] for p in pulls]
    pull.errorbar(slips, means, yerr=[p["error"] for p in pulls], fmt="o-", capsize=3)
    pull.axhline(0.0, color="black", linewidth=0.8)
    pull.set(xlabel="slip", ylabel="drawbar pull of one wheel, N")
    figure.savefig(path, dpi=100)
    return Path(path)
