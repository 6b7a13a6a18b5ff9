"""The scenery of every export format: a checkered patch of ground, spheres, the goal and a viewpoint."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import HeightField, Plane, TriangleMesh
from rover_gym.core.rotations import quaternions
from rover_gym.ground.terrain_parts import heights_of, plane_of, spheres_of, surfaces_of, triangles_of
from rover_gym.show.frames.appearance import (
    COLUMN_COLOUR,
    GOAL_COLOUR,
    GROUND_COLOUR,
    GROUND_COLOUR_2,
    ROCK_COLOUR,
    SAND_GROUND,
    Colour,
    Part,
    part_mesh,
    pennant,
    rover_parts,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rover_gym.record.grain_run import GrainRun
    from rover_gym.record.rover_run import RoverRun
    from rover_gym.show.frames.appearance import Colour


TILE = 0.5  # m, edge of the ground's squares, doubled until their number is acceptable

MOST_TILES = 20_000

SQUARE = 1.0  # m, edge of the squares that are painted on a height field

MOST_HEIGHTS = 40_000  # shown of a height field

LARGE = 0.12  # m, radius of a rock that is seen from afar

MARGIN = 5.0  # m of ground around the path

LONGEST_NAME = 60

GOAL_POLE = 0.8  # m, height

FLAG_POLE = 1.5  # m, height of the page's

RING, RING_LIFT = 64, 0.015  # points of the goal's ring, and its height over the ground, m

NEARNESS = 3.7  # of the eye, in radii of the circle that the rover stands in

Array = npt.NDArray[np.float64]

Triangles = npt.NDArray[np.int32]


@dataclass(frozen=True)
class View:
    """A viewpoint: eye and target in the world frame, m, and the vertical field of view, rad."""

    eye: Array
    target: Array
    field_of_view: float = np.pi / 4


def identifiers(names: Iterable[str], taken: Iterable[str] = (), endings: Iterable[str] = ()) -> dict[str, str]:
    """Identifiers for names, valid in every format: letters, digits and underscores, a letter first.

    Valid names stay; others get underscores, and a number where two would collide.

    Args:
        names: Names from a file, any text.
        taken: Names already in use.
        endings: A name must also be free with each of these suffixes.
    """
    used, result, forms = set(taken), {}, ("", *endings)
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name[:LONGEST_NAME])
        stem = plain if plain[:1].isalpha() else f"solid_{plain}"
        chosen, n = stem, 1
        while any(chosen + form in used for form in forms):
            n += 1
            chosen = f"{stem}_{n}"
        used |= {chosen + form for form in forms}
        result[name] = chosen
    return result


def trunk_path(run: RoverRun) -> Array:
    """(n, 3) trunk origin in the world frame, m."""
    return run.trajectory["q"][:, :3]


def ground_plane(run: RoverRun) -> Plane | None:
    """The plane of the ground, if there is one."""
    return plane_of(run.terrain)


def spheres(run: RoverRun, beyond: float = 0.0) -> tuple[Array, Array]:
    """Centres (n, 3) and radii (n,) of the ground's spheres, m: on a map those of the piece that is shown.

    Args:
        run: The run.
        beyond: How far around the piece large ones are shown too, m.
    """
    centres, radii = spheres_of(run.terrain)
    if ground_plane(run) is None and any(isinstance(surface, HeightField) for surface in surfaces_of(run.terrain)):
        low, high = surroundings(run)
        places = centres[:, [0, 2]]
        near = ((low <= places) & (places <= high)).all(axis=1)
        far = ((low - beyond <= places) & (places <= high + beyond)).all(axis=1) & (radii > LARGE)
        return centres[near | far], radii[near | far]
    return centres, radii


def surroundings(run: RoverRun) -> tuple[Array, Array]:
    """Least and largest x and z of the ground around path and goal, m."""
    places = trunk_path(run)[:, [0, 2]]
    if run.goal is not None:
        places = np.vstack((places, run.goal))
    return places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN


def surfaces(run: RoverRun) -> list[tuple[Array, list[tuple[Colour, Triangles]]]]:
    """Height fields around the path, in squares of two colours, and meshes: vertices (n, 3), m, triangles by colour."""
    low, high = surroundings(run)
    pieces: list[tuple[Array, list[tuple[Colour, Triangles]]]] = []
    for surface in surfaces_of(run.terrain):
        vertices, faces = triangles_of(surface, low, high, MOST_HEIGHTS)
        triangles = faces.astype(np.int32)
        if isinstance(surface, TriangleMesh):
            pieces.append((vertices, [(ROCK_COLOUR, triangles)]))
            continue
        middles = vertices[triangles][:, :, [0, 2]].mean(axis=1)
        dark = np.floor(middles / SQUARE).sum(axis=1) % 2.0 == 1.0
        light, other = ground_colours(run)
        pieces.append((vertices, [(light, triangles[~dark]), (other, triangles[dark])]))
    return pieces


def ground_colours(run: RoverRun) -> tuple[Colour, Colour]:
    """Colours of the two kinds of squares of the ground."""
    return SAND_GROUND if run.on_sand else (GROUND_COLOUR, GROUND_COLOUR_2)


def ground_tiles(run: RoverRun) -> tuple[Array, Triangles, Triangles] | None:
    """Squares of the plane around path and goal: vertices (n, 3), m, and the triangles of both colours.

    Each square has separate vertices and two triangles, counter-clockwise seen from above. None without a plane.
    """
    plane = ground_plane(run)
    if plane is None:
        return None
    n = plane.normal
    along = np.eye(3)[0] if abs(n[0]) < 0.9 else np.eye(3)[1]
    t = along - (along @ n) * n
    t /= np.linalg.norm(t)
    tangents = np.stack((t, np.cross(n, t)))
    places = trunk_path(run)
    if run.goal is not None:
        x, z = run.goal
        places = np.vstack((places, (x, plane.height(x, z), z)))
    places = places @ tangents.T
    near, far = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    tile = TILE
    while np.prod((far - near) / tile) > MOST_TILES:
        tile *= 2.0
    low, high = np.floor(near / tile).astype(int), np.ceil(far / tile).astype(int)
    i, k = (grid.ravel() for grid in np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1])))
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    squares = np.stack((i, k), axis=1)[:, None] + corners
    vertices = (tile * squares @ tangents).reshape(-1, 3) - plane.offset * n
    triangles = (4 * np.arange(len(i))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).astype(np.int32)
    dark = (i + k) % 2 == 1
    return vertices, triangles[~dark].reshape(-1, 3), triangles[dark].reshape(-1, 3)


def goal_parts(run: RoverRun) -> tuple[Part, ...]:
    """A pole with a knob at the goal, in the world frame; empty without a goal."""
    if run.goal is None:
        return ()
    x, z = run.goal
    y = float(np.nan_to_num(heights_of(run.terrain, [run.goal])[0]))
    upright = np.eye(3)
    pole = Part("", "cylinder", (0.02, GOAL_POLE), (x, y + GOAL_POLE / 2, z), upright, GOAL_COLOUR)
    knob = Part("", "cylinder", (0.09, 0.18), (x, y + GOAL_POLE, z), upright, GOAL_COLOUR)
    return pole, knob


def goal_meshes(run: RoverRun) -> list[tuple[Colour, Array, Triangles]]:
    """A pole with a pennant at the goal, and on the ground the ring within which it counts as reached."""
    if run.goal is None:
        return []
    x, z = run.goal
    y = float(np.nan_to_num(heights_of(run.terrain, [run.goal])[0]))
    foot = np.array([x, y, z])
    pole = Part("", "cylinder", (0.022, FLAG_POLE), (x, y + FLAG_POLE / 2, z), np.eye(3), COLUMN_COLOUR)
    vertices, triangles = part_mesh(pole)
    cloth, faces = pennant()
    meshes = [(COLUMN_COLOUR, vertices + np.array(pole.position), triangles), (GOAL_COLOUR, foot + cloth, faces)]
    if run.goal_tolerance is not None:
        meshes.append((GOAL_COLOUR, *_ring(run, run.goal, run.goal_tolerance)))
    return meshes


def _ring(run: RoverRun, centre: tuple[float, float], radius: float) -> tuple[Array, Triangles]:
    """A flat ring on the ground, as wide as a tenth of its radius."""
    turn = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
    around = np.column_stack((np.cos(turn), np.sin(turn)))
    places = np.array(centre) + np.vstack((radius * around, 0.9 * radius * around))
    heights = np.nan_to_num(heights_of(run.terrain, places.tolist())) + RING_LIFT
    k, after = np.arange(RING), (np.arange(RING) + 1) % RING
    quads = np.vstack((np.column_stack((k, k + RING, after)), np.column_stack((after, k + RING, after + RING))))
    return np.column_stack((places[:, 0], heights, places[:, 1])), quads.astype(np.int32)


def coloured_meshes(parts: tuple[Part, ...]) -> Iterator[tuple[Colour, Array, Triangles]]:
    """The parts' surfaces in their solid's frame, one mesh per colour."""
    for colour in dict.fromkeys(part.colour for part in parts):
        vertices, triangles, n = [], [], 0
        for part in parts:
            if part.colour == colour:
                points, corners = part_mesh(part)
                vertices.append(points @ part.rotation.T + np.array(part.position))
                triangles.append(corners + n)
                n += len(points)
        yield colour, np.vstack(vertices), np.vstack(triangles).astype(np.int32)


def parts_by_solid(run: RoverRun) -> dict[str, tuple[Part, ...]]:
    """The rover's parts by solid; every solid has an entry."""
    parts = rover_parts(run.model)
    return {name: tuple(part for part in parts if part.solid == name) for name in run.model.solid_names}


def first_view(run: RoverRun) -> View:
    """From beside and a little behind the rover at its start, so that it drives away from the eye."""
    path, distance = trunk_path(run), NEARNESS * run.model.clear_radius
    way = (path[-1] - path[0])[[0, 2]]
    if np.linalg.norm(way) < 0.1:  # it stands still: look at its nose
        heading = run.trajectory["q"][0, 4]
        way = -np.array([np.cos(heading), -np.sin(heading)])
    ahead = way / np.linalg.norm(way)
    beside = np.array([-ahead[1], ahead[0]])
    back = -0.62 * ahead + 0.62 * beside
    eye = path[0] + distance * np.array([back[0], 0.48, back[1]])
    return View(eye, path[0])


SAME = 1e-6  # m, distance within which a wall is the plane of the ground, which is drawn already


def planes_of_run(run: GrainRun) -> Array:
    """(n, n_planes, 6) the walls, and the plane of the ground where no rover has it drawn."""
    plane = None if run.terrain is None or run.rover is not None else plane_of(run.terrain)
    if plane is None:
        return run.walls
    ground = np.concatenate((-plane.offset * plane.normal, plane.normal))
    return np.concatenate((run.walls, np.tile(ground, (run.n_frames, 1, 1))), axis=1)


def wall_polygons(run: GrainRun, floor: Colour, upright: Colour) -> list[tuple[Colour, Array, npt.NDArray[np.int32]]]:
    """A mesh for each wall, in a frame that `wall_poses` moves; it shows from the wall's free side only.

    Args:
        run: The run.
        floor: Colour of level walls.
        upright: Colour of the others.
    """
    first = run.positions[0].astype(np.float64)
    margin = run.radius[:, None]
    low, high = (first - margin).min(axis=0), (first + margin).max(axis=0)
    slack = 0.02 * float((high - low).max())
    meshes = []
    for wall in planes_of_run(run)[0]:
        point, normal = wall[:3], wall[3:] / np.linalg.norm(wall[3:])
        corners = np.empty((0, 3)) if _is_ground(run, point, normal) else _cut(point, normal, low - slack, high + slack)
        fan = [[0, k, k + 1] for k in range(1, len(corners) - 1)]
        colour = floor if abs(normal[1]) > 0.7 else upright
        meshes.append((colour, corners - point, np.array(fan, dtype=np.int32).reshape(-1, 3)))
    return meshes


def wall_poses(run: GrainRun) -> Array:
    """(n, n_walls, 7) places of the walls' points, m, and turns from their first normals as quaternions x, y, z, w."""
    walls = planes_of_run(run)
    poses = np.zeros((run.n_frames, walls.shape[1], 7))
    for i in range(walls.shape[1]):
        poses[:, i, :3] = walls[:, i, :3]
        normals = walls[:, i, 3:] / np.linalg.norm(walls[:, i, 3:], axis=1, keepdims=True)
        turns = np.array([_turn(normals[0], normal) for normal in normals])
        poses[:, i, 3:] = quaternions(turns)[:, [1, 2, 3, 0]]
    return poses


def _is_ground(run: GrainRun, point: Array, normal: Array) -> bool:
    """Whether the ground's plane lies in the wall."""
    plane = None if run.terrain is None or run.rover is None else plane_of(run.terrain)
    if plane is None:
        return False
    return bool(abs(plane.normal @ point + plane.offset) < SAME and plane.normal @ normal > 1.0 - SAME)


def _turn(start: Array, end: Array) -> Array:
    """The smallest rotation (3, 3) from one unit vector to another."""
    axis, cosine = np.cross(start, end), float(start @ end)
    if cosine < -1.0 + 1e-12:
        side = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
        side /= np.linalg.norm(side)
        return 2.0 * np.outer(side, side) - np.eye(3)
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    turned: Array = np.eye(3) + K + K @ K / (1.0 + cosine)
    return turned


def _cut(point: Array, normal: Array, low: Array, high: Array) -> Array:
    """(n, 3) corners of the polygon in which a plane cuts a box, counter-clockwise seen from the normal's side."""
    # A plane beside the box is moved to its nearest side, so that a wall that balls have not reached still shows.
    reach = normal @ np.where(normal > 0.0, high, low), normal @ np.where(normal > 0.0, low, high)
    shift = min(max(float(normal @ point), float(reach[1])), float(reach[0]))
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=np.float64)
    corners = low + corner * (high - low)
    far = corners @ normal - shift
    found = [corners[i] for i in range(8) if abs(far[i]) <= 1e-9]
    edges = [(i, k) for i in range(8) for k in range(i) if np.abs(corner[i] - corner[k]).sum() == 1.0]
    found += [
        corners[i] + far[i] / (far[i] - far[k]) * (corners[k] - corners[i])
        for i, k in edges
        if far[i] * far[k] < 0.0 and min(abs(far[i]), abs(far[k])) > 1e-9
    ]
    if len(found) < 3:
        return np.empty((0, 3))
    points = np.array(found)
    along = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    middle = points - points.mean(axis=0)
    around = np.arctan2(middle @ np.cross(normal, along), middle @ along)
    return points[np.argsort(around)] + (float(normal @ point) - shift) * normal


Mesh = tuple["Colour", Array, npt.NDArray[np.int32]]

AROUND = 64  # facets; every fourth of a drum is dark, so that its turning shows


def vessel_meshes(run: GrainRun, light: Colour, dark: Colour) -> list[Mesh]:
    """The meshes of the vessel, in the frame that `vessel_poses` turns; none without one."""
    vessel = run.vessel
    if vessel is None:
        return []
    if vessel["kind"] == "drum":
        half = 0.5 * vessel["length"]
        ends = [(dark, *_vessel_ring(0.0, vessel["radius"], -sign * half, inward=sign)) for sign in (1.0, -1.0)]
        return [*_tube(vessel["radius"], -half, half, light, dark), *ends]
    # A silo's tube is a drum's, turned to stand upright; it is as high as the balls were.
    places = run.positions_of(run.rows[:1])[0][:, 1]
    top = float((places + run.radius).max())
    floor = float((places - run.radius).min()) if vessel["floor"] is None else vessel["floor"]
    meshes = _tube(vessel["radius"], -top, -floor, light, light)
    if vessel["floor"] is not None:
        meshes.append((dark, *_vessel_ring(vessel["hole"], vessel["radius"], -floor, inward=-1.0)))
    return [(colour, points @ UPRIGHT.T, corners) for colour, points, corners in meshes]


#: Turns z down.
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def vessel_poses(run: GrainRun) -> Array:
    """(n, 7) places of the vessel's frame, m, and its turns as quaternions x, y, z, w."""
    poses = np.zeros((run.n_frames, 7))
    poses[:, 6] = 1.0
    vessel = run.vessel
    if vessel is None:
        return poses
    if vessel["kind"] == "drum":
        angle = vessel["rate"] * run.time
        poses[:, :3] = vessel["centre"]
        poses[:, 5], poses[:, 6] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    else:
        poses[:, 0], poses[:, 2] = vessel["axis"]
    return poses


def _tube(radius: float, begin: float, end: float, light: Colour, dark: Colour) -> list[Mesh]:
    """The inside of a tube along z."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    rim = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    vertices = np.concatenate([np.column_stack((rim, np.full(AROUND, z))) for z in (begin, end)])
    k, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    facets = np.stack((np.stack((k, k + AROUND, after), 1), np.stack((after, k + AROUND, after + AROUND), 1)), axis=1)
    is_dark = k % 4 == 0
    return [
        (colour, vertices, facets[chosen].reshape(-1, 3).astype(np.int32))
        for colour, chosen in ((light, ~is_dark), (dark, is_dark))
    ]


def _vessel_ring(inner: float, outer: float, z: float, *, inward: float) -> tuple[Array, npt.NDArray[np.int32]]:
    """A ring across z that faces along +z or -z: `inward` is 1 or -1."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    around = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    vertices = np.concatenate([np.column_stack((r * around, np.full(AROUND, z))) for r in (inner, outer)])
    k, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    faces = np.concatenate((np.stack((k, k + AROUND, after), 1), np.stack((after, k + AROUND, after + AROUND), 1)))
    return vertices, (faces if inward > 0.0 else faces[:, ::-1]).astype(np.int32)
