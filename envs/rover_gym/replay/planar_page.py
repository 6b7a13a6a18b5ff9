"""Export of a planar run as a browser page: a ball or a two-wheel rover over its ground, with a timeline and curves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import Polyline
from rover_gym.rendering.appearance import (
    AXLE_COLOUR,
    GROUND_COLOUR,
    GROUND_COLOUR_2,
    PLANAR_WHEEL_COLOURS,
    Colour,
    Part,
)
from rover_gym.replay.panel import FOLLOW_TIME, Chart, load_chart, moving_mean, panel_contents, with_panel
from rover_gym.replay.player import add_meshes, add_surroundings, hidden_server, shortened
from rover_gym.replay.soil_page import about_z, surface_mesh, wheel_meshes
from rover_gym.validation import checked

if TYPE_CHECKING:
    from rover_gym.planar.planar_run import PlanarRun

SEEN = 9.0  # width of the picture, in diameters of the largest disc
ASPECT = 1.5  # width over height of the picture
FIELD_OF_VIEW = 0.35  # rad, vertical
LAND = 1.5  # picture widths of ground beyond the way
TILE = 0.5  # m, length of the ground's squares
THICK = 0.4  # of a disc along its axle, in its radii

Array = npt.NDArray[np.float64]


@checked(run="PlanarRun", path=Path, follow=bool)
def write_planar_page(run: PlanarRun, path: str | Path, *, follow: bool = True) -> Path:
    """Writes a planar run as a single browser page.

    Args:
        run: The run; every sample becomes a frame of the replay.
        path: The file to write, usually `.html`. Its folder is created.
        follow: Whether the eye follows the machine; otherwise the ground stays fixed.

    Raises:
        MissingExtraError: viser is not installed.
        OSError: The file cannot be written.
    """
    with hidden_server() as server:
        scene = server.scene
        add_surroundings(scene)
        scene.add_light_directional("/front", intensity=1.0, position=(1.0, 3.0, 6.0))  # the discs face this way
        world = scene.add_frame("/world", show_axes=False)
        wheels, body = _build(run, scene)
        eye, seen = _eye(run, follow=follow), SEEN * 2.0 * float(run.radius.max())
        distance = 0.5 * seen / (ASPECT * np.tan(0.5 * FIELD_OF_VIEW))
        server.initial_camera.position = (0.0, 0.18 * distance, distance)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.initial_camera.fov = FIELD_OF_VIEW
        recording = server.get_scene_serializer()
        discs = run.discs
        with server.atomic():
            for frame, pause in enumerate(np.diff(run.time, append=run.time[-1])):
                world.position = shortened(np.array([-eye[frame, 0], -eye[frame, 1], 0.0]))
                turns = about_z(discs[frame, :, 2])
                for handle, (x, y, _), turn in zip(wheels, discs[frame], turns, strict=True):
                    handle.position, handle.wxyz = shortened(np.array([x, y, 0.0])), shortened(turn)
                if body is not None:
                    (x, y), (dx, dy) = discs[frame, :, :2].mean(axis=0), discs[frame, -1, :2] - discs[frame, 0, :2]
                    body.position = shortened(np.array([x, y, 0.0]))
                    body.wxyz = shortened(about_z(np.array([np.arctan2(dy, dx)]))[0])
                recording.insert_sleep(float(pause))
        page = recording.as_html()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(with_panel(page, _curves(run)), encoding="utf-8")
    return path


def _build(run: PlanarRun, scene: Any) -> tuple[list[Any], Any | None]:
    """Builds the scene and returns the moving frames of the discs and, between two or more, of the body."""
    wheels = []
    for k, radius in enumerate(run.radius):
        wheels.append(scene.add_frame(f"/world/disc_{k}", show_axes=False))
        add_meshes(scene, f"/world/disc_{k}", wheel_meshes(float(radius), THICK * float(radius)), cast_shadow=False)
    body = None
    if len(run.radius) > 1:
        body = scene.add_frame("/world/body", show_axes=False)
        ends = run.discs[0, [0, -1], :2]
        size = (float(np.hypot(*(ends[1] - ends[0]))), 0.25 * float(run.radius.max()), 0.02)
        beam = Part("", "box", size, (0.0, 0.0, 0.4 * float(run.radius.max())), np.eye(3), AXLE_COLOUR)
        add_meshes(scene, "/world/body", [surface_mesh(beam)], cast_shadow=False)
    add_meshes(scene, "/world/ground", _ground(run), cast_shadow=False)
    return wheels, body


def _ground(run: PlanarRun) -> list[tuple[Colour, Array, npt.NDArray[np.int32]]]:
    """The ground as a band in squares of two colours, and the cut through it that faces the eye."""
    radius = float(run.radius.max())
    land = LAND * SEEN * radius
    x = run.discs[..., 0]
    low, high = float(x.min()) - land, float(x.max()) + land
    tile = TILE
    while (high - low) / tile > 4000.0:
        tile *= 2.0
    places = (
        np.arange(np.floor(low / tile), np.ceil(high / tile) + 1.0)[:, None] * tile + np.arange(0.0, 1.0, 0.125) * tile
    )
    corners = places.ravel()
    if isinstance(run.ground, Polyline):
        within = run.ground.x[(run.ground.x > low) & (run.ground.x < high)]
        corners = np.sort(np.concatenate((corners, within - 1e-6, within)))
    y = run.ground.height(corners)
    front, back, deep = radius, -8.0 * radius, float(y.min()) - 2.0 * radius
    n, k = len(corners), np.arange(len(corners) - 1)
    vertices = np.vstack(
        (
            np.column_stack((corners, y, np.full(n, front))),
            np.column_stack((corners, y, np.full(n, back))),
            np.column_stack((corners, y, np.full(n, front))),
            np.column_stack((corners, np.full(n, deep), np.full(n, front))),
        )
    )
    top = np.stack((np.column_stack((k, k + 1, k + n)), np.column_stack((k + 1, k + n + 1, k + n))), axis=1)
    cut = np.stack(
        (
            np.column_stack((k + 2 * n, k + 3 * n, k + 2 * n + 1)),
            np.column_stack((k + 2 * n + 1, k + 3 * n, k + 3 * n + 1)),
        ),
        axis=1,
    )
    dark = np.floor(0.5 * (corners[1:] + corners[:-1]) / tile) % 2.0 == 1.0
    light = np.concatenate((top[~dark].reshape(-1, 3),)).astype(np.int32)
    shade = np.concatenate((top[dark].reshape(-1, 3), cut.reshape(-1, 3))).astype(np.int32)
    return [(GROUND_COLOUR, vertices, light), (GROUND_COLOUR_2, vertices, shade)]


def _eye(run: PlanarRun, *, follow: bool) -> Array:
    """(n, 2) centre of the picture: the machine's smoothed way, or the middle of all of it."""
    middle = run.discs[..., :2].mean(axis=1)
    if not follow:
        return np.tile(0.5 * (middle.min(axis=0) + middle.max(axis=0)), (run.n_frames, 1))
    return moving_mean(run.time, middle, FOLLOW_TIME)


def _curves(run: PlanarRun) -> dict[str, Any]:
    """Contents of the panel."""
    discs = list(zip(run.names, PLANAR_WHEEL_COLOURS[: len(run.names)], strict=True))
    charts = [
        load_chart("load", run.time, run.loads, 1, discs),
        Chart("gap", "mm", 1e3 * run.trajectory["gaps"], 2, discs),
        Chart("rim faster than machine", "mm/s", 1e3 * run.slip_speeds, 1, discs),
    ]
    return panel_contents(run.title, run.time, charts)
