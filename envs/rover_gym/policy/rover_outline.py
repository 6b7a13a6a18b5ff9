"""What of a rover passes over the ground: its wheels, and the underside of what collides."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.start import wheel_centres
from rover_gym.mechanics import Plane, RoverModel, sin_cos

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RoverOutline:
    """A rover from above, in the trunk's frame with its joints at zero.

    Attributes:
        wheels: `(n_wheels, 2)` x and z of the wheels' centres, m.
        underside: `(n, 2)` x and z of the cells over which a box or a sphere of the rover reaches, m. What carries a
            wheel rises with it over a rock, and does not count within the wheel's radius.
        clearance: `(n,)` height of its lowest point in each cell over the ground that the wheels stand on, m.
    """

    wheels: Array
    underside: Array
    clearance: Array

    @classmethod
    def of(cls, model: RoverModel, cell: float) -> "RoverOutline":
        """That of a model, in square cells of a width, m."""
        zero, wheels, radii = np.zeros(model.nq), wheel_centres(model), model.wheel_radii
        ground = float(np.mean(np.asarray(model.wheel_contact_points(zero, Plane(), coordinates="state"))[:, 1]))
        poses = model.poses(zero)
        lowest: dict[tuple[int, int], float] = {}
        for solid in model.to_dict()["solids"]:
            origin, rotation = poses[solid["name"]]
            for points in _colliding(solid, 0.5 * cell):
                placed = points @ np.asarray(rotation).T + np.asarray(origin)
                if "parent" in solid:
                    apart = np.linalg.norm(placed[:, None, [0, 2]] - wheels, axis=2)
                    placed = placed[(apart > radii).all(axis=1)]
                cells = np.rint(placed[:, [0, 2]] / cell).astype(int).tolist()
                for (i, k), y in zip(cells, placed[:, 1].tolist(), strict=True):
                    lowest[i, k] = min(y, lowest.get((i, k), math.inf))
        places = sorted(lowest)
        return cls(
            wheels=wheels,
            underside=cell * np.array(places, dtype=np.float64).reshape(-1, 2),
            clearance=np.array([lowest[place] for place in places]) - ground,
        )


def _colliding(solid: Mapping[str, Any], spacing: float) -> Iterator[Array]:
    """Points `(m, 3)` on each box and sphere of a solid that collides, in the solid's frame, m."""
    alone = {"shape", "collides"} <= solid.keys()
    shapes = [solid["shape"] | {"collides": solid["collides"]}] if alone else solid.get("shapes", ())
    for shape in shapes:
        if not shape.get("collides"):
            continue
        centre = np.array(solid.get("centre_of_mass", (0.0,) * 3) if alone else shape.get("position", (0.0,) * 3))
        turn = np.eye(3) if alone else _rotation(shape.get("rotation", (0.0,) * 3))
        if shape["kind"] == "box":
            yield _box(shape["size"], spacing) @ turn.T + centre
        elif shape["kind"] == "sphere":
            yield _sphere(shape["radius"], spacing) + centre


def _box(size: Any, spacing: float) -> Array:
    """Points on the surface of a box."""
    axes = [np.linspace(-0.5 * side, 0.5 * side, max(2, math.ceil(side / spacing) + 1)) for side in size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on_a_face = np.isclose(np.abs(grid), 0.5 * np.array(size)).any(axis=1)
    surface: Array = grid[on_a_face]
    return surface


def _sphere(radius: float, spacing: float) -> Array:
    """Points on a sphere: those of the cube around it, drawn in."""
    cube = _box((2.0 * radius,) * 3, spacing)
    drawn_in: Array = radius * cube / np.linalg.norm(cube, axis=1, keepdims=True)
    return drawn_in


def _rotation(vector: Any) -> Array:
    """The rotation matrix of a rotation vector, axis times angle (Rodrigues)."""
    given = np.array(vector, dtype=np.float64)
    angle = float(np.linalg.norm(given))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = given / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = sin_cos(angle)
    turn: Array = np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross
    return turn
