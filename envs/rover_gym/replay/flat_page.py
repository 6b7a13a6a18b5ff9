"""Browser pages of runs in the plane: a ball or a two-wheel rover over its ground, and disks of a soil."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.mechanics import Polyline
from rover_gym.rendering.appearance import (
    AXLE_COLOUR,
    GROUND_COLOUR,
    GROUND_COLOUR_2,
    HUB_COLOUR,
    PLANAR_WHEEL_COLOURS,
    ROCK_COLOUR,
    TYRE_COLOUR,
    Colour,
    Part,
    part_mesh,
)
from rover_gym.replay.player import (
    FOLLOW_TIME,
    Chart,
    add_meshes,
    load_chart,
    moving_mean,
    panel_contents,
    recorded_page,
    rgb,
    shortened,
    with_panel,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from rover_gym.planar.planar_run import PlanarRun
    from rover_gym.soil.soil_run import SoilRun

SAND_COLOURS: tuple[Colour, Colour] = (
    (0.97, 0.90, 0.76),
    (0.86, 0.75, 0.56),
)  # of a disk's halves: they show its rotation
BACKGROUND = 244  # of 255: nearly white, on which pale disks and forces stand out
CHAIN_COLOUR: Colour = (0.80, 0.0, 0.10)
DEPTH = 1.0  # out-of-plane thickness of disks, in mean diameters
BATCH = 100  # disks per batch: a batch in which nothing moves needs no update
CHAINS = 300  # strongest contacts drawn
SOIL_SEEN = 1.8  # m of soil in view at most
SKIRT = 1.04  # width of the picture, in widths of the bed
SOIL_ASPECT = 1.2  # width over height of the picture
FIELD_OF_VIEW = 0.35  # rad, vertical: narrow and far away, for little perspective

SEEN = 9.0  # width of the picture, in diameters of the largest disc
ASPECT = 1.5  # width over height of the picture
LAND = 1.5  # picture widths of ground beyond the way
TILE = 0.5  # m, length of the ground's squares
THICK = 0.4  # of a disc along its axle, in its radii


Array = npt.NDArray[np.float64]


def planar_page(run: PlanarRun, *, follow: bool) -> str:
    """A planar run as a page."""
    centre = np.column_stack((_planar_eye(run, follow=follow), np.zeros(run.n_frames)))
    largest = float(run.radius.max())
    distance = SEEN * largest / (ASPECT * np.tan(0.5 * FIELD_OF_VIEW))

    def build(scene: Any) -> Callable[[int], None]:
        scene.add_light_directional("/front", intensity=1.0, position=(1.0, 3.0, 6.0))  # the discs face this way
        wheels = _Wheels(scene, run.discs, run.radius, THICK * run.radius, 0.25 * largest, 0.4 * largest)
        add_meshes(scene, "/world/ground", _ground(run), cast_shadow=False)
        return wheels.show

    page = recorded_page(run, centre, build, (0.0, 0.18 * distance, distance), (0.0, 0.0, 0.0), FIELD_OF_VIEW)
    return with_panel(page, _planar_curves(run))


def soil_page(run: SoilRun, *, follow: bool) -> str:
    """A run on a soil as a page."""
    eye = _soil_eye(run, follow=follow)
    centre = np.column_stack((eye[:, 0], np.zeros((run.n_frames, 2))))
    distance = 0.5 * _seen(run) / (SOIL_ASPECT * np.tan(0.5 * FIELD_OF_VIEW))

    def build(scene: Any) -> Callable[[int], None]:
        scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8), format="png")
        scene.add_light_directional("/front", intensity=1.5, position=(1.0, 2.0, 6.0))  # the disks face this way
        depth, radius = _depth(run), run.wheels[0, :, 2]
        poses = np.concatenate((run.wheels[..., :2], run.wheel_angles[..., None]), axis=2)
        wheels = _Wheels(scene, poses, radius, np.full(len(radius), depth), 0.05, 0.8 * depth)
        parts = (_Disks(run, scene), wheels, _Chains(run, scene))
        _add_walls(run, scene)

        def show(frame: int) -> None:
            for part in parts:
                part.show(frame)

        return show

    height = float(eye[0, 1])
    page = recorded_page(
        run, centre, build, (0.0, height + 0.1 * distance, distance), (0.0, height, 0.0), FIELD_OF_VIEW
    )
    return with_panel(page, _soil_curves(run))


def about_z(angles: Array) -> Array:
    """(n, 4) unit quaternions w, x, y, z of rotations about z."""
    turns = np.zeros((len(angles), 4))
    turns[:, 0], turns[:, 3] = np.cos(0.5 * angles), np.sin(0.5 * angles)
    return turns


def _depth(run: SoilRun) -> float:
    return 2.0 * DEPTH * float(run.radius.mean())


class _Wheels:
    """Wheels or a ball and, between the first and the last of several, the body.

    Args:
        scene: Viser's.
        poses: (n, n_wheels, 3) centres, m, and angles, rad.
        radius: (n_wheels,) m.
        depth: (n_wheels,) thickness, m.
        body: Height of the body, m.
        ahead: How far the body stands before the wheels, m.
    """

    def __init__(self, scene: Any, poses: Array, radius: Array, depth: Array, body: float, ahead: float) -> None:
        self._poses, self._handles = poses, []
        for k, (r, thick) in enumerate(zip(radius, depth, strict=True)):
            self._handles.append(scene.add_frame(f"/world/wheel_{k}", show_axes=False))
            add_meshes(scene, f"/world/wheel_{k}", wheel_meshes(float(r), float(thick)), cast_shadow=False)
        self._body = None
        if len(radius) > 1:
            self._body = scene.add_frame("/world/body", show_axes=False)
            length = float(np.hypot(*(poses[0, -1, :2] - poses[0, 0, :2])))
            beam = Part("", "box", (length, body, 0.02), (0.0, 0.0, ahead), np.eye(3), AXLE_COLOUR)
            add_meshes(scene, "/world/body", [surface_mesh(beam)], cast_shadow=False)

    def show(self, frame: int) -> None:
        """Moves wheels and body."""
        poses = self._poses[frame]
        for handle, (x, y, _), turn in zip(self._handles, poses, about_z(poses[:, 2]), strict=True):
            handle.position, handle.wxyz = shortened(np.array([x, y, 0.0])), shortened(turn)
        if self._body is not None:
            (x, y), (dx, dy) = poses[:, :2].mean(axis=0), poses[-1, :2] - poses[0, :2]
            self._body.position = shortened(np.array([x, y, 0.0]))
            self._body.wxyz = shortened(about_z(np.array([np.arctan2(dy, dx)]))[0])


class _Disks:
    """All disks, in batches of neighbours."""

    def __init__(self, run: SoilRun, scene: Any) -> None:
        self._run = run
        n = len(run.radius)
        order = np.argsort(run.positions[0, :, 0], kind="stable")
        self._batches = np.array_split(order, -(-n // BATCH))
        mesh = _disk_mesh(24 if n <= 500 else 12)
        depth = _depth(run)
        self._shown: list[Array] = [np.empty(0)] * len(self._batches)
        self._handles = [
            scene.add_batched_meshes_trimesh(
                f"/world/disks/{i}",
                mesh,
                batched_wxyzs=about_z(np.zeros(len(batch))),
                batched_positions=np.zeros((len(batch), 3)),
                batched_scales=np.stack((run.radius[batch], run.radius[batch], np.full(len(batch), depth)), axis=1),
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
            )
            for i, batch in enumerate(self._batches)
        ]

    def show(self, frame: int) -> None:
        """Updates the disks that moved since the previous frame."""
        for i, (batch, handle) in enumerate(zip(self._batches, self._handles, strict=True)):
            places = shortened(self._run.positions[frame, batch], 13)
            if not np.array_equal(places, self._shown[i]):
                self._shown[i] = places
                handle.batched_positions = np.column_stack((places[:, :2], np.zeros(len(batch))))
                handle.batched_wxyzs = shortened(about_z(places[:, 2]), 9)


class _Chains:
    """The strongest contacts as bars in front of the disks, wider where the force is larger."""

    def __init__(self, run: SoilRun, scene: Any) -> None:
        self._run = run
        self._n = min(CHAINS, run.force_chains.shape[1])
        loads = np.linalg.norm(run.wheel_forces[1:], axis=-1)
        self._full = max(1e-9, float(np.median(loads, axis=0).max()) if loads.size else 0.0)
        self._width = float(run.radius.mean())
        vertices, triangles = part_mesh(Part("", "box", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), np.eye(3), CHAIN_COLOUR))
        self._handle = scene.add_batched_meshes_simple(
            "/world/chains",
            vertices,
            triangles,
            batched_wxyzs=about_z(np.zeros(self._n)),
            batched_positions=np.zeros((self._n, 3)),
            batched_scales=np.full((self._n, 3), 1e-6),
            batched_colors=rgb(CHAIN_COLOUR),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    def show(self, frame: int) -> None:
        """Updates the bars."""
        chains = self._run.force_chains[frame, : self._n]
        start, end = chains[:, :2], chains[:, 2:4]
        along = end - start
        widths = np.minimum(1.0, np.sqrt(chains[:, 4] / self._full)) * self._width
        height = np.full(self._n, 0.5 * _depth(self._run))
        self._handle.batched_positions = shortened(np.column_stack((0.5 * (start + end), height)), 13)
        self._handle.batched_wxyzs = shortened(about_z(np.arctan2(along[:, 1], along[:, 0])), 9)
        length = np.hypot(along[:, 0], along[:, 1])
        sizes = np.column_stack((length, widths, 0.2 * widths))
        self._handle.batched_scales = np.maximum(shortened(sizes, 13), 1e-6)


def _disk_mesh(sides: int) -> Any:
    """A trimesh cylinder about z of radius 1 and height 1 with two colours; its hidden back is open."""
    trimesh = require("trimesh", "replay")
    around = 2.0 * np.pi * np.arange(sides) / sides
    rim = np.stack((np.cos(around), np.sin(around), np.full(sides, 0.5)), axis=1)
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    corners = [
        np.stack((np.tile([0.0, 0.0, 0.5], (sides, 1)), rim, rim[after]), axis=1),
        np.stack((rim, rim * [1.0, 1.0, -1.0], rim[after] * [1.0, 1.0, -1.0]), axis=1),
        np.stack((rim, rim[after] * [1.0, 1.0, -1.0], rim[after]), axis=1),
    ]
    linear = np.round(255.0 * np.array(SAND_COLOURS) ** 2.2).astype(np.uint8)  # a vertex's colour is linear in glTF
    colours = np.concatenate((linear[(k >= sides // 2).astype(int)], np.tile(linear[1], (2 * sides, 1))))
    vertices = np.concatenate(corners).reshape(-1, 3)
    return trimesh.Trimesh(
        vertices,
        np.arange(len(vertices)).reshape(-1, 3),
        vertex_colors=np.repeat(colours, 3, axis=0),
        process=False,
    )


def surface_mesh(part: Part) -> tuple[Colour, Array, npt.NDArray[np.int32]]:
    """Colour, vertices (n, 3), m, and triangles of a part in its solid's frame."""
    vertices, triangles = part_mesh(part, 48)
    return part.colour, vertices @ part.rotation.T + np.array(part.position), triangles


def wheel_meshes(radius: float, depth: float) -> list[tuple[Colour, Array, npt.NDArray[np.int32]]]:
    """A tyre with three bars across it, about z."""
    to_z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    parts = [
        Part("", "cylinder", (radius, depth), (0.0, 0.0, 0.0), to_z, TYRE_COLOUR),
        Part("", "cylinder", (0.9 * radius, 0.02), (0.0, 0.0, 0.5 * depth), to_z, HUB_COLOUR),
    ]
    for angle in np.pi / 3.0 * np.arange(3):
        turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        parts.append(Part("", "box", (1.8 * radius, 0.05 * radius, 0.02), (0.0, 0.0, 0.55 * depth), turn, TYRE_COLOUR))
    return [surface_mesh(part) for part in parts]


def _add_walls(run: SoilRun, scene: Any) -> None:
    """Slabs under floors, as wide as the soil, and beside upright walls, as high as the soil."""
    x, y = run.positions[..., 0], run.positions[..., 1]
    left, right = float((x - run.radius).min()), float((x + run.radius).max())
    bottom, top = float((y - run.radius).min()), float((y + run.radius).max())
    thick, depth = 0.03, 1.5 * _depth(run)
    for i, (px, py, nx, ny) in enumerate(run.walls):
        length = float(np.hypot(nx, ny))
        n = np.array([nx, ny]) / length
        upright = abs(n[0]) > abs(n[1])
        middle = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
        foot = middle - ((middle - [px, py]) @ n) * n - 0.5 * thick * n
        reach = (top - bottom) if upright else (right - left) + 2.0 * thick
        turn = np.array([[n[1], n[0], 0.0], [-n[0], n[1], 0.0], [0.0, 0.0, 1.0]])
        colour = ROCK_COLOUR if upright else GROUND_COLOUR
        slab = Part("", "box", (reach, thick, depth), (float(foot[0]), float(foot[1]), 0.0), turn, colour)
        add_meshes(scene, f"/world/wall_{i}", [surface_mesh(slab)], cast_shadow=False)


def _seen(run: SoilRun) -> float:
    """Width of the picture, m: the bed, or the rover's surroundings on a longer one."""
    x = run.positions[0, :, 0]
    return min(SOIL_SEEN, SKIRT * float(x.max() - x.min() + 2.0 * run.radius.max()))


def _soil_eye(run: SoilRun, *, follow: bool) -> Array:
    """(n, 2) centre of the picture: the rover's smoothed path, clamped so that soil fills the picture."""
    x = run.positions[0, :, 0]
    left, right = float(x.min()), float(x.max())
    height = float(run.wheels[0, :, 1].mean()) if run.wheels.size else 0.0
    middle = np.full(run.n_frames, 0.5 * (left + right))
    seen = _seen(run)
    if follow and run.wheels.size and right - left > seen:
        middle = moving_mean(run.time, run.wheels[..., 0].mean(axis=1)[:, None], FOLLOW_TIME)[:, 0]
        middle = np.clip(middle, left + 0.5 * seen, right - 0.5 * seen)
    return np.column_stack((middle, np.full(run.n_frames, height)))


def _soil_curves(run: SoilRun) -> dict[str, Any]:
    """Contents of the panel."""
    names = ("wheel",) if run.wheels.shape[1] == 1 else ("back wheel", "front wheel")
    wheels = list(zip(names, PLANAR_WHEEL_COLOURS[: len(names)], strict=True))
    charts = [
        load_chart("wheel load", run.time, run.wheel_forces[..., 1], 1, wheels),
        Chart("sinkage", "mm", 1e3 * run.sinkage, 2, wheels),
        Chart("rim faster than rover", "mm/s", 1e3 * run.slip_speeds, 1, wheels),
    ]
    return panel_contents(run.title, run.time, charts)


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


def _planar_eye(run: PlanarRun, *, follow: bool) -> Array:
    """(n, 2) centre of the picture: the machine's smoothed way, or the middle of all of it."""
    middle = run.discs[..., :2].mean(axis=1)
    if not follow:
        return np.tile(0.5 * (middle.min(axis=0) + middle.max(axis=0)), (run.n_frames, 1))
    return moving_mean(run.time, middle, FOLLOW_TIME)


def _planar_curves(run: PlanarRun) -> dict[str, Any]:
    """Contents of the panel."""
    discs = list(zip(run.names, PLANAR_WHEEL_COLOURS[: len(run.names)], strict=True))
    charts = [
        load_chart("load", run.time, run.loads, 1, discs),
        Chart("gap", "mm", 1e3 * run.trajectory["gaps"], 2, discs),
        Chart("rim faster than machine", "mm/s", 1e3 * run.slip_speeds, 1, discs),
    ]
    return panel_contents(run.title, run.time, charts)
