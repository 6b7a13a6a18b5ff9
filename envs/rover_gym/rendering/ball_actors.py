"""Tens of thousands of balls in one actor: each is a triangle that the renderer turns into an exact sphere."""

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from rover_gym.rendering.appearance import FIXED_BALL_COLOUR, SAND_COLOUR
from rover_gym.rendering.meshes import Array, actor_with, set_colours, set_points


class BallsActor:
    """Balls of sand, each with its own shade; those that no force moves are grey.

    Args:
        radius: (n,) m.
        kinematic: (n,) whether no force moves the ball; none by default.

    Attributes:
        actor: What VTK draws.
    """

    def __init__(self, radius: npt.ArrayLike, kinematic: npt.ArrayLike | None = None) -> None:
        radii = np.asarray(radius, dtype=np.float64)
        fixed = np.zeros(len(radii), dtype=bool) if kinematic is None else np.asarray(kinematic, dtype=bool)
        self._points = vtkPolyData()
        cells = vtkCellArray()  # the mapper draws points that are cells
        numbers = np.arange(len(radii) + 1, dtype=np.int64)
        cells.SetData(numpy_to_vtkIdTypeArray(numbers, deep=True), numpy_to_vtkIdTypeArray(numbers[:-1], deep=True))
        self._points.SetVerts(cells)
        self._sizes = numpy_to_vtk(radii.astype(np.float32), deep=True)
        self._sizes.SetName("radius")
        # The golden ratio spreads the shades evenly.
        shade = 0.84 + 0.3 * (np.arange(len(radii)) * 0.6180339887 % 1.0)
        colours = np.where(fixed[:, None], np.array(FIXED_BALL_COLOUR), np.array(SAND_COLOUR))
        self._colours = np.clip(shade[:, None] * colours, 0.0, 1.0)
        mapper = vtkOpenGLSphereMapper()
        mapper.SetInputData(self._points)
        mapper.SetScaleArray("radius")
        self.actor = actor_with(mapper)
        self.place(np.zeros((len(radii), 3)))

    def place(self, position: Array | npt.NDArray[np.float32]) -> None:
        """Moves the balls to (n, 3), m."""
        set_points(self._points, np.asarray(position, dtype=np.float64))
        set_colours(self._points, self._colours)
        self._points.GetPointData().AddArray(self._sizes)
        self._points.Modified()
