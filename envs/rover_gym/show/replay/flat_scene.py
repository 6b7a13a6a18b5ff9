"""Runs in the plane as scenes of the player: a ball or a two-wheel rover over its ground, and disks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import PlanarGround, Polyline, RoverModel
from rover_gym.record.run import moving_mean
from rover_gym.show.frames.appearance import (
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
from rover_gym.show.replay.charts import FOLLOW_TIME, Chart, load_chart, panel_contents
from rover_gym.show.replay.page_scene import FrameChannel, PageScene

if TYPE_CHECKING:
    from rover_gym.record.disk_run import DiskRun
    from rover_gym.record.planar_run import PlanarRun

SAND_COLOURS: tuple[Colour, Colour] = (
    (0.97, 0.90, 0.76),
    (0.86, 0.75, 0.56),
)  # of a disk's halves: they show its rotation
CHAIN_COLOUR: Colour = (0.80, 0.0, 0.10)
DEPTH = 1.0  # out-of-plane thickness of disks, in mean diameters
CHAINS = 300  # strongest contacts drawn
DISKS_SEEN = 1.8  # m of the bed in view at most
SKIRT = 1.04  # width of the picture, in widths of the bed
DISKS_ASPECT = 1.2  # width over height of the picture
FIELD_OF_VIEW = 0.35  # rad, vertical: narrow and far away, for little perspective

SEEN = 9.0  # width of the picture, in diameters of the largest disc
ASPECT = 1.5  # width over height of the picture
LAND = 1.5  # picture widths of ground beyond the way
TILE = 0.5  # m, length of the ground's squares
ARROW = 2.5  # longest radii: 0.45 of it are the arrow of a disc's share of the weight
STANDARD_GRAVITY = 9.81  # m/s²
THICK = 0.4  # of a disc along its axle, in its radii


Array = npt.NDArray[np.float64]


def planar_scene(run: PlanarRun, *, follow: bool) -> PageScene:
    """A planar run as a scene."""
    largest = float(run.radius.max())
    distance = SEEN * largest / (ASPECT * np.tan(0.5 * FIELD_OF_VIEW))
    scene = PageScene("planar", _view(0.0, 0.18 * distance, distance, ASPECT), largest)
    _add_wheels(scene, run.discs, run.radius, THICK * run.radius, 0.25 * largest, 0.4 * largest)
    scene.put_mesh(_ground(run))
    centre = np.column_stack((_planar_eye(run, follow=follow), np.zeros(run.n_frames)))
    scene.channels.append(FrameChannel.fine("centre", centre[:, None]))
    scene.facts |= {"title": run.title, "front": True, "far": 20.0 * distance, "curves": _planar_curves(run)}
    _add_forces(scene, run)
    return scene


def _add_forces(scene: PageScene, run: PlanarRun) -> None:
    """Adds forces and friction cones of the discs, in shares of the weight, at the nearest points of the ground."""
    gravity = float(np.linalg.norm(run.trajectory.attributes["solver"].get("gravity", (0.0, -STANDARD_GRAVITY))))
    share = mass_of(run.trajectory.attributes["scene"]["machine"]) * max(gravity, 1e-3) / len(run.radius)
    feet, normals = nearest_points(run)
    tangents = np.stack((normals[..., 1], -normals[..., 0]), axis=-1)

    def along(run: PlanarRun) -> Array:
        return run.trajectory["impulses"] / run.time_step

    if run.forces is None:
        parts = run.mean(along)
        forces = parts[..., :1] * normals + parts[..., 1:] * tangents
    else:
        forces = run.mean(lambda run: np.asarray(run.forces))
    front = np.broadcast_to(0.5 * THICK * run.radius[:, None], (*feet.shape[:2], 1))
    flat = np.zeros((*feet.shape[:2], 1))
    shares = np.clip(forces / share, -1e4, 1e4)
    scene.channels.append(FrameChannel.fine("forces", np.concatenate((feet, front, shares, flat), axis=2)))
    scene.channels.append(FrameChannel.turns("normals", np.concatenate((normals, flat), axis=2)))
    scene.facts |= {"friction": float(run.trajectory.attributes["solver"]["friction"]), "on": ["forces", "cones"]}
    scene.facts["arrow"] = ARROW * float(run.radius.max())
    scene.facts["wheels"] = [
        {"frame": i, "radius": float(radius), "width": float(THICK * radius), "colour": colour, "name": name}
        for i, (radius, colour, name) in enumerate(zip(run.radius, PLANAR_WHEEL_COLOURS, run.names, strict=False))
    ]


def mass_of(machine: dict[str, Any]) -> float:
    """Mass of a planar machine from its recorded parameters, kg."""
    if "model" in machine:
        return float(RoverModel.from_dict(machine["model"]).mass)
    return float(machine["mass"]) + float(np.sum(machine.get("wheel_mass", 0.0)))


def nearest_points(run: PlanarRun) -> tuple[Array, Array]:
    """Nearest points of the ground to the discs' centres, m, and normals there, (n, n_discs, 2) both."""
    feet, normals = np.zeros((2, run.n_frames, len(run.radius), 2))
    for k, centres in enumerate(run.discs[..., :2]):
        feet[k], normals[k] = _nearest(run.ground, centres, run.radius[:, None])
    return feet, normals


def _nearest(ground: PlanarGround, centres: Array, radius: Array) -> tuple[Array, Array]:
    """Nearest points of the ground, m, and its normals there in one frame, from centres (n_discs, 2) and radii, m."""
    x = centres[:, :1] + np.linspace(-1.5, 1.5, 97) * radius
    if isinstance(ground, Polyline):
        near = (ground.x >= x.min()) & (ground.x <= x.max())
        ends = np.array([x.min(), x.max()])
        xs = np.concatenate((ends[:1], ground.x[near], ends[1:]))
        y = np.concatenate((ground.height(ends[:1]), ground.y[near], ground.height(ends[1:])))
        points = np.broadcast_to(np.column_stack((xs, y)), (len(centres), len(xs), 2))
    else:
        points = np.stack((x, ground.height(x.ravel()).reshape(x.shape)), axis=-1)
    way = np.diff(points, axis=1)
    length = np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-12)
    share = ((centres[:, None] - points[:, :-1]) * way).sum(axis=2, keepdims=True) / length**2
    places = points[:, :-1] + np.clip(share, 0.0, 1.0) * way
    disc = np.arange(len(centres))
    k = np.argmin(np.linalg.norm(centres[:, None] - places, axis=2), axis=1)
    feet, along = places[disc, k], (way / length)[disc, k]
    normals = np.column_stack((-along[:, 1], along[:, 0]))
    out = centres - feet
    far = np.linalg.norm(out, axis=1, keepdims=True)
    # At a corner the normal points to the centre. Where the centre itself stops at the ground it does not.
    above = (far > 0.2 * radius) & ((out * normals).sum(axis=1, keepdims=True) > 0.0)
    return feet, np.where(above, out / np.maximum(far, 1e-12), normals)


def disk_scene(run: DiskRun, *, follow: bool) -> PageScene:
    """A run on disks as a scene."""
    eye = _disk_eye(run, follow=follow)
    distance = 0.5 * _seen(run) / (DISKS_ASPECT * np.tan(0.5 * FIELD_OF_VIEW))
    scene = PageScene("disks", _view(float(eye[0, 1]), 0.1 * distance, distance, DISKS_ASPECT), 0.5 * _seen(run))
    depth, radius = _depth(run), run.wheels[0, :, 2]
    poses = np.concatenate((run.wheels[..., :2], run.wheel_angles[..., None]), axis=2)
    _add_wheels(scene, poses, radius, np.full(len(radius), depth), 0.05, 0.8 * depth)
    scene.put_mesh(_walls(run))
    low, high = run.positions.min(axis=(0, 1)), run.positions.max(axis=(0, 1))
    scene.channels += [
        FrameChannel.fine("centre", np.column_stack((eye[:, 0], np.zeros((run.n_frames, 2))))[:, None]),
        FrameChannel.within("disks", run.positions, low, high),
        FrameChannel.fine("chains", _chains(run)),
    ]
    scene.arrays["radii"] = ("f4", run.radius)
    scene.facts |= {"title": run.title, "flat": True, "far": 20.0 * distance, "chain": CHAIN_COLOUR}
    scene.facts |= {"front": True, "sand": SAND_COLOURS, "curves": _disk_curves(run)}
    return scene


def _view(height: float, up: float, distance: float, aspect: float) -> dict[str, Any]:
    eye, target = [0.0, height + up, distance], [0.0, height, 0.0]
    return {"eye": eye, "target": target, "angle": FIELD_OF_VIEW, "aspect": aspect}


def about_z(angles: Array) -> Array:
    """(..., 4) unit quaternions x, y, z, w of rotations about z."""
    zero = np.zeros_like(angles)
    return np.stack((zero, zero, np.sin(0.5 * angles), np.cos(0.5 * angles)), axis=-1)


def _depth(run: DiskRun) -> float:
    return 2.0 * DEPTH * float(run.radius.mean())


def _add_wheels(scene: PageScene, poses: Array, radius: Array, depth: Array, body: float, ahead: float) -> None:
    """Wheels or a ball and, between the first and the last of several, the body, on moving frames.

    Args:
        scene: The scene.
        poses: (n, n_wheels, 3) centres, m, and angles, rad.
        radius: (n_wheels,) m.
        depth: (n_wheels,) thickness, m.
        body: Height of the body, m.
        ahead: How far the body stands before the wheels, m.
    """
    for r, thick in zip(radius, depth, strict=True):
        scene.put_mesh(wheel_meshes(float(r), float(thick)), scene.frames)
        scene.frames += 1
    if len(radius) > 1:
        length = float(np.hypot(*(poses[0, -1, :2] - poses[0, 0, :2])))
        beam = Part("", "box", (length, body, 0.02), (0.0, 0.0, ahead), np.eye(3), AXLE_COLOUR)
        scene.put_mesh([surface_mesh(beam)], scene.frames)
        scene.frames += 1
        middle, along = poses[..., :2].mean(axis=1), poses[:, -1, :2] - poses[:, 0, :2]
        bodies = np.column_stack((middle, np.arctan2(along[:, 1], along[:, 0])))
        poses = np.concatenate((poses, bodies[:, None]), axis=1)
    places = np.concatenate((poses[..., :2], np.zeros_like(poses[..., :1])), axis=2)
    scene.channels += [FrameChannel.fine("places", places), FrameChannel.turns("turns", about_z(poses[..., 2]))]


def _chains(run: DiskRun) -> Array:
    """(n, n_chains, 5) ends x, y, x, y and width of the strongest contacts as bars, m."""
    chains = run.force_chains[:, :CHAINS].copy()
    loads = np.linalg.norm(run.wheel_forces[1:], axis=-1)
    full = max(1e-9, float(np.median(loads, axis=0).max()) if loads.size else 0.0)
    chains[..., 4] = np.minimum(1.0, np.sqrt(chains[..., 4] / full)) * float(run.radius.mean())
    return chains


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


def _walls(run: DiskRun) -> list[tuple[Colour, Array, npt.NDArray[np.int32]]]:
    """Slabs under floors, as wide as the bed, and beside upright walls, as high as the bed."""
    x, y = run.positions[..., 0], run.positions[..., 1]
    left, right = float((x - run.radius).min()), float((x + run.radius).max())
    bottom, top = float((y - run.radius).min()), float((y + run.radius).max())
    thick, depth = 0.03, 1.5 * _depth(run)
    slabs = []
    for px, py, nx, ny in run.walls:
        length = float(np.hypot(nx, ny))
        n = np.array([nx, ny]) / length
        upright = abs(n[0]) > abs(n[1])
        middle = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
        foot = middle - ((middle - [px, py]) @ n) * n - 0.5 * thick * n
        reach = (top - bottom) if upright else (right - left) + 2.0 * thick
        turn = np.array([[n[1], n[0], 0.0], [-n[0], n[1], 0.0], [0.0, 0.0, 1.0]])
        colour = ROCK_COLOUR if upright else GROUND_COLOUR
        slabs.append(
            surface_mesh(Part("", "box", (reach, thick, depth), (float(foot[0]), float(foot[1]), 0.0), turn, colour))
        )
    return slabs


def _seen(run: DiskRun) -> float:
    """Width of the picture, m: the bed, or the rover's surroundings on a longer one."""
    x = run.positions[0, :, 0]
    return min(DISKS_SEEN, SKIRT * float(x.max() - x.min() + 2.0 * run.radius.max()))


def _disk_eye(run: DiskRun, *, follow: bool) -> Array:
    """(n, 2) centre of the picture: the rover's smoothed path, clamped so that disks fill the picture."""
    x = run.positions[0, :, 0]
    left, right = float(x.min()), float(x.max())
    height = float(run.wheels[0, :, 1].mean()) if run.wheels.size else 0.0
    middle = np.full(run.n_frames, 0.5 * (left + right))
    seen = _seen(run)
    if follow and run.wheels.size and right - left > seen:
        middle = moving_mean(run.time, run.wheels[..., 0].mean(axis=1)[:, None], FOLLOW_TIME)[:, 0]
        middle = np.clip(middle, left + 0.5 * seen, right - 0.5 * seen)
    return np.column_stack((middle, np.full(run.n_frames, height)))


def _disk_curves(run: DiskRun) -> dict[str, Any]:
    """Contents of the panel."""
    names = ("wheel",) if run.wheels.shape[1] == 1 else ("back wheel", "front wheel")
    wheels = list(zip(names, PLANAR_WHEEL_COLOURS[: len(names)], strict=True))
    charts = [
        load_chart("wheel load", run, lambda run: run.wheel_forces[..., 1], 1, wheels),
        Chart("sinkage", "mm", 1e3 * run.sinkage, 2, wheels),
        Chart("rim speed minus forward speed", "mm/s", 1e3 * run.mean(lambda run: run.slip_speeds), 1, wheels),
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
        load_chart("load", run, lambda run: run.loads, 1, discs),
        *_impulse_charts(run, discs),
        Chart("gap", "mm", 1e3 * run.trajectory["gaps"], 2, discs),
        Chart("rim speed minus forward speed", "mm/s", 1e3 * run.mean(lambda run: run.slip_speeds), 1, discs),
    ]
    return panel_contents(run.title, run.time, charts)


def _impulse_charts(run: PlanarRun, discs: list[tuple[str, str]]) -> list[Chart]:
    """Impulses of the ground since the previous frame, along normal and tangent."""
    whole = run.whole
    steps = np.diff(whole.time, prepend=whole.time[0])[:, None, None] / run.time_step
    sums = np.cumsum(whole.trajectory["impulses"] * steps, axis=0)
    impulses = np.diff(sums[run.rows], axis=0, prepend=np.nan)
    every = float(np.median(np.diff(run.time))) if run.n_frames > 1 else 0.0
    title = "{} impulse" + f" in {1e3 * every:.3g} ms"
    return [
        Chart(title.format("normal"), "N s", impulses[..., 0], 3, discs, cut=False),
        Chart(title.format("friction"), "N s", impulses[..., 1], 3, discs, cut=False),
    ]
