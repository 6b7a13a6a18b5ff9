"""Walls of a run of balls as polygons: each plane where it cuts the box about the balls."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.ground import plane_of
from rover_gym.replay.rotation import quaternions

if TYPE_CHECKING:
    from rover_gym.grains.grain_run import GrainRun
    from rover_gym.rendering.appearance import Colour

Array = npt.NDArray[np.float64]

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
        half: Array = 2.0 * np.outer(side, side) - np.eye(3)
        return half
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
