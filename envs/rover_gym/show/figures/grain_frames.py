"""Pictures of a run of balls in space or of a drive: one sample, or the whole run as a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import Plane
from rover_gym.core.extras import MissingExtraError, require
from rover_gym.core.files import written_whole
from rover_gym.record.rover_run import RoverRun
from rover_gym.show.figures.rover_film import Film, RoverFilm, ShownSample
from rover_gym.show.frames import FrameRenderer, VideoWriter
from rover_gym.show.frames.appearance import GROUND_COLOUR, ROCK_COLOUR
from rover_gym.show.frames.render_options import whole_film
from rover_gym.show.replay.grain_scene import eye_path, floor_of, start_view, tile_of
from rover_gym.show.replay.scenery import vessel_meshes, vessel_poses, wall_polygons, wall_poses

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rover_gym.record.disk_run import DiskRun
    from rover_gym.record.grain_run import GrainRun


__all__ = ["draw_disks", "draw_grains", "film_disks", "film_run"]

SIZE = 960, 540  # pixels

Array = npt.NDArray[np.float64]


class GrainFilm(Film):
    """Draws the samples of a run of balls.

    Args:
        run: The run.
        size: Width and height, pixels, even.

    Raises:
        MissingExtraError: VTK is not installed.
        OSError: No OpenGL library works on this machine.
    """

    def __init__(self, run: GrainRun, size: tuple[int, int] = SIZE) -> None:
        try:
            from rover_gym.show.frames.frame_renderer import BedRenderer  # noqa: PLC0415 - an extra
            from rover_gym.show.frames.scenery_actors import BallsActor, GroundActors  # noqa: PLC0415 - an extra
            from rover_gym.show.frames.shading import SoilShading  # noqa: PLC0415 - an extra
            from rover_gym.show.frames.vtk_actors import actor_of, mesh, set_pose  # noqa: PLC0415 - an extra
        except ModuleNotFoundError as error:
            raise MissingExtraError("vtk", "render") from error
        self._run, self._set_pose = run, set_pose
        self._balls = BallsActor(run.radius, run.kinematic)
        self._walls = []
        walls = wall_polygons(run, GROUND_COLOUR, ROCK_COLOUR)
        vessel = vessel_meshes(run, ROCK_COLOUR, GROUND_COLOUR)
        for colour, vertices, triangles in walls + vessel:
            wall = actor_of(mesh(vertices, triangles, np.broadcast_to(np.array(colour), vertices.shape), smooth=False))
            wall.GetProperty().BackfaceCullingOn()  # a wall hides nothing that is behind it
            self._walls.append(wall)
        of_vessel = np.repeat(vessel_poses(run)[:, None], len(vessel), axis=1)
        self._poses = np.concatenate((wall_poses(run), of_vessel), axis=1)
        self._path, self._view = eye_path(run), start_view(run)
        actors = [self._balls.actor, *self._walls]
        width, height = size
        if run.rover is None:
            floor, soil = floor_of(run), SoilShading(tile_of(run))
            if floor is not None:
                point, normal = floor
                actors.append(GroundActors(Plane(normal.tolist(), -float(point @ normal)), soil).actor)
            self._renderer = BedRenderer(actors, soil, width=width, height=height)
            return
        self._renderer = FrameRenderer(run.rover.model, run.rover.terrain, width=width, height=height)
        self._renderer.shade(self._balls)
        for actor in self._walls:
            self._renderer.add(actor)

    def frame(self, row: int) -> npt.NDArray[np.uint8]:
        """An image (height, width, 3) uint8 of a sample; negative rows count from the end."""
        run, row = self._run, range(self._run.n_frames)[row]
        self._balls.place(run.positions_of(run.rows[row : row + 1])[0])
        for wall, pose in zip(self._walls, self._poses[row], strict=True):
            self._set_pose(wall, _matrix(pose))
        if run.rover is None:
            eye, target = (np.array(place) + self._path[row] for place in self._view[:2])
            return np.asarray(self._renderer.render(eye, target, self._view.angle))
        return np.asarray(self._renderer.render(ShownSample.of(run.rover, row)))


def draw_grains(run: GrainRun, path: str | Path, *, row: int = -1, size: tuple[int, int] = SIZE) -> Path:
    """Draws one sample as a PNG.

    Args:
        run: The run.
        path: Image file to write.
        row: Index of the sample; negative indices count from the end.
        size: Width and height, pixels, even.

    Raises:
        MissingExtraError: VTK or matplotlib is not installed.
    """
    with GrainFilm(run, size) as film:
        image = film.frame(row)
    with written_whole(path) as draft:
        require("matplotlib.image", "demo").imsave(draft, image, format="png")
    return Path(path)


def film_run(
    run: GrainRun | RoverRun,
    path: str | Path,
    fps: float = 25.0,
    *,
    size: tuple[int, int] = SIZE,
    progress: Callable[[int], None] = lambda _: None,
) -> Path:
    """Writes a run of balls or a drive as an MP4 video (H.264) in its own time.

    Args:
        run: The run; of samples that come faster than the frames some are left out.
        path: Video file to write.
        fps: Frames per second.
        size: Width and height, pixels, even.
        progress: Called with the number of frames drawn.

    Raises:
        OptionError: The file name has another extension, or `fps` is not positive.
        MissingExtraError: VTK or imageio-ffmpeg is not installed.
    """
    shown = run.resample(fps)
    # A run that was sampled more coarsely plays at the rate of its samples.
    lasts = float(shown.time[-1] - shown.time[0])
    rate = min(fps, (shown.n_frames - 1) / lasts) if lasts > 0.0 else fps
    drawn: Film = RoverFilm(shown, size) if isinstance(shown, RoverRun) else GrainFilm(shown, size)
    with VideoWriter(path, rate) as video, drawn as film:
        for row in range(shown.n_frames):
            video.append(film.frame(row))
            progress(row + 1)
    return Path(path)


def _matrix(pose: Array) -> Array:
    """(4, 4) homogeneous matrix of a place and a quaternion x, y, z, w."""
    x, y, z, w = pose[3:]
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.eye(4)
    matrix[:3, :3] += 2.0 * (w * K + K @ K)
    matrix[:3, 3] = pose[:3]
    return matrix


SAND, SLEEPING, GRAIN_EDGE = "#d8c39a", "#c3c3c3", "#8a744a"

CHAIN, WHEEL, BODY = "#b3321b", "#4a5560", "#2f6f9f"

WIDTH = 12.0  # inches

MARGIN = 0.02  # m about the disks


def draw_disks(run: DiskRun, path: str | Path, *, row: int = -1) -> Path:
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
    with written_whole(path) as draft:
        figure.savefig(draft, dpi=100)
    return Path(path)


def film_disks(run: DiskRun, path: str | Path, *, frames_per_second: int = 25) -> Path:
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
        with whole_film(path) as draft, writer.saving(figure, str(draft), dpi=100):
            for row in range(run.n_frames):
                _paint(axes, run, row)
                writer.grab_frame()
    return Path(path)


def _sheet(run: DiskRun) -> tuple[Figure, Axes]:
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


def _paint(axes: Axes, run: DiskRun, row: int) -> None:
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


def _bearing(run: DiskRun) -> float:
    """Force scale of the chains, N: the largest load that a wheel carried most of the time."""
    loads: npt.NDArray[np.float64] = np.linalg.norm(run.wheel_forces[1:], axis=-1)
    return float(np.median(loads, axis=0).max()) if loads.size else float(run.force_chains[..., 4].max())
