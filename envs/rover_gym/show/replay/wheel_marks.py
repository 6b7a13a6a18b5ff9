"""What the wheels of a run do to the ground: where they touch it, with which force, and what marks they leave."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.ground.terrain_parts import heights_of, plane_of, sand_of, spheres_of, surface_heights

if TYPE_CHECKING:
    from rover_gym.core import RoverModel, Terrain
    from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]

REACH = 0.02  # m, over which the ground's slope is measured
TOUCHING = 0.005  # m, gap up to which a wheel leaves a mark
CHUNK = 2_000_000  # distances from wheels to rocks at a time
TEXELS = 1024  # along an edge of the map of ruts, at most
DEEPER = 0.001  # m by which a cell must be pressed down to be drawn anew
RUT_CELL = 0.02  # m, of sand whose recording does not say it
EDGE = 0.5  # m around the wheels' ways


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
    """The lowest point of each wheel towards the ground in each sample, m, the normal there, and the axle.

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


def world_forces(forces: Array, normals: Array, across: Array) -> Array:
    """(n, n_wheels, 3) forces of the ground on the wheels in the world frame, N, from `forces` along n, t and b."""
    rolling = np.cross(normals, across)
    rolling /= np.maximum(np.linalg.norm(rolling, axis=-1, keepdims=True), 1e-9)
    axes = np.stack((normals, rolling, np.cross(rolling, normals)), axis=-2)
    result: Array = np.einsum("nwk,nwki->nwi", forces, axes)
    return result


class RutMap:
    """A map of ruts: which of its cells have which depth. Depths are levels, 255 of which are `deepest`.

    Args:
        low: Least x and z, m.
        high: Largest x and z, m.
        cell: Size of the sand's own cells, m: the map's are larger if there would be too many.
        deepest: Largest depth, m.
    """

    def __init__(self, low: Array, high: Array, cell: float, deepest: float) -> None:
        self.low, self.deepest = np.asarray(low, dtype=np.float64), deepest
        self.cell = max(cell, float(np.max(high - self.low)) / TEXELS)
        self.shape = tuple(int(n) for n in np.maximum(1, np.ceil((high - self.low) / self.cell)))
        self.levels = np.zeros(self.shape[0] * self.shape[1], dtype=np.uint8)

    def header(self) -> dict[str, object]:
        """How a page reads the map."""
        return {"low": self.low.tolist(), "size": list(self.shape), "cell": self.cell, "deepest": self.deepest}

    def press(self, places: Array, depths: Array) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8]]:
        """Presses places (n, 2), x and z, down to depths (n,), m; returns cells that became deeper, and levels."""
        steps = np.floor((places - self.low) / self.cell).astype(np.int64)
        inside = ((steps >= 0) & (steps < self.shape)).all(axis=1)
        cells = steps[inside, 1] * self.shape[0] + steps[inside, 0]
        levels = np.clip(np.round(255.0 * depths[inside] / self.deepest), 0.0, 255.0).astype(np.uint8)
        order = np.argsort(levels, kind="stable")  # of several in one cell, the deepest comes last and stays
        pressed = dict(zip(cells[order].tolist(), levels[order].tolist(), strict=True))
        found = np.array(list(pressed), dtype=np.int64)
        wanted = np.array(list(pressed.values()), dtype=np.int64)
        deeper = wanted >= self.levels[found].astype(np.int64) + max(1, round(255.0 * DEEPER / self.deepest))
        self.levels[found[deeper]] = wanted[deeper]
        return found[deeper], wanted[deeper].astype(np.uint8)


def rut_edits(
    run: RoverRun, wheels: list[DrawnWheel], points: Array, across: Array
) -> tuple[RutMap, npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.uint8]] | None:
    """The ruts of a run on sand over time; None on firm ground.

    A recording holds no ruts. They are what the wheels' rims have cut out of the surface.

    Returns:
        The map, and of each cell that becomes deeper the sample, the cell and the level, in order of the samples.
    """
    if not run.on_sand:
        return None
    sand = sand_of(run.terrain)
    size = RUT_CELL if sand is None else sand.rut_cell
    surface = surface_heights(run.terrain, points[..., [0, 2]].reshape(-1, 2)).reshape(points.shape[:2])
    sinkage = np.nan_to_num(surface - points[..., 1])
    reach = points[..., [0, 2]].reshape(-1, 2)
    deepest = max(0.02, float(sinkage.max()))
    rut_map = RutMap(reach.min(axis=0) - EDGE, reach.max(axis=0) + EDGE, size, deepest)
    samples, cells, levels = [], [], []
    for i, wheel in enumerate(wheels):
        n_across = max(2, int(np.ceil(1.5 * wheel.width / rut_map.cell)))
        n_along = max(3, int(np.ceil(2.0 * wheel.radius / rut_map.cell)))
        grid_u, grid_v = np.meshgrid(
            np.linspace(-0.5, 0.5, n_across) * wheel.width, np.linspace(-1.0, 1.0, n_along) * wheel.radius
        )
        u, v = grid_u.ravel(), grid_v.ravel()
        for k in np.flatnonzero(sinkage[:, i] > DEEPER):
            side = across[k, i, [0, 2]] / max(1e-9, float(np.linalg.norm(across[k, i, [0, 2]])))
            depth = sinkage[k, i] - wheel.radius + np.sqrt(np.maximum(0.0, wheel.radius**2 - v**2))
            cut = depth > DEEPER
            at = points[k, i, [0, 2]] + np.outer(u[cut], side) + np.outer(v[cut], [side[1], -side[0]])
            found, wanted = rut_map.press(at, depth[cut])
            samples.append(np.full(len(found), k))
            cells.append(found)
            levels.append(wanted)
    if not samples:
        return rut_map, np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.uint8)
    sample, cell, level = np.concatenate(samples), np.concatenate(cells), np.concatenate(levels)
    order = np.lexsort((level, sample))
    return rut_map, sample[order], cell[order], level[order]
