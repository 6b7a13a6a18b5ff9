"""Writes frames to an mp4 file (H.264) one at a time, so that a long run does not hold them in memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rover_gym.extras import MissingExtraError
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

if TYPE_CHECKING:
    from collections.abc import Generator
    from types import TracebackType

    import numpy as np
    import numpy.typing as npt

QUALITY = 7  # of imageio-ffmpeg's 0 to 10


class VideoWriter:
    """Writes frames of one size to an mp4 file; a context manager.

    Args:
        path: The file to write; an existing file is replaced. Its folder is created with the first frame.
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
            refuse(OptionError, "video", str(path), "must be a file's name that ends in .mp4")
        self._fps = fps
        self._write_frames: Any = imageio_ffmpeg.write_frames
        self._writer: Generator[None, npt.NDArray[np.uint8] | None, None] | None = None

    def append(self, frame: npt.NDArray[np.uint8]) -> None:
        """Adds a frame (height, width, 3) uint8 with even height and width."""
        if self._writer is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            height, width, _ = frame.shape
            self._writer = self._write_frames(
                str(self.path),
                (width, height),
                fps=self._fps,
                quality=QUALITY,
                macro_block_size=2,
                ffmpeg_log_level="error",
            )
            self._writer.send(None)
        self._writer.send(frame)

    def close(self) -> None:
        """Finishes the file."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
