"""Collision meshes as convex hulls.

A mesh collides as its convex hull, or, if it is concave and closed, as several hulls that V-HACD divides it into. The
report of an import states by how much their volume differs from that of the mesh.

A hull has at most as many vertices as the user allows. They are chosen one by one: each is the one that lies furthest
outside the hull of those before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.extras import MissingExtraError, require
from rover_gym.models.import_report import Array

#: Most vertices of a hull, as in the core.
MOST_VERTICES = 64

#: Most parts of a mesh that a user may ask for.
MOST_PARTS = 256

#: Volume of its convex hull over that of a mesh from which on the mesh is divided.
CONCAVE = 1.05

#: Voxels of V-HACD. Five times as many take four times as long, and move the volume of an L and a U by at most 0.7 %.
VOXELS = 20_000

#: Error in volume of a part, in percent, from which on V-HACD divides it. With 1 it divides a U into as many parts.
PART_ERROR = 3.0

#: Thickness of a hull, as a share of its size, below which it has no volume.
FLAT = 1e-5


@dataclass(frozen=True)
class MeshOptions:
    """How meshes collide.

    Attributes:
        parts: Most convex parts of a mesh; 1: its convex hull; 0: meshes do not collide.
        vertices: Most vertices of a part.
    """

    parts: int = 8
    vertices: int = 32


@dataclass(frozen=True)
class Mesh:
    """Vertices (n, 3), m, triangles (m, 3), and the colour in its file (red, green, blue, 0 to 1) or None."""

    vertices: Array
    faces: npt.NDArray[np.int64]
    colour: tuple[float, float, float] | None = None


def load_mesh(
    source: Path | Array, faces: npt.NDArray[np.int64] | None, scale: Array | None, searched: tuple[str, ...]
) -> tuple[Mesh | None, str]:
    """A mesh in the axes of its shape; or None and the reason.

    Args:
        source: Its file, or its vertices (n, 3), m.
        faces: Its triangles if the vertices are given.
        scale: Factors of its coordinates.
        searched: Folders in which there is no such file.
    """
    colour = None
    if isinstance(source, np.ndarray):
        points, corners = source, np.zeros((0, 3), dtype=np.int64) if faces is None else faces
    elif searched:
        return None, f"is the mesh {source}, which cannot be read: it is in none of {', '.join(searched)}"
    else:
        try:
            loader = require("trimesh", "models")
        except MissingExtraError as error:
            return None, f"is a mesh, and {error}"
        try:
            read = loader.load_mesh(source)
            points = np.asarray(read.vertices, dtype=np.float64)
            corners = np.asarray(read.faces, dtype=np.int64)
            colour = _colour(read)
        except Exception as error:  # whatever a parser of meshes makes of a damaged file
            return None, f"is the mesh {source}, which cannot be read ({type(error).__name__}: {error})"
    if len(points) < 3 or not np.all(np.isfinite(points)):
        return None, f"is the mesh {source}, which has no surface"
    return Mesh(points * (np.ones(3) if scale is None else scale), corners, colour), ""


def _colour(mesh: Any) -> tuple[float, float, float] | None:
    """The main colour of a mesh's file, or None if it states none."""
    try:
        visual = mesh.visual
        if not visual.defined:
            return None
        material = getattr(visual, "material", None)
        red, green, blue = (int(x) for x in (material if material is not None else visual).main_color[:3])
    except Exception:
        return None
    return red / 255.0, green / 255.0, blue / 255.0


def hulls_of(mesh: Mesh, options: MeshOptions) -> tuple[list[Array], str]:
    """The vertices of each convex part of a mesh, m, and what becomes of the mesh in words; or nothing and the reason.

    Args:
        mesh: The mesh.
        options: How many parts and vertices.
    """
    try:
        spatial = require("scipy.spatial", "models")
        trimesh = require("trimesh", "models")
    except MissingExtraError as error:
        return [], f"a mesh, since {error}"
    whole = _hull(spatial, mesh.vertices, options.vertices)
    if whole is None:
        return [], "a mesh without volume"
    # Rounding in a file's numbers separates corners that are one.
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    solid.merge_vertices(merge_tex=True, merge_norm=True)
    if not (solid.is_watertight and solid.is_winding_consistent and abs(solid.volume) > 0.0):
        exact = float(spatial.ConvexHull(mesh.vertices).volume)
        return [whole], f"{_as_hull(whole)}, {_error(spatial, [whole], exact)} of the hull of all; it is not closed"
    volume = abs(float(solid.volume))
    notes = ""
    if options.parts > 1 and spatial.ConvexHull(mesh.vertices).volume > CONCAVE * volume:
        parts, notes = _divided(trimesh, solid, options)
        hulls = [hull for part in parts if (hull := _hull(spatial, part, options.vertices)) is not None]
        if len(hulls) > 1:
            return hulls, f"{len(hulls)} convex parts, {_error(spatial, hulls, volume)}"
    return [whole], f"{_as_hull(whole)}, {_error(spatial, [whole], volume)}{notes}"


def _as_hull(hull: Array) -> str:
    return f"its convex hull of {len(hull)} vertices"


def _error(spatial: Any, hulls: list[Array], volume: float) -> str:
    """By how much the volume of the hulls differs from that of a mesh."""
    sum_of_parts = sum(float(spatial.ConvexHull(hull).volume) for hull in hulls)
    error = round(100.0 * (sum_of_parts / volume - 1.0), 1) + 0.0  # no minus before a zero
    return f"volume {error:+.1f} %"


def _divided(trimesh: Any, solid: Any, options: MeshOptions) -> tuple[list[Array], str]:
    """The vertices of the convex parts of a closed mesh; or nothing and the reason."""
    try:
        require("vhacdx", "models")
    except MissingExtraError as error:
        return [], f"; it is not divided, since {error}"
    if solid.volume < 0.0:
        solid.invert()
    # V-HACD works in single precision: about the middle and of size 1.
    middle, size = solid.bounds.mean(axis=0), float(np.ptp(solid.bounds, axis=0).max())
    scaled = trimesh.Trimesh((solid.vertices - middle) / size, solid.faces, process=False)
    parts = trimesh.decomposition.convex_decomposition(
        scaled,
        maxConvexHulls=options.parts,
        maxNumVerticesPerCH=MOST_VERTICES,
        resolution=VOXELS,
        minimumVolumePercentErrorAllowed=PART_ERROR,
        asyncACD=False,
    )
    return [np.asarray(part["vertices"], dtype=np.float64) * size + middle for part in parts], ""


def _hull(spatial: Any, points: Array, most: int) -> Array | None:
    """At most so many vertices of the convex hull of points (n, 3); None if they lie in a plane."""
    points = np.unique(points, axis=0)
    middle = points.mean(axis=0)
    size = float(np.abs(points - middle).max(initial=0.0))
    if len(points) < 4 or size == 0.0 or np.linalg.svd(points - middle, compute_uv=False)[2] < FLAT * size:
        return None
    try:
        corners = points[np.sort(spatial.ConvexHull(points).vertices)]
    except spatial.QhullError:
        return None
    chosen = _first_four(corners)
    hull = spatial.ConvexHull(corners[chosen])
    while len(chosen) < min(most, len(corners)):
        # How far each corner lies outside the hull so far.
        outside = (corners @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        outside[chosen] = -np.inf
        if outside.max() < 1e-6 * size:
            break
        chosen.append(int(outside.argmax()))
        hull = spatial.ConvexHull(corners[chosen])
    return np.asarray(corners[np.sort(chosen)])


def _first_four(points: Array) -> list[int]:
    """Four points that span a volume: each the furthest from those before it."""
    first = int(np.argmax(points[:, 0]))
    away = points - points[first]
    second = int(np.argmax(np.linalg.norm(away, axis=1)))
    along = away[second] / np.linalg.norm(away[second])
    across = away - np.outer(away @ along, along)
    third = int(np.argmax(np.linalg.norm(across, axis=1)))
    fourth = int(np.argmax(np.abs(away @ np.cross(along, across[third]))))
    return [first, second, third, fourth]
