"""Frames of a simulation as arrays of pixels, drawn by VTK off screen: no display and no graphics card are needed.

Importing this imports VTK; `rover_gym.render_options` and `rover_gym.appearance` do not.
"""

from rover_gym.extras import MissingExtraError

try:
    from rover_gym.rendering.frames import FrameRenderer
except ModuleNotFoundError as error:
    if (error.name or "").partition(".")[0] != "vtkmodules":
        raise
    raise MissingExtraError("vtk", "render") from error

__all__ = ["FrameRenderer"]
