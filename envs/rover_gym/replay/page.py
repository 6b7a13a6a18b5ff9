"""A page for the browser: the run in 3D with a timeline, and its curves beside it, in one file that needs no network.

The scene and its player are viser's [https://viser.studio]: its recording of scene updates, within the client that its
package carries. The curves are drawn by a small script of ours, `panel.js`, that follows the player's own clock.
"""

from __future__ import annotations

import html
import io
import json
from contextlib import contextmanager, redirect_stdout
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.appearance import GROUND_COLOUR, GROUND_COLOUR_2, ROCK_COLOUR, SKY_COLOUR, SKY_COLOUR_2, Colour
from rover_gym.extras import require
from rover_gym.replay.rotation import continuous, quaternions
from rover_gym.replay.scenery import (
    coloured_meshes,
    first_view,
    goal_parts,
    ground_tiles,
    parts_by_solid,
    sphere_mesh,
    spheres,
    trunk_path,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rover_gym.run import Run

#: One colour a wheel, Okabe and Ito's, told apart by colour-blind readers too.
WHEEL_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#E69F00")
LARGE = 0.12  # m, radius from which a sphere is drawn with more triangles
MANY = 1000  # spheres, from which it is drawn with fewer again
FOLLOW_TIME = 1.0  # s, over which the path that the eye follows is smoothed

Array = npt.NDArray[np.float64]


def write_page(run: Run, path: str | Path, *, follow: bool = True) -> Path:
    """Writes a run as one page for the browser.

    Args:
        run: The run; every sample becomes a frame of the replay.
        path: The file to write, by custom `.html`. Its folder is made.
        follow: Whether the eye goes with the rover; otherwise the ground stands still.

    Raises:
        MissingExtraError: viser is not installed.
        OSError: The file cannot be written.
    """
    with _server(require("viser", "replay")) as server:
        world, solids = _build(run, server.scene)
        view, centre = first_view(run), _followed(run) if follow else np.zeros((run.n_frames, 3))
        server.initial_camera.position = view.eye - centre[0]
        server.initial_camera.look_at = view.target - centre[0]
        server.initial_camera.fov = view.field_of_view
        recording = server.get_scene_serializer()
        turns = continuous(quaternions(run.rotations))
        with server.atomic():  # or each of the thousands of updates would wake the server's thread
            for frame, pause in enumerate(np.diff(run.time, append=run.time[-1])):
                world.position = _shortened(-centre[frame])
                for i, solid in enumerate(solids):
                    solid.position = _shortened(run.positions[frame, i])
                    solid.wxyz = _shortened(turns[frame, i])
                recording.insert_sleep(float(pause))
        page = recording.as_html()
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_with_panel(page, run), encoding="utf-8")
    return path


@contextmanager
def _server(viser: Any) -> Iterator[Any]:
    """A viser server that only this process sees: it holds the scene that is recorded."""
    with redirect_stdout(io.StringIO()):  # it announces its address, which nobody needs
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def _build(run: Run, scene: Any) -> tuple[Any, list[Any]]:
    """Builds the scene and returns what moves: the frame of the whole world, and those of the solids."""
    scene.set_up_direction("+y")
    scene.configure_environment_map(None)  # a third of the time of a frame without it, where there is no GPU
    scene.add_light_hemisphere("/sky", sky_color=_rgb(SKY_COLOUR), ground_color=_rgb(GROUND_COLOUR), intensity=1.2)
    shades = np.linspace(_rgb(SKY_COLOUR_2), _rgb(SKY_COLOUR), 64).astype(np.uint8)
    scene.set_background_image(np.repeat(shades[:, None], 2, axis=1), format="png")
    world = scene.add_frame("/world", show_axes=False)
    solids = []
    for name, parts in parts_by_solid(run).items():
        solids.append(scene.add_frame(f"/world/{name}", show_axes=False))
        _add_meshes(scene, f"/world/{name}", coloured_meshes(parts))
    tiles = ground_tiles(run)
    if tiles is not None:
        vertices, light, dark = tiles
        squares = ((GROUND_COLOUR, vertices, light), (GROUND_COLOUR_2, vertices, dark))
        _add_meshes(scene, "/world/ground", squares, cast_shadow=False)
    _add_meshes(scene, "/world/goal", coloured_meshes(goal_parts(run)))
    centres, radii = spheres(run)
    for name, rings, chosen in (
        ("pebbles", 5, radii < LARGE),
        ("rocks", 10 if len(radii) < MANY else 7, radii >= LARGE),
    ):
        if chosen.any():
            vertices, triangles = sphere_mesh(rings)
            scene.add_batched_meshes_simple(
                f"/world/{name}",
                vertices,
                triangles,
                batched_wxyzs=np.tile((1.0, 0.0, 0.0, 0.0), (int(chosen.sum()), 1)),
                batched_positions=centres[chosen],
                batched_scales=radii[chosen],
                batched_colors=_rgb(ROCK_COLOUR),
                lod="off",
                cast_shadow=False,  # thousands of triangles, several times a frame
            )
    return world, solids


def _add_meshes(
    scene: Any, name: str, meshes: Iterable[tuple[Colour, Array, npt.NDArray[np.int32]]], *, cast_shadow: bool = True
) -> None:
    for i, (colour, vertices, triangles) in enumerate(meshes):
        used, corners = np.unique(triangles, return_inverse=True)
        scene.add_mesh_simple(
            f"{name}/{i}", vertices[used], corners.reshape(-1, 3), color=_rgb(colour), cast_shadow=cast_shadow
        )


def _rgb(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * value) for value in colour)
    return red, green, blue


def _shortened(values: Array) -> Array:
    """Values to 4 micrometres or microradians, as binary fractions: their many zeros make the recording smaller."""
    result: Array = np.round(values * 2.0**18) / 2.0**18
    return result


def _followed(run: Run) -> Array:
    """(n, 3) the trunk's path, smoothed, so that the eye does not shake with the rover."""
    path = trunk_path(run)
    spans = np.abs(run.time[:, None] - run.time) <= FOLLOW_TIME / 2
    result: Array = spans @ path / spans.sum(axis=1, keepdims=True)
    return result


def _curves(run: Run) -> dict[str, Any]:
    """What the panel draws: its title, the time, and for each chart a curve a wheel."""
    data, wheels = run.trajectory.data, run.model.wheel_names
    charts = [
        ("wheel load", "N", data["wheel_forces"][:, :, 0], 1),
        ("wheel gap", "mm", 1e3 * data["wheel_gaps"], 2),
    ]
    return {
        "title": run.title,
        "time": [round(float(time - run.time[0]), 4) for time in run.time],
        "wheels": [{"name": name, "colour": colour} for name, colour in zip(wheels, WHEEL_COLOURS, strict=True)],
        "charts": [
            {
                "title": title,
                "unit": unit,
                # JSON knows neither nan nor infinity: where a gap is not known, the curve has a hole.
                "values": [
                    [round(float(value), digits) if np.isfinite(value) else None for value in column]
                    for column in values.T
                ],
            }
            for title, unit, values, digits in charts
        ],
    }


def _with_panel(page: str, run: Run) -> str:
    """Viser's page with our panel beside its scene."""
    files = resources.files("rover_gym.replay")
    style, script = (files.joinpath(name).read_text(encoding="utf-8") for name in ("panel.css", "panel.js"))
    curves = json.dumps(_curves(run), separators=(",", ":")).replace("<", "\\u003c")  # no tag may end the script
    panel = (
        f"<style>{style}</style>"
        '<aside id="panel"></aside>'
        f'<script type="application/json" id="curves">{curves}</script>'
        f"<script>{script}</script>"
    )
    head, title, rest = page.partition("<title>Viser</title>")
    body, end, tail = rest.rpartition("</body>")
    if not title or not end:
        raise RuntimeError("viser's page has changed: it lacks the title or the end of the body where ours begins")
    return f"{head}<title>{html.escape(run.title)}</title>{body}{panel}{end}{tail}"
