"""Triangle meshes from files, by trimesh."""

import json
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.extras import require
from rover_gym.maps.ground_file import GroundFile
from rover_gym.mechanics import TerrainError
from rover_gym.validation import number, refuse

#: Longest file, bytes: reading text takes some ten times as many.
MOST_BYTES = 2**28

#: Largest coordinate of a terrain, m.
FARTHEST = 1e6

#: Endings of the formats that hold a mesh and nothing that would be run or fetched.
ENDINGS = (".obj", ".ply", ".stl", ".off", ".glb")


def read_mesh(
    path: object, *, scale: object = 1.0, position: object = (0.0, 0.0, 0.0), up: object = "y"
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Reads a mesh; the arguments are those of `TriangleMesh.from_file`.

    Returns:
        Vertices `(n, 3)`, m, and triangles `(m, 3)`.

    Raises:
        TerrainError: The file holds no such mesh.
        OSError: The file cannot be read.
        MissingExtraError: The extra `maps` is not installed.
    """
    factor = number("scale", scale, above=0.0, error=TerrainError)
    if up not in ("y", "z"):
        refuse(TerrainError, "up", up, 'must be "y" or "z"')
    places = list(position) if isinstance(position, Iterable) else []
    shift = np.array([number(f"position[{k}]", x, error=TerrainError) for k, x in enumerate(places)])
    if shift.shape != (3,):
        refuse(TerrainError, "position", position, "must be three numbers")
    file = GroundFile.at(path)
    if file.ending not in ENDINGS:
        file.refuse(f"a mesh's file ends in {', '.join(ENDINGS)}")
    if file.size > MOST_BYTES:
        file.refuse(f"at most {MOST_BYTES} bytes are read", file.size)
    trimesh = require("trimesh", "maps")
    try:
        if file.ending == ".glb":
            _check_counts(file)
        with np.errstate(all="ignore"):
            mesh: Any = trimesh.load_mesh(str(file.path), process=False, skip_materials=True)
            vertices, triangles = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    except Exception as error:
        file.refuse(f"is damaged or holds no mesh ({type(error).__name__}: {error})")
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,):
        file.refuse("holds no triangles")
    bad = ~np.isfinite(vertices).all(axis=1)
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        file.refuse(f"vertex {k} is not finite", vertices[k].tolist())
    if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        file.refuse("a triangle names a vertex that is not there")
    placed = _turned(vertices, str(up)) * factor + shift
    far = (np.abs(placed) > FARTHEST).any(axis=1)
    if far.any():
        k = int(np.flatnonzero(far)[0])
        file.refuse(f"vertex {k} must be within {FARTHEST:g} m", placed[k].tolist())
    return _joined(file, placed, triangles)


def _check_counts(file: GroundFile) -> None:
    """Refuses a GLB that states more entries than it has bytes: those without data would be made, as zeros.

    Raises:
        ValueError: It does, or it is no GLB.
    """
    with file.path.open("rb") as opened:
        _, _, _, length, _ = struct.unpack("<5I", opened.read(20))
        described = json.loads(opened.read(min(length, file.size)))
    stated = sum(accessor["count"] for accessor in described.get("accessors", ()))
    if stated > file.size:
        raise ValueError(f"its accessors state {stated} entries, more than the file's {file.size} bytes")


def _turned(vertices: npt.NDArray[np.float64], up: str) -> npt.NDArray[np.float64]:
    """Vertices with y up: of z up, x stays and y becomes -z."""
    return vertices if up == "y" else np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], axis=1)


def _joined(
    file: GroundFile, vertices: npt.NDArray[np.float64], triangles: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """The mesh with equal vertices joined, and without triangles that have no area."""
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    triangles = same.reshape(-1)[triangles]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((b - a) ** 2).sum(1), ((c - a) ** 2).sum(1), ((c - b) ** 2).sum(1)], axis=0)
    triangles = triangles[area > 1e-8 * longest]
    if not len(triangles):
        file.refuse("holds no triangle that has an area")
    return vertices, triangles
