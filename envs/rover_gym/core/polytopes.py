"""Convex hulls of a few points, as drawn and written to files, and boxes around shapes. The core has its own."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Distance from a face's plane, in lengths of the hull, within which points lie in it.
FLAT = 1e-6


def hull_faces(points: npt.ArrayLike) -> list[list[int]]:
    """The faces of the convex hull of points (n, 3): the corners of each, counter-clockwise seen from outside."""
    x = np.asarray(points, dtype=np.float64)
    x = x - x.mean(axis=0)
    size = float(np.linalg.norm(x, axis=1).max())
    i, j, k = np.array(list(itertools.combinations(range(len(x)), 3))).T
    normals = np.cross(x[j] - x[i], x[k] - x[i])
    areas = np.linalg.norm(normals, axis=1)
    order = np.argsort(-areas, kind="stable")
    order = order[areas[order] > 1e-9 * size**2]
    normals = normals[order] / areas[order, None]
    heights = normals @ x.T - np.einsum("ij,ij->i", normals, x[i[order]])[:, None]
    normals[heights.max(axis=1) > FLAT * size] *= -1.0
    is_side = (heights.max(axis=1) <= FLAT * size) | (heights.min(axis=1) >= -FLAT * size)
    faces: list[list[int]] = []
    known: list[set[int]] = []
    for row in np.flatnonzero(is_side):
        members = set(np.flatnonzero(np.abs(heights[row]) <= FLAT * size).tolist())
        triple = {int(i[order[row]]), int(j[order[row]]), int(k[order[row]])}
        if not any(triple <= other for other in known):
            known.append(members)
            faces.append(_outline(x, sorted(members), normals[row], FLAT * size))
    return faces


def _outline(x: Array, members: list[int], n: Array, flat: float) -> list[int]:
    """The convex outline of points in a plane with the unit normal n (Andrew 1979)."""
    along = np.eye(3)[int(np.argmin(np.abs(n)))]
    along = along - n * float(n @ along)
    along /= np.linalg.norm(along)
    places = {m: (float(x[m] @ along), float(x[m] @ np.cross(n, along))) for m in members}

    def chain(order: list[int]) -> list[int]:
        kept: list[int] = []
        for m in order:
            while len(kept) > 1:
                (ax, ay), (bx, by), (cx, cy) = places[kept[-2]], places[kept[-1]], places[m]
                if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > flat * float(np.hypot(cx - ax, cy - ay)):
                    break
                kept.pop()
            kept.append(m)
        return kept[:-1]

    order = sorted(members, key=lambda m: places[m])
    return chain(order) + chain(order[::-1])


def hull_mesh(points: npt.ArrayLike) -> tuple[Array, npt.NDArray[np.int32]]:
    """The convex hull as triangles, with separate vertices on each face, so that edges stay sharp.

    Returns:
        Vertices (m, 3) and triangles (k, 3), counter-clockwise seen from outside.
    """
    x = np.asarray(points, dtype=np.float64)
    corners: list[int] = []
    triangles: list[tuple[int, int, int]] = []
    for face in hull_faces(x):
        first = len(corners)
        corners += face
        triangles += [(first, first + k, first + k + 1) for k in range(1, len(face) - 1)]
    return x[corners], np.array(triangles, dtype=np.int32).reshape(-1, 3)


def hull_properties(points: npt.ArrayLike) -> tuple[float, Array, Array]:
    """Volume, m³, centroid (3,), m, and inertia about it of a body of unit mass (3, 3), m²."""
    vertices, triangles = hull_mesh(points)
    origin = vertices.mean(axis=0)
    a, b, c = ((vertices - origin)[triangles[:, k]] for k in range(3))
    own = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(own.sum())
    total = a + b + c
    centroid = (own @ total) / (4.0 * volume)
    second = sum(np.einsum("i,ij,ik->jk", own, side, side) for side in (a, b, c, total)) / (20.0 * volume)
    second = second - np.outer(centroid, centroid)
    return volume, origin + centroid, np.trace(second) * np.eye(3) - second


def reach(shape: Mapping[str, Any], direction: npt.ArrayLike) -> float:
    """How far a shape of a model extends along a unit vector (3,) of its own axes, from its own origin, m."""
    n = np.asarray(direction, dtype=np.float64)
    match shape["kind"]:
        case "box":
            return float(0.5 * np.array(shape["size"]) @ np.abs(n))
        case "ellipsoid":
            return float(np.linalg.norm(np.array(shape["radii"]) * n))
        case "hull":
            return float((np.array(shape["points"]) @ n).max())
        case "cylinder":
            return float(0.5 * shape["height"] * abs(n[1]) + shape["radius"] * np.hypot(n[0], n[2]))
        case "capsule":
            return float(0.5 * shape["height"] * abs(n[1]) + shape["radius"])
        case "sphere":
            return float(shape["radius"])
        case kind:
            raise ValueError(f"no shape that collides is a {kind}")


def box_around(shape: Mapping[str, Any]) -> tuple[Array, Array]:
    """Middle and half edge lengths (3,), m, of the box with its axes around a shape of a model that can collide."""
    above, below = (np.array([reach(shape, sign * axis) for axis in np.eye(3)]) for sign in (1.0, -1.0))
    return 0.5 * (above - below), 0.5 * (above + below)
