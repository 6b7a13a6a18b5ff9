"""Frames of balls between walls, without a rover."""

from collections.abc import Iterable
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkActor, vtkRenderer

from rover_gym.rendering.appearance import Array, set_pose
from rover_gym.rendering.frames import QuietLog, open_window
from rover_gym.rendering.scenery_actors import headlight, sky, sun


class BedRenderer:
    """Draws frames of actors that stand still or are moved by their owner; a context manager.

    Args:
        actors: What to draw, besides sun and sky.
        width: Pixels, even.
        height: Pixels, even.

    Raises:
        OSError: No OpenGL library works on this machine; the message names the packages that provide one.
    """

    def __init__(self, actors: Iterable[vtkActor], *, width: int = 960, height: int = 540) -> None:
        self._size = width, height
        self._window = open_window(width, height)
        self._scene = vtkRenderer()
        self._scene.AutomaticLightCreationOff()
        self._scene.AddLight(sun(0.85))
        self._scene.AddLight(headlight(0.25))
        self._window.AddRenderer(self._scene)
        self._sky = sky()
        for actor in (self._sky, *actors):
            self._scene.AddActor(actor)
        self._pixels = vtkUnsignedCharArray()

    def render(self, eye: npt.ArrayLike, target: npt.ArrayLike, angle: float) -> npt.NDArray[np.uint8]:
        """An image (height, width, 3) uint8, top row first.

        Args:
            eye: (3,) m.
            target: (3,) what the eye looks at, m.
            angle: Vertical field of view, rad.
        """
        at: Array = np.asarray(eye, dtype=np.float64)
        distance = float(np.linalg.norm(np.asarray(target, dtype=np.float64) - at))
        camera = self._scene.GetActiveCamera()
        camera.SetPosition(*at)
        camera.SetFocalPoint(*np.asarray(target, dtype=np.float64))
        camera.SetViewUp(0.0, 1.0, 0.0)
        camera.SetViewAngle(float(np.degrees(angle)))
        camera.SetClippingRange(0.02 * distance, 500.0)
        dome = np.eye(4)
        dome[:3, 3] = at
        set_pose(self._sky, dome)
        with QuietLog():
            self._window.Render()
        width, height = self._size
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._pixels, 0)
        pixels: npt.NDArray[np.uint8] = vtk_to_numpy(self._pixels)
        return pixels.reshape(height, width, 3)[::-1].copy()  # VTK's first row is the bottom one

    def close(self) -> None:
        """Frees the window and its memory; the renderer is unusable afterwards."""
        self._window.Finalize()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
