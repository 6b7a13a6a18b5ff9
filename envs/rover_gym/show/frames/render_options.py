"""What a film is made with: render options, checked without importing a renderer, and the writer of video."""

from __future__ import annotations

import errno
import importlib.util
import os
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from rover_gym.core import OptionError
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.files import written_whole
from rover_gym.core.validation import known_keys, refuse, vector, whole

if TYPE_CHECKING:
    from collections.abc import Generator
    from types import TracebackType

    import numpy as np
    import numpy.typing as npt


RENDER_MODES = ("rgb_array",)

CAMERAS = ("follow", "side", "top")

Camera: TypeAlias = str | tuple[tuple[float, ...], tuple[float, ...]]

# A frame must not be empty, and must fit into a video and into memory.
SMALLEST, LARGEST = 16, 8192


@dataclass(frozen=True)
class RenderOptions:
    """Options of `FrameRenderer`, by name.

    Attributes:
        width: Pixels, even: a video's frames must be.
        height: Pixels, even.
        camera: "follow" looks from behind, above and the right and turns smoothly with the rover; "side" looks from
            its right, low above the ground; "top" looks straight down, x up. A pair (eye, target) of world points, m,
            fixes the camera.
        show_forces: Draws contact forces as arrows, in front of everything.
        antialiasing: Smooths edges by drawing four pixels for each, up to 4096 pixels along an edge; in software a
            frame then takes two to three times as long.
    """

    width: int = 640
    height: int = 480
    camera: Camera = "follow"
    show_forces: bool = False
    antialiasing: bool = True


def check_render_options(field: str, given: Mapping[str, Any]) -> RenderOptions:
    """The given options, completed with defaults.

    Args:
        field: The argument's name, which errors name before the option's; may be empty.
        given: Attributes of `RenderOptions` by name.

    Raises:
        OptionError: A name is unknown or a value is out of range.
    """
    known_keys(field or "options", given, [entry.name for entry in fields(RenderOptions)])
    options = dict(given)
    prefix = f"{field}." if field else ""
    for name in ("width", "height"):
        if name in options:
            size = whole(prefix + name, options[name], at_least=SMALLEST, at_most=LARGEST)
            if size % 2:
                refuse(OptionError, prefix + name, options[name], "must be an even whole number")
            options[name] = size
    if "camera" in options:
        options["camera"] = _check_camera(prefix + "camera", options["camera"])
    for name in ("show_forces", "antialiasing"):
        if not isinstance(options.get(name, False), bool):
            refuse(OptionError, prefix + name, options[name], "must be True or False")
    return RenderOptions(**options)


def check_display(field: str) -> None:
    """Rejects a window where the system has no display.

    Raises:
        OptionError: Neither X11 nor Wayland has a display, and SDL is not set to do without.
    """
    named = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in named):
        reason = "needs a display, and none is set (DISPLAY, WAYLAND_DISPLAY): use 'rgb_array', or `rover live`"
        refuse(OptionError, field, "human", reason)


def check_render_mode(field: str, render_mode: object) -> str:
    """Checks that the environment knows the mode and that its packages are installed.

    Raises:
        OptionError: The mode is unknown.
        MissingExtraError: The renderer is not installed.
    """
    if not (isinstance(render_mode, str) and render_mode in RENDER_MODES):
        reason = f"unknown; known is {', '.join(RENDER_MODES)}, and gymnasium.make adds 'human', a window"
        refuse(OptionError, field, render_mode, reason)
    if importlib.util.find_spec("vtkmodules") is None:
        raise MissingExtraError("vtk", "render")
    return render_mode


def _check_camera(field: str, value: object) -> Camera:
    if isinstance(value, str):
        if value not in CAMERAS:
            refuse(OptionError, field, value, f"unknown; known are {', '.join(CAMERAS)} and a pair of points")
        return value
    if not isinstance(value, tuple | list) or len(value) != 2:
        refuse(OptionError, field, value, "must be a name or a pair (eye, target) of points")
    eye, target = (vector(f"{field}[{i}]", point, 3) for i, point in enumerate(value))
    if eye == target:
        refuse(OptionError, field, value, "must look from one point to another")
    return (eye, target)


QUALITY = 7  # of imageio-ffmpeg's 0 to 10


@contextmanager
def whole_film(path: str | Path) -> Iterator[Path]:
    """Gives the block an mp4 file to encode into, which takes the place of `path` when the block ends.

    Raises:
        OSError: The encoder did not finish the film, as on a full disk; an older file stays as it was.
    """
    try:
        with written_whole(path) as draft:
            yield draft
            if not _is_finished(draft):
                raise _failed(path)
    except (BrokenPipeError, subprocess.CalledProcessError) as error:
        raise _failed(path) from error


def _failed(path: str | Path) -> OSError:
    return OSError(errno.EIO, "the film was not finished; is the disk full?", str(path))


def _is_finished(film: Path) -> bool:
    """Whether an mp4 file has all its parts: the encoder may end without an error and leave half of one."""
    kinds, place, size = set(), 0, film.stat().st_size
    with film.open("rb") as file:
        while place < size:
            file.seek(place)
            length, kind = struct.unpack(">I4s", file.read(8).ljust(8, b"\0"))
            if length == 1:
                (length,) = struct.unpack(">Q", file.read(8).ljust(8, b"\0"))
            if length < 8:
                return False
            kinds.add(kind)
            place += length
    return place == size and b"moov" in kinds


class VideoWriter:
    """Writes frames of one size to an mp4 file; a context manager.

    The file is there once it is finished; an existing one is replaced then. An error leaves the existing one.

    Args:
        path: The file to write. Its folder is created with the first frame.
        fps: Frames per second.

    Raises:
        OptionError: The file name has another extension.
        MissingExtraError: imageio-ffmpeg is not installed.
    """

    def __init__(self, path: str | Path, fps: float) -> None:
        try:
            import imageio_ffmpeg  # noqa: PLC0415 - only needed for videos
        except ModuleNotFoundError as error:
            raise MissingExtraError("imageio-ffmpeg", "render") from error
        self.path = Path(path)
        if self.path.suffix.lower() != ".mp4":
            refuse(OptionError, "film", str(path), "must be a file's name that ends in .mp4")
        self._fps = fps
        self._write_frames: Any = imageio_ffmpeg.write_frames
        self._writer: Generator[None, npt.NDArray[np.uint8] | None, None] | None = None
        self._written = ExitStack()

    def append(self, frame: npt.NDArray[np.uint8]) -> None:
        """Adds a frame (height, width, 3) uint8 with even height and width."""
        if self._writer is None:
            draft = self._written.enter_context(whole_film(self.path))
            height, width, _ = frame.shape
            self._writer = self._write_frames(
                str(draft),
                (width, height),
                fps=self._fps,
                quality=QUALITY,
                macro_block_size=2,
                ffmpeg_log_level="error",
            )
            self._writer.send(None)
        try:
            self._writer.send(frame)
        except OSError as error:  # the encoder has ended, and its words name the draft
            raise _failed(self.path) from error

    def close(self) -> None:
        """Finishes the file.

        Raises:
            OSError: The disk is full.
        """
        self._end()
        self._written.close()

    def _end(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        self._written.__exit__(kind, error, trace)
