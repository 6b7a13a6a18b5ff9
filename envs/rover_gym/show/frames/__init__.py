"""What a rover looks like: its parts, frames of a simulation as arrays of pixels, and video.

VTK draws frames off screen, without a display or a graphics card. VTK is imported on first access to `FrameRenderer`;
nothing else here needs it.
"""

from typing import TYPE_CHECKING, Any

from rover_gym.core.extras import MissingExtraError
from rover_gym.show.frames.render_options import RenderOptions, VideoWriter

if TYPE_CHECKING:
    from rover_gym.show.frames.frame_renderer import FrameRenderer

__all__ = ["FrameRenderer", "RenderOptions", "VideoWriter"]


def __getattr__(name: str) -> Any:
    """`FrameRenderer`, imported with VTK on first access."""
    if name != "FrameRenderer":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from rover_gym.show.frames.frame_renderer import FrameRenderer  # noqa: PLC0415
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "vtkmodules":
            raise
        raise MissingExtraError("vtk", "render") from error
    return FrameRenderer
