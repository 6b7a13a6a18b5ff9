"""Shared parts of the browser pages: viser's scene and player.

Scene and player come from viser [https://viser.studio]: its recording of scene updates, embedded in the client that
its package includes.

The skew part of a rotation matrix vanishes at both angles, and with it the axis. The quaternion is therefore computed
from the largest of its four components (Shepperd 1978), and the axis from the quaternion's vector part, which is small
only for small rotations and still has the right direction there.
"""

from __future__ import annotations

import html
import io
import json
from contextlib import contextmanager, redirect_stdout
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.rendering.appearance import GROUND_COLOUR, SKY_COLOUR, SKY_COLOUR_2, Colour

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

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


FOLLOW_TIME = 1.0  # s, window of the path that the eye follows: the eye does not shake with the machine

LOAD_TIME = 0.2  # s, window of the loads: an impact lasts a step and says nothing of the weight carried


def moving_mean(time: Array, values: Array, window: float) -> Array:
    """Values `(n, m)` averaged over the samples within half of a window, s, without those that are not finite."""
    half = 0.5 * window + 1e-6  # samples at the edge count, whatever their rounding
    first = np.searchsorted(time, time - half, side="left")
    last = np.searchsorted(time, time + half, side="right")
    known = np.isfinite(values)
    sums = np.vstack((np.zeros(values.shape[1]), np.cumsum(np.where(known, values, 0.0), axis=0)))
    counts = np.vstack((np.zeros(values.shape[1]), np.cumsum(known, axis=0)))
    with np.errstate(invalid="ignore"):
        result: Array = (sums[last] - sums[first]) / (counts[last] - counts[first])
    return result


class Chart(NamedTuple):
    """A chart of the panel.

    `values` are (n, n_series); `digits` stand after the point; `series` are name and colour of each curve;
    `window`, s, is how long a lone impact lasts in the values: it must not set the scale.
    """

    title: str
    unit: str
    values: Array
    digits: int
    series: list[tuple[str, str]]
    window: float = 0.0


def load_chart(title: str, time: Array, loads: Array, digits: int, wheels: list[tuple[str, str]]) -> Chart:
    """The wheels' loads `(n, n_wheels)`, N, as means over `LOAD_TIME`."""
    smooth = moving_mean(time, loads, LOAD_TIME)
    return Chart(f"{title}, mean over {LOAD_TIME:g} s", "N", smooth, digits, wheels, LOAD_TIME)


def panel_contents(title: str, time: Array, charts: Iterable[Chart], facts: Iterable[str] = ()) -> dict[str, Any]:
    """Contents of the panel: the run's title, lines about it, its times `(n,)`, s, and its charts."""
    return {
        "title": title,
        "facts": list(facts),
        "time": [round(float(one - time[0]), 4) for one in time],
        "charts": [
            {
                "title": chart.title,
                "unit": chart.unit,
                "values": [_rounded(column, chart.digits) for column in chart.values.T],
                "series": [{"name": name, "colour": colour} for name, colour in chart.series],
                "window": chart.window,
            }
            for chart in charts
        ],
    }


def with_panel(page: str, contents: Mapping[str, Any]) -> str:
    """Viser's page with the panel beside the scene."""
    files = resources.files("rover_gym.replay")
    style, script = (files.joinpath(name).read_text(encoding="utf-8") for name in ("panel.css", "panel.js"))
    # No closing tag may end the script early.
    data = json.dumps(contents, separators=(",", ":")).replace("<", "\\u003c")
    panel = (
        f"<style>{style}</style>"
        '<aside id="panel"></aside>'
        f'<script type="application/json" id="curves">{data}</script>'
        f"<script>{script}</script>"
    )
    return with_parts(page, contents["title"], panel)


def _rounded(values: Array, digits: int) -> list[float | None]:
    """Values for JSON, which has neither nan nor infinity: unknown values leave gaps in the curve."""
    return [round(float(value), digits) if np.isfinite(value) else None for value in values]


def quaternions(rotations: Array) -> Array:
    """Unit quaternions w, x, y, z of rotation matrices.

    Args:
        rotations: (..., 3, 3).

    Returns:
        (..., 4); the largest component is positive.
    """
    R = rotations
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    # 4 q_i q_j, by rows i; the row with the largest diagonal is the quaternion with the least round-off.
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i + 1, i + 1] = 1.0 - trace + 2.0 * R[..., i, i]
        products[..., 0, i + 1] = products[..., i + 1, 0] = R[..., k, j] - R[..., j, k]
        products[..., j + 1, k + 1] = products[..., k + 1, j + 1] = R[..., j, k] + R[..., k, j]
    row = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, row[..., None, None], axis=-2)[..., 0, :]
    result: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return result


def continuous(q: Array) -> Array:
    """The same rotations without sign flips along the first axis, so that interpolation takes the short way.

    Args:
        q: (n, ..., 4) unit quaternions.
    """
    turns = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0.0, -1.0, 1.0)
    signs = np.concatenate((np.ones((1, *q.shape[1:-1])), np.cumprod(turns, axis=0)))
    result: Array = q * signs[..., None]
    return result


def axis_angles(q: Array) -> Array:
    """Axis and angle of unit quaternions.

    Args:
        q: (..., 4) w, x, y, z.

    Returns:
        (..., 4) unit axis and angle, rad, in 0 to 2 pi; the axis of the identity is y.
    """
    vector = q[..., 1:]
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    axis = np.where(length > 0.0, vector / np.where(length > 0.0, length, 1.0), np.array([0.0, 1.0, 0.0]))
    angle = 2.0 * np.arctan2(length, q[..., :1])
    return np.concatenate((axis, angle), axis=-1)
