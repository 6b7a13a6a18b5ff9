"""What the wheels of a run do to the ground: where they touch it, with which force, and what marks they leave."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.ground import heights_of, plane_of, spheres_of

if TYPE_CHECKING:
    from rover_gym.mechanics import RoverModel, Terrain
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]

REACH = 0.02  # m, over which the ground's slope is measured
TOUCHING = 0.005  # m, gap up to which a wheel leaves a mark
CHUNK = 2_000_000  # distances from wheels to rocks at a time


class DrawnWheel(NamedTuple):
    """A wheel: its solid's number, its radius and its width as drawn, m."""

    frame: int
    radius: float
    width: float


def drawn_wheels(model: RoverModel) -> list[DrawnWheel]:
    """The wheels of a rover, in the order of their names."""
    wheels = model.to_dict()["wheels"]
    result = []
    for wheel in wheels:
        radius = float(wheel.get("contact_radius", wheel["radius"]))
        result.append(
            DrawnWheel(model.solid_names.index(wheel["solid"]), radius, float(wheel.get("width") or 0.7 * radius))
        )
    return result


def ground_normals(terrain: Terrain, places: Array) -> Array:
    """(n, 3) unit normals of the ground at places (n, 3): of its slope, or of the nearest rock if that is closer."""
    flat = places[:, [0, 2]]
    plane = plane_of(terrain)
    if plane is not None:
        normals = np.tile(plane.normal, (len(places), 1))
        away = places @ plane.normal + plane.offset
    else:
        around = [flat + REACH * np.array(shift) for shift in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        east, west, south, north = (np.nan_to_num(heights_of(terrain, points)) for points in around)
        slope = np.column_stack((west - east, np.full(len(flat), 2.0 * REACH), north - south))
        normals = slope / np.linalg.norm(slope, axis=1, keepdims=True)
        away = (places[:, 1] - np.nan_to_num(heights_of(terrain, flat))) * normals[:, 1]
    centres, radii = spheres_of(terrain)
    if len(radii):
        rows = max(1, CHUNK // len(radii))
        for first in range(0, len(places), rows):
            chosen = slice(first, first + rows)
            from_rocks = places[chosen, None] - centres
            distance = np.linalg.norm(from_rocks, axis=2)
            nearest = np.argmin(distance - radii, axis=1)
            k = np.arange(len(nearest))
            closer = distance[k, nearest] - radii[nearest] < away[chosen]
            directions = from_rocks[k, nearest] / np.maximum(distance[k, nearest], 1e-9)[:, None]
            normals[chosen] = np.where(closer[:, None], directions, normals[chosen])
    return normals


def feet(run: RoverRun, wheels: list[DrawnWheel]) -> tuple[Array, Array, Array]:
    """Of each sample and wheel: the lowest point towards the ground, m, the normal there, and the axle.

    All are (n, n_wheels, 3); the axle points to the rover's right.
    """
    frames = [wheel.frame for wheel in wheels]
    centres, rotations = run.positions[:, frames], run.rotations[:, frames]
    axles = np.array([wheel["axle"] for wheel in run.model.to_dict()["wheels"]], dtype=np.float64)
    axles /= np.linalg.norm(axles, axis=1, keepdims=True)
    across = np.einsum("nwij,wj->nwi", rotations, axles)
    right = run.rotations[:, 0, :, 2]
    across *= np.where(np.einsum("nwi,ni->nw", across, right) < 0.0, -1.0, 1.0)[..., None]
    normals = ground_normals(run.terrain, centres.reshape(-1, 3)).reshape(centres.shape)
    down = normals - np.sum(normals * across, axis=-1, keepdims=True) * across
    down /= np.maximum(np.linalg.norm(down, axis=-1, keepdims=True), 1e-9)
    radii = np.array([wheel.radius for wheel in wheels])
    return centres - radii[:, None] * down, normals, across


def marks(run: RoverRun, wheels: list[DrawnWheel], points: Array) -> npt.NDArray[np.float32]:
    """(n, n_wheels, 3) where the wheels have marked the ground, m; nan where a wheel was in the air."""
    result = points.astype(np.float32)
    radii = np.array([wheel.radius for wheel in wheels])
    surface = heights_of(run.terrain, points[..., [0, 2]].reshape(-1, 2)).reshape(points.shape[:2])
    if (gaps := run.trajectory.data.get("wheel_gaps")) is None:
        gaps = points[..., 1] - surface
    result[..., 1] = np.where(gaps < TOUCHING, np.fmax(result[..., 1], surface), np.nan) + 0.02 * radii
    return result


def world_forces(run: RoverRun, normals: Array, across: Array) -> Array:
    """(n, n_wheels, 3) forces of the ground on the wheels in the world frame, N, from those along n, t and b."""
    rolling = np.cross(normals, across)
    rolling /= np.maximum(np.linalg.norm(rolling, axis=-1, keepdims=True), 1e-9)
    axes = np.stack((normals, rolling, np.cross(rolling, normals)), axis=-2)
    result: Array = np.einsum("nwk,nwki->nwi", run.trajectory["wheel_forces"], axes)
    return result
