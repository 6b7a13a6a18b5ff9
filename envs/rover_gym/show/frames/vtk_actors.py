"""Surfaces and actors of VTK, which draws films."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor, vtkMapper, vtkPolyDataMapper

from rover_gym.show.frames.shading import dress

Array: TypeAlias = npt.NDArray[np.float64]

Faces: TypeAlias = npt.NDArray[np.integer[Any]]


def mesh(vertices: Array, faces: Faces, colours: Array, *, smooth: bool = True) -> vtkPolyData:
    """A surface.

    Args:
        vertices: (n, 3) points, m.
        faces: (m, 3) or (m, 4), indices of vertices, counter-clockwise from outside.
        colours: (n, 3) red, green, blue, 0 to 1.
        smooth: Adds vertex normals, so that shading is smooth across faces that share vertices.
    """
    data = vtkPolyData()
    set_points(data, vertices)
    n, size = faces.shape
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtkIdTypeArray(np.arange(0, n * size + 1, size, dtype=np.int64), deep=True),
        numpy_to_vtkIdTypeArray(faces.astype(np.int64).ravel(), deep=True),
    )
    data.SetPolys(cells)
    if smooth:
        a, b, c = (vertices[faces[:, corner]] for corner in range(3))
        normals = np.zeros_like(vertices)
        for corner in range(size):  # the cross product weights by area
            np.add.at(normals, faces[:, corner], np.cross(b - a, c - a))
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        data.GetPointData().SetNormals(numpy_to_vtk(normals, deep=True))
    set_colours(data, colours)
    return data


def lattice(rows: int, columns: int) -> Faces:
    """(rows * columns, 4) quadrilaterals between rows + 1 closed rings of `columns` vertices each, ring after ring."""
    row, column = (index.ravel() for index in np.meshgrid(np.arange(rows), np.arange(columns)))
    following = (column + 1) % columns
    near, far = row * columns, (row + 1) * columns
    return np.column_stack((near + column, near + following, far + following, far + column))


def set_points(data: vtkPolyData, vertices: Array) -> None:
    """Replaces the points by (n, 3), m."""
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices.reshape(-1, 3)), deep=True))
    data.SetPoints(points)


def set_colours(data: vtkPolyData, colours: Array) -> None:
    """Gives points colours (n, 3), 0 to 1."""
    levels = np.clip(np.round(255.0 * colours), 0.0, 255.0).astype(np.uint8)
    data.GetPointData().SetScalars(numpy_to_vtk(levels, deep=True))


def set_pose(actor: vtkActor, pose: Array) -> None:
    """Places an actor by a homogeneous matrix (4, 4)."""
    matrix = actor.GetUserMatrix()
    if matrix is None:
        matrix = vtkMatrix4x4()
        actor.SetUserMatrix(matrix)
    matrix.DeepCopy(pose.ravel().tolist())


def actor_of(data: vtkPolyData, *, lit: bool = True) -> vtkActor:
    """An actor for a surface; without light its colours are unshaded."""
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    return actor_with(mapper, lit=lit)


def actor_with(mapper: vtkMapper, *, lit: bool = True) -> vtkActor:
    """An actor with the matt surface that all actors of this project share."""
    actor = vtkActor()
    actor.SetMapper(mapper)
    surface = actor.GetProperty()
    surface.SetAmbient(0.0 if lit else 1.0)
    surface.SetDiffuse(1.0 if lit else 0.0)
    surface.SetInterpolationToGouraud()
    surface.SetLighting(lit)
    if lit:
        dress(actor)
    return actor


def level(direction: Array, up: Array) -> Array:
    """The unit vector perpendicular to `up` that is closest to the direction."""
    flat: Array = direction - (direction @ up) * up
    length = float(np.linalg.norm(flat))
    if length > 1e-6:
        return flat / length
    return level(np.array([0.0, 0.0, 1.0]), up)  # straight up or down: any level direction will do
