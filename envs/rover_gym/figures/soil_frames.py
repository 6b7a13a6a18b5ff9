"""Pictures of a soil run: disks, wheels and force chains at one time, or the whole run as a video."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.extras import MissingExtraError, require

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rover_gym.soil.soil_run import SoilRun

__all__ = ["draw_soil", "film_soil"]

SAND, SLEEPING, GRAIN_EDGE = "#d8c39a", "#c3c3c3", "#8a744a"
CHAIN, WHEEL, BODY = "#b3321b", "#4a5560", "#2f6f9f"
WIDTH = 12.0  # inches
MARGIN = 0.02  # m about the soil


def draw_soil(run: SoilRun, path: str | Path, *, row: int = -1) -> Path:
    """Draws one sample; a red line's width scales with the root of the contact's mean force since the previous sample.

    Args:
        run: The run.
        path: Image file to write.
        row: Index of the sample; negative indices count from the end.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure, axes = _sheet(run)
    _paint(axes, run, row)
    figure.savefig(path, dpi=100)
    return Path(path)


def film_soil(run: SoilRun, path: str | Path, *, frames_per_second: int = 25) -> Path:
    """Writes all samples of a run to an MP4 video (H.264).

    Raises:
        MissingExtraError: matplotlib or imageio-ffmpeg is not installed.
    """
    figure, axes = _sheet(run)
    encoder = require("imageio_ffmpeg", "render")
    from matplotlib import rc_context  # noqa: PLC0415 - an extra
    from matplotlib.animation import FFMpegWriter  # noqa: PLC0415 - an extra

    with rc_context({"animation.ffmpeg_path": encoder.get_ffmpeg_exe()}):
        # yuv420p halves both sides of the picture, so both must be even.
        even = ["-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-pix_fmt", "yuv420p"]
        writer = FFMpegWriter(fps=frames_per_second, codec="libx264", extra_args=even)
        with writer.saving(figure, str(path), dpi=100):
            for row in range(run.n_frames):
                _paint(axes, run, row)
                writer.grab_frame()
    return Path(path)


def _sheet(run: SoilRun) -> tuple[Figure, Axes]:
    """A figure of the scene's shape, and its axes, with the limits of the whole run."""
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "demo") from error
    x, top = run.positions[0, :, 0], run.positions[..., 1] + run.radius
    left, right = float((x - run.radius).min()) - MARGIN, float((x + run.radius).max()) + MARGIN
    height = max(float(top.max()), float((run.wheels[..., 1] + run.wheels[..., 2]).max(initial=0.0))) + 2.0 * MARGIN
    figure = Figure(figsize=(WIDTH, WIDTH * (height + MARGIN) / (right - left) + 0.7), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(left, right), ylim=(-MARGIN, height), aspect="equal", xlabel="x, m", ylabel="y, m")
    axes.autoscale(enable=False)
    return figure, axes


def _paint(axes: Axes, run: SoilRun, row: int) -> None:
    from matplotlib.collections import EllipseCollection, LineCollection  # noqa: PLC0415 - an extra
    from matplotlib.patches import Circle  # noqa: PLC0415 - an extra

    for artist in [*axes.collections, *axes.patches, *axes.lines]:
        artist.remove()
    x, y, angle = run.positions[row].T
    centres, size = run.positions[row, :, :2], 2.0 * run.radius
    axes.add_collection(
        EllipseCollection(
            size,
            size,
            np.zeros(len(size)),
            units="xy",
            offsets=centres,
            offset_transform=axes.transData,
            facecolors=[SLEEPING if asleep else SAND for asleep in run.asleep[row]],
            edgecolors=GRAIN_EDGE,
            linewidths=0.4,
        )
    )
    # A mark on each disk shows its rotation.
    tips = np.stack((x + run.radius * np.cos(angle), y + run.radius * np.sin(angle)), axis=1)
    axes.add_collection(LineCollection(list(np.stack((centres, tips), axis=1)), colors=GRAIN_EDGE, linewidths=0.4))
    chains = run.force_chains[row]
    widths = 6.0 * np.sqrt(chains[:, 4] / max(_bearing(run), 1e-9))
    lines = list(chains[:, :4].reshape(-1, 2, 2))
    axes.add_collection(LineCollection(lines, colors=CHAIN, linewidths=widths, capstyle="round", zorder=4))
    for (cx, cy, r), turn in zip(run.wheels[row], run.wheel_angles[row], strict=True):
        axes.add_patch(Circle((cx, cy), r, facecolor="#00000018", edgecolor=WHEEL, linewidth=2.0, zorder=3))
        for a in turn + np.pi / 3.0 * np.arange(3):
            dx, dy = r * np.cos(a), r * np.sin(a)
            axes.plot([cx - dx, cx + dx], [cy - dy, cy + dy], color=WHEEL, linewidth=0.8, zorder=3)
    axes.plot(run.wheels[row, :, 0], run.wheels[row, :, 1], color=BODY, linewidth=6.0, solid_capstyle="round", zorder=5)
    axes.axhline(0.0, color="black", linewidth=1.0)
    axes.set_title(f"t = {run.time[row]:.2f} s", loc="left", fontsize=9)


def _bearing(run: SoilRun) -> float:
    """Force scale of the chains, N: the largest load that a wheel carried most of the time."""
    loads: npt.NDArray[np.float64] = np.linalg.norm(run.wheel_forces[1:], axis=-1)
    return float(np.median(loads, axis=0).max()) if loads.size else float(run.force_chains[..., 4].max())
