"""Pictures of a run of balls in space: one sample, or the whole run as a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.extras import MissingExtraError, require
from rover_gym.rendering import FrameRenderer, VideoWriter
from rover_gym.rendering.appearance import GROUND_COLOUR, ROCK_COLOUR
from rover_gym.replay.grain_eye import eye_path, start_view
from rover_gym.replay.vessel_meshes import vessel_meshes, vessel_poses
from rover_gym.replay.wall_polygons import wall_polygons, wall_poses

if TYPE_CHECKING:
    from collections.abc import Callable

    from rover_gym.grains.grain_run import GrainRun

__all__ = ["draw_grains", "film_grains"]

SIZE = 960, 540  # pixels

Array = npt.NDArray[np.float64]


class _Shown(NamedTuple):
    """A sample of a run in the words of a simulation, for the renderer of rovers."""

    time: float
    q: Array
    gravity: Array
    rotation: Array
    solids: dict[str, tuple[Array, Array]]

    def poses(self) -> dict[str, tuple[Array, Array]]:
        return self.solids


class GrainFilm:
    """Draws the samples of a run; a context manager.

    Args:
        run: The run.
        size: Width and height, pixels, even.

    Raises:
        MissingExtraError: VTK is not installed.
        OSError: No OpenGL library works on this machine.
    """

    def __init__(self, run: GrainRun, size: tuple[int, int] = SIZE) -> None:
        try:
            from rover_gym.rendering.ball_actors import BallsActor  # noqa: PLC0415 - an extra
            from rover_gym.rendering.bed_frames import BedRenderer  # noqa: PLC0415 - an extra
            from rover_gym.rendering.meshes import actor_of, mesh, set_pose  # noqa: PLC0415 - an extra
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
            self._renderer: Any = BedRenderer(actors, width=width, height=height)
            return
        self._renderer = FrameRenderer(run.rover.model, run.rover.terrain, width=width, height=height)
        for actor in actors:
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
        rover, solver = run.rover, run.trajectory.attributes.get("solver", {})
        names = rover.model.solid_names
        solids = dict(zip(names, zip(rover.positions[row], rover.rotations[row], strict=True), strict=True))
        gravity = np.array(solver.get("gravity", (0.0, -9.81, 0.0)))
        turn = rover.rotations[row, names.index("trunk") if "trunk" in names else 0]
        shown = _Shown(float(run.time[row]), run.trajectory["q"][row], gravity, turn, solids)
        return np.asarray(self._renderer.render(shown))

    def __enter__(self) -> GrainFilm:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()


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
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    require("matplotlib.image", "demo").imsave(path, image, format="png")
    return path


def film_grains(
    run: GrainRun,
    path: str | Path,
    fps: float = 25.0,
    *,
    size: tuple[int, int] = SIZE,
    progress: Callable[[int], None] = lambda _: None,
) -> Path:
    """Writes a run as an MP4 video (H.264) in its own time.

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
    rate = min(fps, (shown.n_frames - 1) / float(shown.time[-1] - shown.time[0])) if shown.n_frames > 1 else fps
    with VideoWriter(path, rate) as video, GrainFilm(shown, size) as film:
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
