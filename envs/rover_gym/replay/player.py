"""Shared parts of the browser pages: viser's scene and player.

Scene and player come from viser [https://viser.studio]: its recording of scene updates, embedded in the client that
its package includes.
"""

from __future__ import annotations

import html
import io
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.rendering.appearance import GROUND_COLOUR, SKY_COLOUR, SKY_COLOUR_2, Colour

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from rover_gym.record.rover_run import Run

Array = npt.NDArray[np.float64]

AMBIENT = 0.8  # intensity of the light from all sides: solar panels and tyres stay no black holes


@contextmanager
def hidden_server() -> Iterator[Any]:
    """A viser server for this process only; it holds the recorded scene.

    Raises:
        MissingExtraError: viser is not installed.
    """
    viser = require("viser", "replay")
    with redirect_stdout(io.StringIO()):  # suppresses the announcement of its address
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def add_surroundings(scene: Any) -> None:
    """Sets the up direction, and adds light and sky."""
    scene.set_up_direction("+y")
    scene.configure_environment_map(None)  # a third of the time of a frame without it, where there is no GPU
    scene.add_light_hemisphere("/sky", sky_color=rgb(SKY_COLOUR), ground_color=rgb(GROUND_COLOUR), intensity=1.2)
    scene.add_light_ambient("/daylight", intensity=AMBIENT)
    shades = np.linspace(rgb(SKY_COLOUR_2), rgb(SKY_COLOUR), 64).astype(np.uint8)
    scene.set_background_image(np.repeat(shades[:, None], 2, axis=1), format="png")


def add_meshes(
    scene: Any, name: str, meshes: Iterable[tuple[Colour, Array, npt.NDArray[np.int32]]], *, cast_shadow: bool = True
) -> None:
    """Adds surfaces, each given by a colour, vertices (n, 3) and triangles (m, 3)."""
    for i, (colour, vertices, triangles) in enumerate(meshes):
        used, corners = np.unique(triangles, return_inverse=True)
        scene.add_mesh_simple(
            f"{name}/{i}", vertices[used], corners.reshape(-1, 3), color=rgb(colour), cast_shadow=cast_shadow
        )


def rgb(colour: Colour) -> tuple[int, int, int]:
    """A colour in viser's range, 0 to 255."""
    red, green, blue = (round(255 * value) for value in colour)
    return red, green, blue


def shortened(values: Array, bits: int = 18) -> Array:
    """Values rounded to 2^-bits (4 micrometres or microradians): the trailing zero bits compress well."""
    result: Array = np.round(values * 2.0**bits) / 2.0**bits
    return result


def recorded_page(
    run: Run,
    centre: Array,
    build: Callable[[Any], Callable[[int], None]],
    eye: npt.ArrayLike,
    target: npt.ArrayLike,
    field_of_view: float,
) -> str:
    """Viser's page of a run, every sample a frame of the replay.

    Args:
        run: The run.
        centre: (n, 3) what stands in the middle in each sample, m: the world moves, and the eye stays.
        build: Builds the scene in the frame `/world`, and gives the function that shows a sample.
        eye: Where the eye stands, m.
        target: Where it looks, m.
        field_of_view: Vertical, rad.

    Raises:
        MissingExtraError: viser is not installed.
    """
    with hidden_server() as server:
        add_surroundings(server.scene)
        world = server.scene.add_frame("/world", show_axes=False)
        show = build(server.scene)
        server.initial_camera.position = eye
        server.initial_camera.look_at = target
        server.initial_camera.fov = field_of_view
        recording = server.get_scene_serializer()
        with server.atomic():  # otherwise each of the thousands of updates would wake the server's thread
            for frame, pause in enumerate(np.diff(run.time, append=run.time[-1])):
                world.position = shortened(-centre[frame])
                show(frame)
                recording.insert_sleep(float(pause))
        page: str = recording.as_html()
        return page


def with_parts(page: str, title: str, parts: str) -> str:
    """Viser's page with a title and with HTML of ours beside the scene."""
    head, found, rest = page.partition("<title>Viser</title>")
    body, end, tail = rest.rpartition("</body>")
    if not found or not end:
        raise RuntimeError("viser's page has changed: it lacks the title or the end of the body where ours begins")
    return f"{head}<title>{html.escape(title)}</title>{body}{parts}{end}{tail}"
