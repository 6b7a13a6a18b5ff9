"""A rover over its ground as a scene of the player, of a saved run or of a live drive."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField
from rover_gym.core.rotations import continuous, quaternions
from rover_gym.ground.terrain_parts import map_of, surfaces_of
from rover_gym.record.channels import outcome_words
from rover_gym.record.run import moving_mean
from rover_gym.show.frames.appearance import GROUND_COLOUR_2, HAZE, SAND_GROUND, WHEEL_COLOURS
from rover_gym.show.replay.charts import FOLLOW_TIME, Chart, load_chart, panel_contents, with_ghost
from rover_gym.show.replay.overlays import recorded_overlays
from rover_gym.show.replay.page_scene import FrameChannel, PageScene
from rover_gym.show.replay.scenery import (
    MOST_HEIGHTS,
    coloured_meshes,
    first_view,
    goal_meshes,
    ground_plane,
    parts_by_solid,
    spheres,
    surroundings,
    trunk_path,
)
from rover_gym.show.replay.wheel_marks import DrawnWheel, drawn_wheels, feet, marks, rut_edits, world_forces

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rover_gym.core import Terrain
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]

WHEEL_NAMES = {
    "FL": "front left",
    "FR": "front right",
    "ML": "middle left",
    "MR": "middle right",
    "BL": "back left",
    "BR": "back right",
}
LONGEST_FACT = 100
HEAVY = 100.0  # kg: loads of a heavier rover are whole newtons
BEYOND = 45.0  # m of a map that are shown around the piece with all its detail
MOST_AROUND, DIP = 10_000, 0.15  # heights of it, and how far it lies under the edge of that piece, of its cells
PLANE = 400.0  # m, half of the edge of a plane
ABOVE = 0.45  # of the rover's reach: so far above it the eye looks, and the horizon is in the picture
GHOST_COLOUR = (0.55, 0.72, 1.0)
GRAVITY = 9.81  # m/s², of runs that do not say it


def add_rover(scene: PageScene, run: RoverRun) -> list[DrawnWheel]:
    """Adds the solids of a run's rover, which become the next moving frames; returns its wheels."""
    wheels = drawn_wheels(run.model)
    for frame, parts in enumerate(parts_by_solid(run).values(), scene.frames):
        scene.put_mesh(coloured_meshes(parts), frame, "solid")
    scene.frames += len(run.model.solid_names)
    colours = cycle(WHEEL_COLOURS)
    scene.facts["wheels"] = [
        {"frame": wheel.frame, "radius": wheel.radius, "width": wheel.width, "colour": colour, "name": name}
        for wheel, colour, name in zip(wheels, colours, run.model.wheel_names, strict=False)
    ]
    return wheels


def add_ground(scene: PageScene, run: RoverRun) -> None:
    """Adds the ground around a run's path, with its rocks and its goal."""
    plane = ground_plane(run)
    if plane is not None:
        middle = trunk_path(run).mean(axis=0)
        point = middle - (middle @ plane.normal + plane.offset) * plane.normal
        scene.facts["plane"] = {"point": point.tolist(), "normal": plane.normal.tolist(), "half": PLANE}
    add_surfaces(scene, run.terrain, *surroundings(run))
    centres, radii = spheres(run, BEYOND)
    scene.arrays["rocks"] = ("f4", np.column_stack((centres, radii)).ravel())
    scene.put_mesh(goal_meshes(run), role="solid")


def add_surfaces(scene: PageScene, terrain: Terrain, low: Array, high: Array) -> None:
    """Adds height fields, the pieces between the least and the largest x and z, m, and meshes."""
    for surface in surfaces_of(terrain):
        if isinstance(surface, HeightField):
            scene.put_map(*map_of(surface, low, high, MOST_HEIGHTS))
            if (around := map_around(surface, low, high)) is not None:
                scene.put_map(*around)
        else:
            faces = surface.triangles.astype(np.int32)
            scene.put_mesh([(GROUND_COLOUR_2, np.asarray(surface.vertices), faces)], role="soil")


def map_around(surface: HeightField, low: Array, high: Array) -> tuple[Array, Array, Array] | None:
    """The country about a piece of a height field, in less detail, as `map_of`; None where there is no more of it."""
    x, z, heights = map_of(surface, low - BEYOND, high + BEYOND, MOST_AROUND)
    cell = max(float(np.diff(x).max()), float(np.diff(z).max()))
    if (x[[0, -1]] >= low[0]).all() and (x[[0, -1]] <= high[0]).all() and z[0] >= low[1] and z[-1] <= high[1]:
        return None
    # Under the edge of the piece the country dips a little, so that it does not show through; farther in, it ends.
    depth = np.minimum.outer(np.minimum(z - low[1], high[1] - z), np.minimum(x - low[0], high[0] - x))
    heights = np.where(depth > 0.0, heights - DIP * cell, heights)
    return x, z, np.where(depth > 2.0 * cell, np.nan, heights)


def poses_of(positions: Array, rotations: Array) -> list[FrameChannel]:
    """The channels of moving frames: positions (n, count, 3), m, and rotation matrices (n, count, 3, 3)."""
    turns = continuous(quaternions(rotations))[..., [1, 2, 3, 0]]
    return [FrameChannel.fine("places", positions), FrameChannel.turns("turns", turns)]


def bare_scene(run: RoverRun) -> tuple[PageScene, list[DrawnWheel]]:
    """A scene with rover and ground, before anything moves; and the wheels."""
    view = first_view(run)
    centre = trunk_path(run)[0]
    seen = {
        "eye": (view.eye - centre).tolist(),
        "target": (view.target - centre + [0.0, ABOVE * run.model.clear_radius, 0.0]).tolist(),
        "angle": view.field_of_view,
    }
    scene = PageScene("rover", seen, float(run.model.clear_radius))
    scene.facts |= {"title": run.title, "rover": True, "shadow": True, "haze": HAZE[1], "far": 2.0 * PLANE}
    if run.on_sand:
        scene.facts["soil"] = list(SAND_GROUND)
    wheels = add_rover(scene, run)
    add_ground(scene, run)
    return scene, wheels


def mass_channel(run: RoverRun) -> FrameChannel:
    """The mass centre of a run's rover."""
    centres = [run.model.tags(q)["centre_of_mass"] for q in run.trajectory["q"]]
    return FrameChannel.fine("mass", np.array(centres)[:, None])


def add_ghost(scene: PageScene, run: RoverRun, ghost: RoverRun) -> tuple[Array, Array]:
    """Adds the rover of another run, translucent; returns its poses at the first run's times.

    A ghost whose run is shorter stays where it ended.
    """
    for frame, parts in enumerate(parts_by_solid(ghost).values(), scene.frames):
        meshes = coloured_meshes(parts)
        scene.put_mesh([(GHOST_COLOUR, points, corners) for _, points, corners in meshes], frame, "ghost")
    scene.frames += len(ghost.model.solid_names)
    times = ghost.time - ghost.time[0]
    rows = np.searchsorted(times, run.time - run.time[0] - 1e-9).clip(0, ghost.n_frames - 1)
    scene.facts["curves"] = with_ghost(rover_curves(run), rover_curves(ghost))
    return ghost.positions[rows], ghost.rotations[rows]


def rover_scene(run: RoverRun, *, follow: bool, ghost: RoverRun | None = None) -> PageScene:
    """A rover's run as a scene; without `follow` the eye stays where it is. A second run is shown as a ghost."""
    scene, wheels = bare_scene(run)
    path = trunk_path(run)
    centre = moving_mean(run.time, path, FOLLOW_TIME) if follow else np.tile(path[0], (run.n_frames, 1))
    points, normals, across = feet(run, wheels)
    forces = world_forces(run.mean(lambda run: run.trajectory["wheel_forces"]), normals, across)
    share = run.model.mass * _gravity(run) / max(1, len(wheels))
    positions, rotations = run.positions, run.rotations
    scene.facts["curves"] = rover_curves(run)
    if ghost is not None:
        places, turns = add_ghost(scene, run, ghost)
        positions, rotations = np.concatenate((positions, places), 1), np.concatenate((rotations, turns), 1)
    scene.channels += [
        *poses_of(positions, rotations),
        FrameChannel.fine("centre", centre[:, None]),
        FrameChannel.fine("forces", np.concatenate((points, np.clip(forces / share, -1e4, 1e4)), axis=2)),
        FrameChannel.turns("normals", normals),
    ]
    attributes = run.trajectory.attributes
    overlays = recorded_overlays(run.trajectory.data, attributes.get("scene", {}), run.terrain)
    recorded = run.trajectory.data.get("friction")
    if recorded is not None and recorded.ndim == 1:  # a live drive may change it
        scene.channels.append(FrameChannel.fine("friction", recorded[:, None, None]))
    elif (friction := _friction(attributes)) is None:
        overlays.missing["cones"] = "this run has no recorded friction coefficient"
    else:
        scene.facts["friction"] = friction
    if "q" in run.trajectory.data:
        scene.channels.append(mass_channel(run))
    scene.channels += overlays.channels()
    overlays.describe(scene, run.model)
    scene.arrays["trail"] = ("f4", marks(run, wheels, points).ravel())
    ruts = rut_edits(run, wheels, points, across)
    if ruts is not None:
        rut_map, samples, cells, levels = ruts
        scene.facts["ruts"] = rut_map.header()
        scene.arrays |= {"rut-sample": ("u4", samples), "rut-cell": ("u4", cells), "rut-level": ("u1", levels)}
    scene.facts["events"] = _events(run.whole)
    return scene


def _gravity(run: RoverRun) -> float:
    """Magnitude of gravity, m/s²."""
    solver = run.trajectory.attributes.get("solver", {})
    vector = solver.get("gravity") if isinstance(solver, dict) else None
    return GRAVITY if vector is None else max(1e-3, float(np.linalg.norm(vector)))


def _friction(attributes: Mapping[str, Any]) -> float | None:
    """The friction coefficient of wheels and ground, as far as a run says it."""
    for part in ("scene", "solver"):
        settings = attributes.get(part)
        value = settings.get("friction") if isinstance(settings, dict) else None
        if isinstance(value, (int, float)) and 0.0 <= value < np.inf:
            return float(value)
    return None


def facts(run: RoverRun) -> list[str]:
    """What the run was, for the panel: its ground, seed, difficulty and outcome, as far as the file says them."""
    attributes = run.trajectory.attributes
    scene = attributes.get("scene", {})
    terrain, seed, outcome = scene.get("terrain"), attributes.get("seed"), attributes.get("outcome")
    rocks = scene.get("rocks")
    difficulty = rocks.get("difficulty") if isinstance(rocks, dict) else None
    slope = scene.get("slope")
    found = [
        f"scene: {terrain}" if isinstance(terrain, str) else None,
        f"slope: {np.degrees(slope):.1f} degrees" if isinstance(slope, float) and slope else None,
        f"seed: {seed}" if isinstance(seed, (int, np.integer)) else None,
        f"difficulty: {difficulty:.2g}" if isinstance(difficulty, float) else None,
        f"outcome: {outcome_words(str(outcome))}" if outcome is not None else None,
    ]
    return [fact[:LONGEST_FACT] for fact in found if fact is not None]


def _depths(run: RoverRun, wheels: list[tuple[str, str]]) -> Chart:
    """The wheels' gaps, or how deep they are in sand."""
    gaps = 1e3 * run.trajectory["wheel_gaps"]
    if run.on_sand:
        return Chart("sinkage", "mm", -gaps, 2, wheels)
    return Chart("wheel gap", "mm", gaps, 2, wheels, shown=bool(np.any(gaps > 1.0)))


def rover_curves(run: RoverRun) -> dict[str, Any]:
    """Contents of the panel; the first charts are shown at once."""
    data = run.trajectory
    wheels = [
        (WHEEL_NAMES.get(name, name), colour)
        for name, colour in zip(run.model.wheel_names, cycle(WHEEL_COLOURS), strict=False)
    ]
    blue, orange = WHEEL_COLOURS[0], WHEEL_COLOURS[3]
    digits = 0 if run.model.mass > HEAVY else 1
    charts = [
        load_chart("wheel load", run, lambda run: run.trajectory["wheel_forces"][:, :, 0], digits, wheels),
        _depths(run, wheels),
    ]
    if "v" in data.data:
        speed = run.mean(lambda run: np.linalg.norm(run.trajectory["v"][:, [0, 2]], axis=1, keepdims=True))
        charts.append(Chart("speed", "m/s", speed, 3, [("speed", blue)]))
    lean = np.degrees(data["q"][:, [3, 5]])
    charts.append(Chart("attitude", "degrees", lean, 2, [("roll", blue), ("pitch", orange)], shown=False))
    if "slip_ratio" in data.data:
        slip = run.mean(lambda run: run.trajectory["slip_ratio"][:, None])
        charts.append(Chart("slip", "1", slip, 3, [("slip", blue)], shown=False))
    if "motor_energy" in data.data:
        work = "work of the motors"
        charts.append(Chart(work, "J", data["motor_energy"][:, None], 1, [(work, blue)], shown=False))
    if "motor_torques" in data.data:
        torques = run.mean(lambda run: run.trajectory["motor_torques"])
        charts.append(Chart("motor torque", "N m", torques, 2, wheels, shown=False))
    return panel_contents(run.title, run.time, charts, facts(run))


def _events(run: RoverRun) -> list[dict[str, Any]]:
    """What the timeline marks: wheels that leave the ground or hit hard, and the end."""
    time = run.time - run.time[0]
    data = run.trajectory.data
    events: list[dict[str, Any]] = []
    loads = data["wheel_forces"][:, :, 0]
    share = run.model.mass * _gravity(run) / max(1, loads.shape[1])
    for name, load in zip(run.model.wheel_names, loads.T, strict=False):
        hard = load > 4.0 * share
        begins = np.flatnonzero(hard & ~np.concatenate(([False], hard[:-1])))
        words = WHEEL_NAMES.get(name, name)
        events += [
            {"time": round(float(time[k]), 3), "name": f"{words} wheel hits with {load[k]:.0f} N"} for k in begins
        ]
    events = sorted(events, key=lambda event: event["time"])[:200]
    outcome = run.trajectory.attributes.get("outcome")
    if outcome is not None:
        events.append({"time": round(float(time[-1]), 3), "name": outcome_words(str(outcome))})
    return events
