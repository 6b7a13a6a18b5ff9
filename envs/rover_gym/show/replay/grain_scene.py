"""A run of balls in space as a scene of the player: tens of thousands of balls, walls, and the rover among them.

The places of the balls are 16-bit numbers between bounds, which the graphics card takes as they are.
"""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.core.rotations import continuous, quaternions
from rover_gym.ground.terrain_parts import plane_of, spheres_of
from rover_gym.record.run import moving_mean
from rover_gym.show.frames.appearance import (
    FIXED_BALL_COLOUR,
    GROUND_COLOUR,
    HAZE,
    ROCK_COLOUR,
    SAND_COLOUR,
    TILE,
    WHEEL_COLOURS,
)
from rover_gym.show.replay.charts import FOLLOW_TIME, Chart, load_chart, panel_contents
from rover_gym.show.replay.flat_scene import CHAIN_COLOUR
from rover_gym.show.replay.page_scene import FrameChannel, PageScene
from rover_gym.show.replay.rover_scene import ABOVE, GRAVITY, PLANE, add_ground, add_rover, add_surfaces, mass_channel
from rover_gym.show.replay.scenery import (
    MARGIN,
    first_view,
    vessel_meshes,
    vessel_poses,
    wall_polygons,
    wall_poses,
)

if TYPE_CHECKING:
    from rover_gym.record.grain_run import GrainRun

Array = npt.NDArray[np.float64]

COLOURS = ("#332288", "#CC6677")

SHOWN_CHAINS = 96  # of the strongest contacts

LEAST_WIDTH = 0.05  # of the widest bar

MANY = 300  # spheres of the ground, above which each gets fewer triangles

Faces = npt.NDArray[np.int32]


def grain_curves(run: GrainRun) -> dict[str, Any]:
    """Contents of the panel."""
    data = run.trajectory
    charts: list[Chart] = []
    if run.model is not None:
        wheels = list(zip(run.model.wheel_names, cycle(WHEEL_COLOURS), strict=False))
        charts += [
            load_chart("wheel load", run, lambda run: run.wheel_forces[..., 1], 1, wheels),
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


class StartView(NamedTuple):
    """A viewpoint: eye and target, m, and the vertical field of view, rad."""

    eye: list[float]
    target: list[float]
    angle: float


def start_view(run: GrainRun) -> StartView:
    """The view at the start: beside the rover, or so that all balls are in it."""
    if run.rover is not None:
        view = first_view(run.rover)
        target = view.target + np.array([0.0, ABOVE * run.rover.model.clear_radius, 0.0])
        return StartView(view.eye.tolist(), target.tolist(), view.field_of_view)
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


MAX_SIZE = 2.0  # bounds of the places: at least this many sizes of the first sample to each side of it
MAX_RADII = 1600.0  # and this many radii, which levels of 16 bits resolve to a twentieth of a radius


def grain_scene(run: GrainRun, *, follow: bool) -> PageScene:
    """A run of balls as a scene.

    Raises:
        RecordingError: The recording is damaged.
    """
    rover = run.rover
    reach = float(np.linalg.norm(start_extent(run))) if rover is None else float(rover.model.clear_radius)
    scene = PageScene("grains", start_view(run)._asdict(), reach)
    scene.facts |= {
        "title": run.title,
        "rover": rover is not None,
        "shadow": rover is not None,
        "radius": float(run.radius.mean()),
        "sand": [SAND_COLOUR, FIXED_BALL_COLOUR],
        "far": 60.0 * reach if rover is None else 2.0 * PLANE,
        "curves": grain_curves(run),
    }
    n = run.n_frames
    places, turns = np.zeros((n, 0, 3)), np.zeros((n, 0, 4))
    if rover is not None:
        add_rover(scene, rover)
        places, turns = rover.positions, continuous(quaternions(rover.rotations))[..., [1, 2, 3, 0]]
    _add_ground(scene, run)
    plane = floor_of(run)
    if plane is not None:
        scene.facts["plane"] = {"point": plane[0].tolist(), "normal": plane[1].tolist()}
        scene.facts["plane"] |= {"half": 40.0 * reach if rover is None else PLANE}
        scene.facts |= {"haze": HAZE[1] if rover is not None else 24.0 * reach, "tile": tile_of(run)}
    of_walls = wall_polygons(run, GROUND_COLOUR, ROCK_COLOUR)
    for i, mesh in enumerate(of_walls):
        if plane is None or (i < run.walls.shape[1] and not _is_level(run, i, plane[0])):
            scene.put_mesh([mesh], scene.frames + i)
    scene.put_mesh(vessel_meshes(run, ROCK_COLOUR, GROUND_COLOUR), scene.frames + len(of_walls))
    scene.frames += len(of_walls) + 1
    poses = np.concatenate((wall_poses(run), vessel_poses(run)[:, None]), axis=1)
    low, high = _bounds(run)
    scene.channels = [
        FrameChannel.fine("places", np.concatenate((places, poses[..., :3]), axis=1)),
        FrameChannel.turns("turns", np.concatenate((turns, poses[..., 3:]), axis=1)),
        FrameChannel.fine("centre", eye_path(run, follow=follow)[:, None]),
        FrameChannel.within("balls", run.positions, low, high),
    ]
    scene.arrays |= {"radii": ("f4", run.radius), "fixed": ("u1", run.kinematic)}
    if run.force_chains.size:
        chains = _chains(run)
        flat = chains.reshape(-1, 7)
        scene.channels.append(FrameChannel.within("chains", chains, flat.min(axis=0), flat.max(axis=0)))
        scene.facts["chain"] = CHAIN_COLOUR
    if rover is None:
        scene.channels.append(FrameChannel.fine("mass", mass_centres(run)[:, None]))
    else:
        share = rover.model.mass * GRAVITY / max(1, run.wheel_centres.shape[1])
        scene.channels.append(
            FrameChannel.fine(
                "forces", np.concatenate((run.wheel_centres, run.mean(lambda run: run.wheel_forces) / share), axis=2)
            )
        )
        scene.channels.append(mass_channel(rover))
        scene.arrays["trail"] = ("f4", _wheel_paths(run).ravel())
        scene.facts["missing"] = {
            "marks": "tyres leave no marks on balls",
            "cones": "a wheel touches many balls, each with its own normal",
            "slope": "the ground is balls",
            **dict.fromkeys(("plan", "scan", "laser", "depth"), "not recorded in a run of balls"),
        }
    return scene


def _chains(run: GrainRun) -> Array:
    """(n, n_chains, 7) ends and width of the strongest contacts as bars, m."""
    chains = run.force_chains[:, :SHOWN_CHAINS].copy()
    strongest = chains[..., 6].max(axis=1)
    full = max(1e-9, float(np.median(strongest[strongest > 0.0])) if (strongest > 0.0).any() else 0.0)
    # Most of the contacts are weak: what would be thinner than a twentieth is not drawn.
    width = np.minimum(1.0, np.sqrt(chains[..., 6] / full))
    chains[..., 6] = np.where(width < LEAST_WIDTH, 0.0, width) * float(run.radius.mean())
    return chains


def mass_centres(run: GrainRun) -> Array:
    """(n, 3) mass centre of the balls that forces move, m."""
    free = ~run.kinematic if (~run.kinematic).any() else np.ones(len(run.mass), dtype=bool)
    weights = run.mass[free] / run.mass[free].sum()
    result: Array = np.einsum("nbk,b->nk", run.positions[:, free].astype(np.float64), weights)
    return result


def _wheel_paths(run: GrainRun) -> npt.NDArray[np.float32]:
    """(n, n_wheels, 3) lowest points of the wheels, m; nan where a wheel bears nothing."""
    radii = np.zeros(0) if run.model is None else np.asarray(run.model.wheel_radii)
    points = run.wheel_centres.astype(np.float32)
    bears = np.linalg.norm(run.wheel_forces, axis=2) > 0.0
    points[..., 1] = np.where(bears, points[..., 1] - radii, np.nan)
    return points


def tile_of(run: GrainRun) -> float:
    """Edge of the ground's tiles, m: a heap stands on smaller ones than a rover."""
    return TILE if run.rover is not None else 0.25 * float(np.linalg.norm(start_extent(run)))


def floor_of(run: GrainRun) -> tuple[Array, Array] | None:
    """A point, m, and the normal of the plane on which all stands: the ground's, or a level wall below all balls."""
    if run.terrain is not None:
        plane = plane_of(run.terrain)
        return None if plane is None else (-plane.offset * plane.normal, plane.normal)
    if run.vessel is not None:
        return None
    level = [wall for i, wall in enumerate(run.walls[0]) if _is_level(run, i, run.walls[0, i, :3])]
    return (level[0][:3], np.array([0.0, 1.0, 0.0])) if level else None


def _is_level(run: GrainRun, number: int, point: Array) -> bool:
    """Whether a wall is level, at the height of a point, and stays there."""
    wall = run.walls[:, number]
    upright = wall[:, 4] / np.linalg.norm(wall[:, 3:], axis=1)
    return bool(np.all(upright > 1.0 - 1e-9) and np.all(np.abs(wall[:, 1] - point[1]) < 1e-6))


def start_extent(run: GrainRun) -> Array:
    """(3,) size of the balls' heap at the start, without the farthest of them, m."""
    first = run.positions_of(run.rows[:1])[0].astype(np.float64)
    extent: Array = np.quantile(first, 0.99, axis=0) - np.quantile(first, 0.01, axis=0) + 2.0 * float(run.radius.max())
    return extent


def _bounds(run: GrainRun) -> tuple[Array, Array]:
    """Bounds of the balls' places, m, within `MAX_SIZE` of the first sample: a ball that falls for ever stops there."""
    places = run.positions
    low, high = places.min(axis=(0, 1)).astype(np.float64), places.max(axis=(0, 1)).astype(np.float64)
    first = places[0].astype(np.float64)
    extent, radius = float((first.max(axis=0) - first.min(axis=0)).max()), float(run.radius.mean())
    size = max(MAX_SIZE * extent + 4.0 * radius, MAX_RADII * radius)
    return np.maximum(low, first.min(axis=0) - size), np.minimum(high, first.max(axis=0) + size)


def _add_ground(scene: PageScene, run: GrainRun) -> None:
    """Adds the fixed ground about the rover's path, or under the balls."""
    if run.rover is not None:
        add_ground(scene, run.rover)
    elif run.terrain is not None:
        places = run.positions_of(run.rows[:1])[0][:, [0, 2]].astype(np.float64)
        add_surfaces(scene, run.terrain, places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN)
        centres, radii = spheres_of(run.terrain)
        scene.arrays["rocks"] = ("f4", np.column_stack((centres, radii)).ravel())
