"""Meshes that a robot file only draws, as drawings of a description."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.models.import_report import Array
from rover_gym.models.meshes import Mesh
from rover_gym.models.robot_tree import FileLink, RobotTree, mesh_of

#: Most triangles of one drawing, and of a robot. A page with 12 000 of them is half a megabyte larger.
MOST_OF_ONE, MOST_OF_ALL = 1500, 12_000

#: Decimals of a drawn vertex, m: a hundredth of a millimetre.
DECIMALS = 5

#: Cells along the longest side of a mesh with which a simplification begins, and by which it goes on.
FIRST_CELLS, COARSER = 96, 0.8


class Drawer:
    """Draws the meshes of a robot, simplified so that all of them together stay small.

    Args:
        tree: The robot.
    """

    def __init__(self, tree: RobotTree) -> None:
        self.tree = tree
        drawn = sum(shape.visible and shape.mesh is not None for link in tree.links.values() for shape in link.shapes)
        self.most = max(12, min(MOST_OF_ONE, MOST_OF_ALL // max(drawn, 1)))

    def drawings(self, link: FileLink, A: Array, anchor: Array, *, is_drawn: bool) -> list[dict[str, Any]]:
        """The drawings of a link, as a description lists them.

        Args:
            link: The link.
            A: Rotation from its frame to that of its solid, (3, 3).
            anchor: Origin of the solid in the link's frame, (3,), m.
            is_drawn: Whether something else is drawn in its place, as for a wheel of another radius.
        """
        found = []
        for shape in link.shapes if is_drawn else ():
            if shape.mesh is None or not shape.visible:
                continue
            mesh, reason = mesh_of(shape)
            if mesh is None or not len(mesh.faces):
                self.tree.left_out.append(f"link[{link.name}]: what is drawn {reason or 'is a mesh without triangles'}")
                continue
            small = simplified(mesh, self.most)
            points = np.round((small.vertices @ shape.rotation.T + shape.position - anchor) @ A.T, DECIMALS) + 0.0
            drawing: dict[str, Any] = {"vertices": points.tolist(), "faces": small.faces.tolist()}
            colour = shape.colour or mesh.colour
            found.append(drawing | ({} if colour is None else {"colour": list(colour)}))
        return found


def simplified(mesh: Mesh, most: int) -> Mesh:
    """A mesh of at most so many triangles, whose vertices are the means of those in cells of a grid."""
    low = mesh.vertices.min(axis=0)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    cells = FIRST_CELLS
    while len(mesh.faces) > most and cells >= 1:
        made = _clustered(mesh, np.floor((mesh.vertices - low) / size * cells).astype(np.int64))
        if len(made.faces) <= most:
            return made
        cells = int(COARSER * cells)
    return mesh


def _clustered(mesh: Mesh, cells: npt.NDArray[np.int64]) -> Mesh:
    """The mesh with one vertex in each cell; triangles that collapse or repeat are gone."""
    _, numbers = np.unique(cells, axis=0, return_inverse=True)
    numbers = numbers.ravel()
    count = np.bincount(numbers)
    vertices = np.stack([np.bincount(numbers, mesh.vertices[:, k]) / count for k in range(3)], axis=1)
    faces = numbers[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first)]
    used, places = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], places.reshape(-1, 3))
