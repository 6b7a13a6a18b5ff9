"""Export of a run of balls in space as a browser page: tens of thousands of balls, the rover, a timeline and curves.

The page draws by itself, with WebGL 2 and no library. A ball is a square that the graphics card turns into an exact
sphere. The places of two neighbouring samples lie in its memory as 16-bit numbers, and it goes from one to the other;
so a picture costs the script next to nothing, and a new sample one upload. In the file, a sample holds its differences
to the one before, in pieces of a second that unpack while the page plays.
"""

from __future__ import annotations

import base64
import html
import json
import zlib
from importlib import resources
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.ground import spheres_of, surfaces_of, triangles_of
from rover_gym.rendering.appearance import (
    FIXED_BALL_COLOUR,
    GROUND_COLOUR,
    GROUND_COLOUR_2,
    ROCK_COLOUR,
    SAND_COLOUR,
    SKY_COLOUR,
    SKY_COLOUR_2,
    WHEEL_COLOURS,
    Colour,
    sphere_mesh,
)
from rover_gym.replay.player import (
    FOLLOW_TIME,
    Chart,
    continuous,
    load_chart,
    moving_mean,
    panel_contents,
    quaternions,
    shortened,
)
from rover_gym.replay.scenery import (
    MARGIN,
    MOST_HEIGHTS,
    coloured_meshes,
    first_view,
    ground_plane,
    ground_tiles,
    parts_by_solid,
    spheres,
    surfaces,
    vessel_meshes,
    vessel_poses,
    wall_polygons,
    wall_poses,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rover_gym.grains.grain_run import GrainRun
    from rover_gym.mechanics import Terrain


COLOURS = ("#332288", "#CC6677")


def grain_curves(run: GrainRun) -> dict[str, Any]:
    """Contents of the panel."""
    data = run.trajectory
    charts: list[Chart] = []
    if run.model is not None:
        wheels = list(zip(run.model.wheel_names, cycle(WHEEL_COLOURS), strict=False))
        charts += [
            load_chart("wheel load", run.time, run.wheel_forces[..., 1], 1, wheels),
            Chart("sinkage", "mm", 1e3 * run.sinkage, 2, wheels),
        ]
    potential = data["potential_energy"] - data["potential_energy"][0]
    energy = np.stack((data["kinetic_energy"], potential), axis=1)
    overlap = 100.0 * data["penetration"] / float(run.radius.min())
    parts = list(zip(("kinetic", "potential, from the start"), COLOURS, strict=True))
    charts += [
        Chart("energy", "J", energy, 4, parts),
        Chart("contacts", "1", data["n_contacts"][:, None], 0, [("contacts", COLOURS[0])]),
        Chart("deepest overlap", "% of a radius", overlap[:, None], 4, [("overlap", COLOURS[0])]),
    ]
    return panel_contents(run.title, run.time, charts)


FIELD_OF_VIEW = 0.6  # rad, vertical, of a run without a rover

Array = npt.NDArray[np.float64]


class StartView(NamedTuple):
    """A viewpoint: eye and target, m, and the vertical field of view, rad."""

    eye: list[float]
    target: list[float]
    angle: float


def start_view(run: GrainRun) -> StartView:
    """The view at the start: beside the rover, or so that all balls are in it."""
    if run.rover is not None:
        view = first_view(run.rover)
        return StartView(view.eye.tolist(), view.target.tolist(), view.field_of_view)
    shown = run.positions_of(np.unique(run.rows[[0, run.n_frames // 2, -1]])).astype(np.float64)
    ends = np.quantile(shown, 0.01, axis=1), np.quantile(shown, 0.99, axis=1)
    low, high = ends[0].min(axis=0), ends[1].max(axis=0)
    if run.vessel is not None and run.vessel["kind"] == "drum":
        reach = np.array([run.vessel["radius"], run.vessel["radius"], 0.5 * run.vessel["length"]])
        low, high = run.vessel["centre"] - reach, run.vessel["centre"] + reach
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low)) + 2.0 * float(run.radius.max())
    eye = middle + 1.1 * size / np.tan(FIELD_OF_VIEW) * np.array([-0.42, 0.45, 0.79])
    return StartView(eye.tolist(), middle.tolist(), FIELD_OF_VIEW)


def eye_path(run: GrainRun, *, follow: bool = True) -> Array:
    """(n, 3) what carries the eye along, relative to its start, m: the trunk's smoothed path."""
    if run.rover is None or not follow:
        return np.zeros((run.n_frames, 3))
    smooth = moving_mean(run.time, run.trajectory["q"][:, :3], FOLLOW_TIME)
    result: Array = smooth - smooth[0]
    return result


SAMPLES = 25  # of a piece: each begins with whole places

LEVELS = 65535  # of a place, along each axis

MANY = 300  # spheres of the ground, above which each gets fewer triangles

Faces = npt.NDArray[np.int32]

Mesh = tuple[Colour, Array, Faces]


def grain_page(run: GrainRun, *, follow: bool) -> Iterator[str]:
    """A run of balls as a page in pieces, which goes smoothly from one sample to the next.

    Raises:
        RecordingError: The recording is damaged.
    """
    places, low, extent = _quantised(run)
    meshes, poses = _meshes(run)
    pieces = [places[first : first + SAMPLES] for first in range(0, run.n_frames, SAMPLES)]
    scene = {
        "balls": len(run.radius),
        "time": [round(float(time - run.time[0]), 6) for time in run.time],
        "low": low.tolist(),
        "extent": extent.tolist(),
        "samples": SAMPLES,
        "pieces": len(pieces),
        "radius": float(run.radius.mean()),
        "solids": poses.shape[1],
        "rover": 0 if run.model is None else len(run.model.solid_names),
        "reach": 0.0 if run.model is None else run.model.clear_radius,
        "meshes": [{"solid": solid, "first": first, "count": count} for solid, first, count in _ranges(meshes)],
        "view": start_view(run)._asdict(),
        "centres": np.round(eye_path(run, follow=follow), 4).tolist(),
        "sky": [SKY_COLOUR_2, SKY_COLOUR],
        "sand": [SAND_COLOUR, FIXED_BALL_COLOUR],
    }
    blobs = {
        "radii": run.radius.astype("<f4").tobytes(),
        "fixed": run.kinematic.astype(np.uint8).tobytes(),
        "poses": np.ascontiguousarray(poses, dtype="<f4").tobytes(),
        **_packed_meshes([mesh for _, mesh in meshes]),
        **{f"piece-{i}": _differences(piece) for i, piece in enumerate(pieces)},
    }
    return _page(run.title, scene, blobs, grain_curves(run))


def _page(title: str, scene: dict[str, Any], blobs: dict[str, bytes], curves: dict[str, Any]) -> Iterator[str]:
    """The page in pieces."""
    files = resources.files("rover_gym.replay")

    def text(name: str) -> str:
        return files.joinpath(name).read_text(encoding="utf-8")

    yield f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
    yield f'<meta name="viewport" content="width=device-width"><style>{text("panel.css")}{text("grain_page.css")}'
    yield f'</style></head><body>{text("grain_page.html")}<aside id="panel"></aside>'
    for name, value in (("scene", scene), ("curves", curves)):
        data = json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")  # no closing tag may end it early
        yield f'<script type="application/json" id="{name}">{data}</script>\n'
    for name, content in blobs.items():
        packed = base64.b64encode(zlib.compress(content, 6)).decode()
        yield f'<script type="application/octet-stream" id="{name}">{packed}</script>\n'
    for name in ("grain_frames.js", "grain_view.js", "grain_player.js", "panel.js"):
        yield f"<script>{text(name)}</script>\n"
    yield "</body></html>\n"


def _quantised(run: GrainRun) -> tuple[npt.NDArray[np.uint16], Array, Array]:
    """Places (n, n_balls, 3) as levels between bounds, the lower bounds and the extents, m.

    The bounds hold all places, but no more than twice the size of the first sample to each side of it: a ball that
    falls for ever stops there.
    """
    places = run.positions
    low, high = places.min(axis=(0, 1)).astype(np.float64), places.max(axis=(0, 1)).astype(np.float64)
    first = places[0].astype(np.float64)
    size = 2.0 * float((first.max(axis=0) - first.min(axis=0)).max()) + 4.0 * float(run.radius.max())
    low, high = np.maximum(low, first.min(axis=0) - size), np.minimum(high, first.max(axis=0) + size)
    extent = np.maximum(high - low, 1e-6)
    result = np.empty(places.shape, dtype=np.uint16)
    for k, sample in enumerate(places):
        result[k] = np.clip(np.round((sample - low) / extent * LEVELS), 0, LEVELS)
    return result, low, extent


def _differences(piece: npt.NDArray[np.uint16]) -> bytes:
    """Differences of samples (n, n_balls, 3) modulo 2^16: x of all balls, then y, then z; low bytes before high ones.

    The first sample is whole.
    """
    steps = np.diff(piece, axis=0, prepend=np.zeros_like(piece[:1])).transpose(0, 2, 1)
    # A small step back has high byte 255: shifted by half a byte, small steps of both signs have high byte 0.
    steps[1:] += np.uint16(128)
    result = np.stack((steps & 255, steps >> 8), axis=2).astype(np.uint8)
    return result.tobytes()


def _meshes(run: GrainRun) -> tuple[list[tuple[int, Mesh]], Array]:
    """Meshes, each with its moving frame (-1: none), and poses (n, n_moving, 7): m, and x, y, z, w."""
    meshes: list[tuple[int, Mesh]] = []
    poses = np.zeros((run.n_frames, 0, 7))
    if run.rover is not None:
        for i, parts in enumerate(parts_by_solid(run.rover).values()):
            meshes += [(i, mesh) for mesh in coloured_meshes(parts)]
        turns = continuous(quaternions(run.rover.rotations))[..., [1, 2, 3, 0]]
        poses = np.concatenate((run.rover.positions, turns), axis=-1)
    meshes += [(-1, mesh) for mesh in _ground(run)]
    of_walls = wall_polygons(run, GROUND_COLOUR, ROCK_COLOUR)
    meshes += [(poses.shape[1] + i, mesh) for i, mesh in enumerate(of_walls)]
    last = poses.shape[1] + len(of_walls)
    meshes += [(last, mesh) for mesh in vessel_meshes(run, ROCK_COLOUR, GROUND_COLOUR)]
    poses = np.concatenate((poses, wall_poses(run), vessel_poses(run)[:, None]), axis=1)
    return meshes, shortened(poses, 16)


def _ground(run: GrainRun) -> list[Mesh]:
    """The fixed ground about the rover's path, or under the balls."""
    meshes: list[Mesh] = []
    tiles = None if run.rover is None or ground_plane(run.rover) is None else ground_tiles(run.rover)
    if tiles is not None:
        vertices, light, dark = tiles
        meshes += [(GROUND_COLOUR, vertices, light), (GROUND_COLOUR_2, vertices, dark)]
    if run.terrain is None:
        return meshes
    pieces = surfaces(run.rover) if run.rover is not None else _surfaces_under_balls(run, run.terrain)
    for vertices, faces in pieces:
        meshes += [(colour, vertices, triangles) for colour, triangles in faces if len(triangles)]
    centres, radii = spheres_of(run.terrain) if run.rover is None else spheres(run.rover)
    ball, corners = sphere_mesh(10 if len(radii) < MANY else 5)
    if len(radii):
        vertices = (centres[:, None] + radii[:, None, None] * ball).reshape(-1, 3)
        firsts = len(ball) * np.arange(len(radii), dtype=np.int32)
        meshes.append((ROCK_COLOUR, vertices, (firsts[:, None, None] + corners).reshape(-1, 3)))
    return meshes


def _surfaces_under_balls(run: GrainRun, terrain: Terrain) -> list[tuple[Array, list[tuple[Colour, Faces]]]]:
    """Height fields and meshes under the balls, each in one colour."""
    places = run.positions_of(run.rows[:1])[0][:, [0, 2]].astype(np.float64)
    low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    pieces = []
    for surface in surfaces_of(terrain):
        vertices, faces = triangles_of(surface, low, high, MOST_HEIGHTS)
        pieces.append((vertices, [(GROUND_COLOUR, faces.astype(np.int32))]))
    return pieces


def _ranges(meshes: list[tuple[int, Mesh]]) -> list[tuple[int, int, int]]:
    """Of each mesh its frame, and its first index and number of indices."""
    ends = np.cumsum([0, *(triangles.size for _, (_, _, triangles) in meshes)]).tolist()
    return [(solid, first, end - first) for (solid, _), first, end in zip(meshes, ends[:-1], ends[1:], strict=True)]


def _packed_meshes(meshes: list[Mesh]) -> dict[str, bytes]:
    """Vertices, their colours, and triangles of all meshes."""
    vertices, colours, triangles, n = [], [], [], 0
    for colour, points, corners in meshes:
        vertices.append(points.astype("<f4"))
        colours.append(np.tile(np.round(255.0 * np.array([*colour, 1.0])).astype(np.uint8), (len(points), 1)))
        triangles.append((corners + n).astype("<u4"))
        n += len(points)
    return {
        "vertices": b"".join(piece.tobytes() for piece in vertices),
        "colours": b"".join(piece.tobytes() for piece in colours),
        "triangles": b"".join(piece.tobytes() for piece in triangles),
    }
